#!/usr/bin/env bash
# CalculiX 2.20: natural frequencies after a step that closes a contact.
#
# Guess: the face is as stiff as the contact left it, so that a pressed bar swings at 430.2 kHz, between free and held end.
# Seen: only with *STEP, PERTURBATION, and not with TYPE=MORTAR. Otherwise the face is free, 251.6 kHz, exit code 0 and no
# warning.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import os
import re
import subprocess

from calculix_deck import TABLE, deck, expect

LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-6, 1e-9"
FREE, SPRING = 251609.3, 430193.0  # bar of 4 linear elements with consistent masses, its end free or on 5000 N/mm


def frequency(kind, law, step):
    """Return the frequency of the lowest mode along the bar [Hz]."""
    text = deck(kind=kind, law=law, cells=4, shift="0.00005", printed="").replace("*ELASTIC", "*DENSITY\n1e-9\n*ELASTIC", 1)
    held = "BASE" if kind == "MORTAR" else "CUBE"
    text += f"{step}\n*FREQUENCY\n8\n*BOUNDARY\nBASE, 3, 3\n{held}, 1, 2\nPLATE, 1, 3\n*END STEP\n"
    with open("deck.inp", "w") as file:
        file.write(text)
    done = subprocess.run([os.environ["CCX"], "-i", "deck"], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0 and "*ERROR" not in done.stdout, done.stdout[-1000:]
    with open("deck.dat") as file:
        modes, _, rest = file.read().partition("P A R T I C I P A T I O N")
    values = [float(line.split()[3]) for line in modes.splitlines() if re.match(r"\s+\d+(\s+\S+){4}$", line)]
    shares = [abs(float(line.split()[3])) for line in rest.splitlines() if re.match(r"\s+\d+(\s+\S+){6}$", line)]
    return values[max(range(8), key=shares.__getitem__)]


for kind, law in (("NODE TO SURFACE", TABLE), ("SURFACE TO SURFACE", LINEAR), ("MORTAR", TABLE)):
    for step, seen in (("*STEP", FREE), ("*STEP, PERTURBATION", FREE if kind == "MORTAR" else SPRING)):
        expect(f"{kind}, {step}", frequency(kind, law, step), seen)
EOF
