#!/usr/bin/env bash
# CalculiX 2.20: *GAP CONDUCTANCE, a table of conductance over pressure, in *COUPLED TEMPERATURE-DISPLACEMENT.
#
# Guess: the conductance is that at the contact pressure, with all types of contact and of laws.
# Seen: so it is under SURFACE TO SURFACE. Under NODE TO SURFACE the pressure that a linear law is read at is its slope, 5000 for
# 5000 MPa/mm, whatever the load; that of a tabulated law is 0: a table that says "as many as MPa" gives 5000 and 0 in
# place of 1.67 and 4.17. Exit code 0, no warning. MORTAR says that it has none (exit code 201). A constant conductance is right.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import os
import re
import subprocess

from calculix_deck import TABLE, deck, expect

LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-6, 1e-9"
OVER_PRESSURE = "0., 0., 0.\n100000., 100000., 0."  # conductance, pressure, temperature


def run(kind, law, table, shift):
    """Return force [N] and conductance of the contact, which lies in series with cube and plate."""
    text = deck(cells=2, kind=kind, law=f"{law}\n*GAP CONDUCTANCE\n{table}", shift=shift, printed="*NODE PRINT, NSET=TOP, TOTALS=ONLY\nRFL")
    material = "1000., 0.\n*CONDUCTIVITY\n1000.\n*EXPANSION\n0.\n*SPECIFIC HEAT\n1.\n*DENSITY\n1e-9\n*SOLID"
    text = text.replace("1000., 0.\n*SOLID", material, 1)
    start = "*NSET, NSET=TOP\n32, 33, 34, 35\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nCUBE, 0.\nPLATE, 0.\n*STEP"
    text = text.replace("*STEP", start, 1).replace("*STATIC", "*COUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE")
    text = text.replace("*BOUNDARY\n", "*BOUNDARY\nBASE, 11, 11, 0.\nTOP, 11, 11, 100.\n", 1)
    with open("deck.inp", "w") as file:
        file.write(text)
    done = subprocess.run([os.environ["CCX"], "-i", "deck"], capture_output=True, text=True, timeout=300, check=False)
    if done.returncode:
        return done.returncode, None
    with open("deck.dat") as file:
        printed = file.read()
    heat = float(re.search(r"heat generation for set TOP .*?\n\s*\n(.*?)\n", printed)[1])
    force = float(re.search(r"total force .*? for set BASE .*?\n\s*\n(.*?)\n", printed)[1].split()[2])
    return force, 1 / (100 / heat - 1 / 1000 - 0.25 / 2250)


for name, kind, law, seen in (
    ("SURFACE TO SURFACE, linear", "SURFACE TO SURFACE", LINEAR, (1.666667, 4.166667)),
    ("NODE TO SURFACE, linear", "NODE TO SURFACE", LINEAR, (5000, 5000)),
    ("NODE TO SURFACE, tabulated", "NODE TO SURFACE", TABLE, (0, 0)),
):
    expect(f"{name}: conductance of 500", run(kind, law, "500., , 0.", "0.005")[1], 500)
    for shift, pressure, conductance in zip(("0.002", "0.005"), (1.666667, 4.166667), seen):
        force, found = run(kind, law, OVER_PRESSURE, shift)
        expect("  pressure", force, pressure)
        expect("  conductance", found, conductance)
code, _ = run("MORTAR", LINEAR, OVER_PRESSURE, "0.005")
print("MORTAR: exit code", code)
assert code == 201
EOF
