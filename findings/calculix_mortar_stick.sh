#!/usr/bin/env bash
# CalculiX 2.20, TYPE=MORTAR: the stick slope of *FRICTION, and increments.
#
# Guess: a plate that is pressed on, then shifted by 0.001 mm, is held by stick slope times shift less what the cube
# gives way, 0.9276 of it here, in as many increments as one likes; and by nothing when it is back.
# Seen: under NODE TO SURFACE so; under MORTAR the force grows with the number of increments of the steps, by 2 % from
# 1 to 10, and 9 % stay when the plate is back, where friction bears six times that force. Exit code 0, no warning.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import calculix_deck
from calculix_deck import TABLE

SLOPE, SHIFT = 4000.0, 1e-3  # MPa/mm, mm
law = f"{TABLE}\n*FRICTION\n1., {SLOPE}"
plain = calculix_deck.deck


def sheared(kind, increment, *way):
    """Return the share of slope times shift that the base bears after the plate is pressed on and shifted along a way."""
    text = plain(kind=kind, law=law).replace("CUBE, 1, 2, 0.", "BASE, 1, 2, 0.").replace("1000., 0.", "2e5, 0.")
    before, step = text[: text.index("*STEP")], text[text.index("*STEP") :]
    step = step.replace("*STATIC\n1., 1.", f"*STATIC\n{increment}, 1., 1e-6, {increment}")
    steps = [step.replace("PLATE, 1, 1, 0.", f"PLATE, 1, 1, {x}") for x in (0.0, *way)]
    calculix_deck.deck = lambda: before + "".join(steps)
    return abs(calculix_deck.forces()[0][0]) / (SLOPE * SHIFT)


seen = {("MORTAR", 1.0): (0.9281, 0.0), ("MORTAR", 0.5): (0.9392, 1.4e-4), ("MORTAR", 0.1): (0.9483, 0.0895)}
for increment in (1.0, 0.5, 0.1):
    for kind in ("NODE TO SURFACE", "MORTAR"):
        held, back = sheared(kind, increment, SHIFT), sheared(kind, increment, SHIFT, 0.0)
        print(f"{kind}, increments of {increment}: {held:.4f}, back {back:.4f}")
        expected = seen.get((kind, increment), (0.9276, 0.0))
        if abs(held - expected[0]) > 2e-4 or abs(back - expected[1]) > 2e-4:
            raise SystemExit(f"changed: {expected} was seen with CalculiX 2.20")
EOF
