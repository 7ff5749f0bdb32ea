#!/usr/bin/env bash
# CalculiX 2.20: an exponential law under the types of contact pairs.
#
# Guess: the law of the deck is the same under all of them.
# Seen: it is under NODE TO SURFACE and SURFACE TO SURFACE when the faces touch (4.6655 N). Across a gap of half its
# range it acts by nodes alone (0.0718 N, else 0). Under MORTAR it depends on the mesh: 4.6249 N on one cell, 3.6712
# on four. Exit code 0, no warning.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n0.001, 1."  # from a gap of 0.001 mm on; 1 MPa at touch
types = {"NODE TO SURFACE": (4.665549, 4.665549, 0.071834), "SURFACE TO SURFACE": (4.665549, 4.665549, 0.0)}
for kind, (one, four, across) in {**types, "MORTAR": (4.624941, 3.67118, 0.0)}.items():
    expect(f"{kind}, one cell", forces(kind=kind, law=law)[0][2], one)
    expect(f"{kind}, four cells", forces(kind=kind, law=law, cells=2)[0][2], four)
    expect(f"{kind}, across a gap of 0.0005 mm", forces(kind=kind, law=law, gap=5e-4, shift="0.")[0][2], across)
EOF
