#!/usr/bin/env bash
# CalculiX 2.20: the tangent stiffness of a pressed contact, from a small displacement in a *STATIC step with PERTURBATION.
#
# Guess: the cube follows the plate, and the reaction is that of law and cube in series, 0.0833 N of a shift by 0.0001 mm.
# Seen: displacements that *BOUNDARY gives in such a step reach no free node: the cube stands still, its base has no reaction, and the plate
# has that of the law alone, 0.5 N. A bar of two elements without any contact is likewise twice as stiff as it is. Exit code 0, no warning of it.
# A force by *CLOAD moves all as it should, but for the 0.8 % by which the preload's stresses change the bar; so does *BOUNDARY in a
# step without PERTURBATION.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'END'
from calculix_deck import TABLE, deck, expect, forces_of

SERIES = 1e-4 / (1 / 5000 + 1 / 1000)
LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-6, 1e-9"
printed = "".join(f"*NODE PRINT, NSET={part}, TOTALS=ONLY\nRF\n" for part in ("BASE", "PLATE"))
for kind, law in (("NODE TO SURFACE", TABLE), ("SURFACE TO SURFACE", LINEAR)):
    for step, seen in (("*STEP", (SERIES, SERIES)), ("*STEP, PERTURBATION", (0.0, 0.5))):
        more = f"{step}\n*STATIC\n*BOUNDARY\nPLATE, 3, 3, -1e-4\n{printed}*END STEP\n"
        base, plate, _ = forces_of(deck(kind=kind, law=law, printed="") + more)
        expect(f"{kind}, {step}: base", base[2], seen[0])
        expect(f"{kind}, {step}: plate", -plate[2], seen[1])
    push = "*BOUNDARY, OP=NEW\nPLATE, 1, 2\nBASE, 1, 3\nCUBE, 1, 2\n*CLOAD\nPLATE, 3, -0.01\n"
    base, _, _ = forces_of(deck(kind=kind, law=law, printed="") + f"*STEP, PERTURBATION\n*STATIC\n{push}{printed}*END STEP\n")
    expect(f"{kind}, a force of 0.08 N: base", base[2], 0.0806737)

ring = ((0, 0), (1, 0), (1, 1), (0, 1))
nodes = [f"{4 * z + n + 1}, {x}, {y}, {z}" for z in range(3) for n, (x, y) in enumerate(ring)]
bar = ["*NODE, NSET=ALL", *nodes, "*NSET, NSET=BASE", "1, 2, 3, 4", "*NSET, NSET=PLATE", "9, 10, 11, 12"]
bar += ["*ELEMENT, TYPE=C3D8, ELSET=BAR", "1, 1, 2, 3, 4, 5, 6, 7, 8", "2, 5, 6, 7, 8, 9, 10, 11, 12"]
bar += ["*MATERIAL, NAME=BAR", "*ELASTIC", "1000., 0.", "*SOLID SECTION, ELSET=BAR, MATERIAL=BAR"]
bar += ["*STEP", "*STATIC", "*BOUNDARY", "ALL, 1, 2", "BASE, 3", "PLATE, 3, 3, 0.", "*END STEP"]
for step, seen in (("*STEP", 0.05), ("*STEP, PERTURBATION", 0.1)):
    text = "\n".join([*bar, step, "*STATIC", "*BOUNDARY", "PLATE, 3, 3, -1e-4", printed + "*END STEP", ""])
    expect(f"bar, {step}: reaction", -forces_of(text)[1][2], seen)
END
