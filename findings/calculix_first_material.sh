#!/usr/bin/env bash
# CalculiX 2.20: an unused material changes the contact force.
#
# Guess: what a *SURFACE BEHAVIOR or *FRICTION card leaves out (slope of HARD, tension at clearance of LINEAR,
# stick slope) has a default, or is scaled by the bodies in contact.
# Seen: it is scaled by Young's modulus of the first *MATERIAL of the deck, whether or not anything is made of
# it. A cube bears 4.9017 N under a HARD contact; with an unused steel in front 4.9993 N, with an unused foam
# 0.4545 N (the slope is 50 E). With LINEAR and its slope alone the normal force falls from 4.1643 to 3.8632 N.
# With *FRICTION and its coefficient alone the force along the face is 0.05, 1.93 or 0.0001 N (the stick slope
# is E/2). No warning. State all fields of these cards.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

HARD = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"
LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000."
material = "*MATERIAL, NAME=UNUSED\n*ELASTIC\n{}, 0."
cases = {"none": "", "steel": material.format(200000.0), "foam": material.format(2.0)}
seen = {"none": (4.901681, 4.164286, 0.05), "steel": (4.999297, 3.863229, 1.931615), "foam": (0.4545195, 4.166662, 1e-4)}
for name, first in cases.items():
    hard, linear, along = seen[name]
    print(f"unused material in front: {name}")
    expect("  HARD, normal force", forces(law=HARD, first=first)[0][2], hard)
    expect("  LINEAR, normal force", forces(law=LINEAR, first=first)[0][2], linear)
    rubbed = forces(law=f"{LINEAR}\n*FRICTION\n0.5", first=first, shear="1e-4")[1][0]
    expect("  FRICTION without stick slope, force along x", rubbed, along)
    stated = forces(law=f"{LINEAR}\n*FRICTION\n0.5, 2000.", first=first, shear="1e-4")[1][0]
    expect("  FRICTION with stick slope 2000, force along x", stated, 0.2)
EOF
