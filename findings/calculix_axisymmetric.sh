#!/usr/bin/env bash
# CalculiX 2.20: contact of axisymmetric elements (CAX4), as for a disc or the ring of a seal.
#
# Guess: loads and reactions are those of the whole ring; a uniform pressure is uniform.
# Seen: *CLOAD takes the load of the whole ring, *NODE PRINT of RF gives that of 2 degrees of it, 1/180: 50 N come back as
# 0.27778 N. On a disc of four elements, pressed evenly, the printed pressure at the axis is 25 % too low under NODE TO
# SURFACE (16 elements: 8 %), and the force under SURFACE TO SURFACE 2.3 %. A ring without the axis has its force, but
# 1.9 % too little pressure at the inner edge. MORTAR refuses axisymmetric and plane elements; plane ones (CPE4) are right.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import math
import os
import re
import subprocess

from calculix_deck import TABLE, expect

LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-6, 1e-9"
CELLS = 4


def press(kind="NODE TO SURFACE", law=TABLE, element="CAX4", inner=0.0, cells=CELLS, load="PN, 2, 2, -0.005", force=""):
    """Return exit code, force on the base [N] and pressures at the nodes [MPa], E = 1000 MPa, nu = 0, radius 2 mm."""
    places = [inner + (2.0 - inner) * n / cells for n in range(cells + 1)]
    lines, up = ["*NODE, NSET=ALLN"], cells + 1
    for first, heights in ((1, (-1.0, 0.0)), (101, (0.0, 0.25))):
        for row, height in enumerate(heights):
            lines += [f"{first + n + row * up}, {x:.9g}, {height}, 0." for n, x in enumerate(places)]
    for first, name in ((1, "CUBE"), (101, "PLATE")):
        lines += [f"*ELEMENT, TYPE={element}, ELSET={name}"]
        lines += [f"{n}, {n}, {n + 1}, {n + 1 + up}, {n + up}" for n in range(first, first + cells)]
    lines += ["*MATERIAL, NAME=ALL", "*ELASTIC", "1000., 0."]
    for name in ("CUBE", "PLATE"):
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=ALL", *(["1."] if element == "CPE4" else [])]
    lines += ["*SURFACE INTERACTION, NAME=LAW", *law.splitlines()]
    for name, first, side in (("MASTER", 101, "S1"), ("SLAVE", 1, "S3")):
        lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *(f"{n}, {side}" for n in range(first, first + cells))]
    lines += [f"*CONTACT PAIR, INTERACTION=LAW, TYPE={kind}", "SLAVE, MASTER"]
    for name, first, last in (("BASE", 1, up), ("PN", 101, 100 + 2 * up)):
        lines += [f"*NSET, NSET={name}, GENERATE", f"{first}, {last}"]
    lines += ["*STEP, INC=1000", "*STATIC", "1., 1.", "*CONTROLS, PARAMETERS=FIELD", "1e-8, 1e-8, , , 1e-8"]
    lines += ["*BOUNDARY", "ALLN, 1, 1, 0.", "BASE, 2, 2, 0.", *([load] if load else []), *force.splitlines()]
    lines += ["*NODE PRINT, NSET=BASE, TOTALS=ONLY", "RF", "*CONTACT PRINT", "CSTR", "*END STEP", ""]
    with open("deck.inp", "w") as file:
        file.write("\n".join(lines))
    done = subprocess.run([os.environ["CCX"], "-i", "deck"], capture_output=True, text=True, timeout=300, check=False)
    if done.returncode:
        return done.returncode, "is connected als dependent node" in done.stdout, []
    with open("deck.dat") as file:
        printed = file.read()
    total = float(re.search(r"for set BASE .*?\n\s*\n(.*?)\n", printed)[1].split()[1])
    rows = [line.split() for line in printed.partition("contact stress")[2].splitlines()]
    return 0, total, [float(row[1]) for row in rows if len(row) == 4]


ring, pressure = math.pi * 4, 1 / (1 / 1000 + 1 / 5000) * 0.005
print(f"a pressure of {pressure:.4f} MPa on the disc is {ring * pressure:.4f} N, 1/180 of it {ring * pressure / 180:.5f} N")
expect("loads of 50 N in all", press(load="", force="*CLOAD\n" + "\n".join(f"{106 + n}, 2, -10." for n in range(5)))[1], 50 / 180)
_, force, pressures = press()
expect("disc, NODE TO SURFACE", force, 0.290685)
expect("  pressure at the axis", min(pressures), 3.119434)
expect("  of 16 elements", min(press(cells=16)[2]), 3.843581)
expect("disc, SURFACE TO SURFACE", press("SURFACE TO SURFACE", LINEAR)[1], 0.2843256)
_, force, pressures = press(inner=1.0)
expect("ring, NODE TO SURFACE", force, 0.2181181)
expect("  pressure at the inner edge", min(pressures), 4.088983)
expect("strip of plane strain, 1 mm thick", press(element="CPE4")[1], 2 * pressure)
code, named, _ = press("MORTAR")
print("MORTAR: exit code", code)
assert code == 201 and named, "MORTAR took axisymmetric elements"
EOF
