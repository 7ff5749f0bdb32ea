#!/usr/bin/env bash
# CalculiX 2.20: *CONTACT PRINT with CELS, the energy of contact springs, with friction.
#
# Guess: it is the energy that the springs hold: the integral of a table, and half of shear times slip while it sticks.
# Seen: the normal part is the integral. The part along the face is shear times slip, twice what the springs hold and give
# back: 0.002 mJ for 2 N at 0.001 mm, in one increment or a hundred, NODE TO SURFACE as SURFACE TO SURFACE. Of sliding it
# counts the springs alone, twice again; the work of friction is not in it.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import os
import re
import subprocess

from calculix_deck import TABLE, deck, expect

LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-6, 1e-9"
RISING = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n1., 0.001\n9., 0.002"
FRICTION = "\n*FRICTION\n0.5, 2000."  # coefficient, stick slope
PRINTED = "*CONTACT PRINT, TOTALS=ONLY\nCELS"
CONTROLS = "*CONTROLS, PARAMETERS=FIELD\n1e-8, 1e-8, , , 1e-8"


def energies(text):
    with open("deck.inp", "w") as file:
        file.write(text)
    done = subprocess.run([os.environ["CCX"], "-i", "deck"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout[-1000:]
    with open("deck.dat") as file:
        return [float(one) for one in re.findall(r"total contact spring energy .*?\n\s*\n\s*(\S+)", file.read())]


pressure, slip, limit = 3.222222, 0.001, 0.5 * 4.166667
overclosure = 0.001 + (pressure - 1) / 8000
integral = 0.0005 + (1 + pressure) / 2 * (overclosure - 0.001)
expect("a table of two slopes", energies(deck(law=RISING, shift="0.0045", printed=PRINTED))[-1], integral)
for kind, law in (("NODE TO SURFACE", TABLE), ("SURFACE TO SURFACE", LINEAR)):
    for count in (1, 100):
        text = deck(kind=kind, law=law + FRICTION, printed=PRINTED)
        for shear in (slip, 0.0, 0.01):
            text += f"*STEP, INC=1000\n*STATIC, DIRECT\n{1 / count}, 1.\n{CONTROLS}\n*BOUNDARY\nPLATE, 1, 1, {shear}\n*END STEP\n"
        found = energies(text)
        print(f"{kind}, increments a step: {count}")
        expect("  pressed", found[0], 4.166667**2 / 5000 / 2)
        expect(f"  sheared, springs hold {2000 * slip**2 / 2}", found[count] - found[0], 2000 * slip**2)
        expect("  sheared back", found[2 * count] - found[0], 0)
        expect(f"  slid, springs hold {limit**2 / 2000 / 2:.6g}", found[3 * count] - found[0], limit**2 / 2000)
EOF
