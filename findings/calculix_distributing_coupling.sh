#!/usr/bin/env bash
# CalculiX 2.20: a plate that presses through the reference node of a *COUPLING.
#
# Guess: with *KINEMATIC and with *DISTRIBUTING the node's force or displacement reaches the face, whether the node is named
# by its number or by a set, and its reaction is the force.
# Seen: with *DISTRIBUTING 4 N by the node's number arrive, by a set of the same node nothing does, and a displacement of the
# node moves nothing: the force is 0, exit code 0, no warning. With *KINEMATIC all is as guessed, and the reaction of the
# reference node is right under MORTAR too, where that of the plate is 0.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import os
import re
import subprocess

from calculix_deck import deck, expect

COUPLING = """*NODE, NSET=REF
9001, 0.5, 0.5, 0.25
*NSET, NSET=TOP
32, 33, 34, 35
*SURFACE, NAME=UPPER, TYPE=ELEMENT
9, S2
*COUPLING, CONSTRAINT NAME=ONE, REF NODE=9001, SURFACE=UPPER
"""


def run(how, load, kind="NODE TO SURFACE"):
    """Return the force of the base, and that of the reference node [N]."""
    text = deck(cells=2, kind=kind, more=f"{COUPLING}*{how}\n1, 3")
    held = "TOP" if how == "DISTRIBUTING" else "REF"
    text = text.replace("PLATE, 2, 2, 0.\nPLATE, 1, 1, 0.\nPLATE, 3, 3, -0.005\n", f"{held}, 1, 2, 0.\n{load}\n")
    text = text.replace("*NODE PRINT, NSET=PLATE, TOTALS=ONLY", "*NODE PRINT, NSET=REF, TOTALS=ONLY")
    with open("deck.inp", "w") as file:
        file.write(text)
    done = subprocess.run([os.environ["CCX"], "-i", "deck"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout[-1000:]
    with open("deck.dat") as file:
        printed = file.read()
    return [float(re.search(rf"for set {name} .*?\n\s*\n(.*?)\n", printed)[1].split()[2]) for name in ("BASE", "REF")]


moved = "REF, 3, 3, -0.005"
for load, what, seen in (
    ("*CLOAD\n9001, 3, -4.", "4 N by the node's number", 4.0),
    ("*CLOAD\nREF, 3, -4.", "4 N by a set of the node", 0.0),
    (moved, "displacement", 0.0),
):
    expect(f"DISTRIBUTING, {what}", run("DISTRIBUTING", load)[0], seen)
expect("KINEMATIC, 4 N by a set of the node", run("KINEMATIC", "*CLOAD\nREF, 3, -4.")[0], 4.0)
for kind in ("NODE TO SURFACE", "MORTAR"):
    base, reference = run("KINEMATIC", moved, kind)
    expect(f"KINEMATIC, displacement, {kind}", base, 3.813559)
    expect("  reaction of the reference node", reference, -3.813559)
EOF
