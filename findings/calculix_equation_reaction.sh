#!/usr/bin/env bash
# CalculiX 2.20: the force of a face that a reference node moves, or of a plate that is tied to it.
#
# Guess: *NODE PRINT of RF at what is moved is the force that the base bears, 5 N, as with *RIGID BODY.
# Seen: so it is with *RIGID BODY. With an *EQUATION per node, and with *TIE, it is printed as 0, although the base bears 5 N: where all
# terms of an equation but one are prescribed, the force that they take over is in no reaction. Exit code 0, no warning. A
# curve of force over displacement at such a node is a line at 0; read the reaction at the other end.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import re

from calculix_deck import deck, expect, forces_of

text = deck(cells=2, printed="*NODE PRINT, NSET=REF, TOTALS=ONLY\nRF")
mesh, rest = text.split("*SURFACE INTERACTION", 1)
surfaces, rest = rest[rest.index("*SURFACE, NAME=MASTER") :].split("*CONTACT PAIR", 1)
steps = rest[rest.index("*NSET, NSET=BASE") :]
mesh += "*NODE, NSET=REF\n900, 0.5, 0.5, 0.5\n*NODE\n901, 0.5, 0.5, 0.5\n"
top = range(19, 28)  # the nodes of the upper face
equations = "".join(f"*EQUATION\n2\n{n}, 3, 1., 900, 3, -1.\n" for n in top)
body = "*NSET, NSET=TOP\n" + "".join(f"{n},\n" for n in top)
body += "*RIGID BODY, NSET=TOP, REF NODE=900, ROT NODE=901\n"
moved = "\n".join(["*BOUNDARY", "900, 3, 3, -0.005", "BASE, 3, 3, 0."])
steps = steps.replace("*BOUNDARY\nBASE, 3, 3, 0.", moved)
turned = steps.replace("CUBE, 1, 2, 0.", "BASE, 1, 2, 0.\n900, 1, 2, 0.\n901, 1, 3, 0.")
for name, where, changed, seen in (
    ("*TIE", "PLATE", mesh + surfaces + "*TIE, NAME=TIE\nSLAVE, MASTER\n" + steps, 0.0),
    ("*EQUATION", "REF", mesh + equations + steps, 0.0),
    ("*RIGID BODY", "REF", mesh + body + turned, -5.0),
):
    base, _, _ = forces_of(changed)
    with open("deck.dat") as file:
        row = re.findall(rf"for set {where} .*?\n\s*\n(.*?)\n", file.read())[-1]
    expect(f"{name}: force at the base", base[2], 5.0)
    expect(f"{name}: reaction of what is moved", float(row.split()[2]), seen)
EOF
