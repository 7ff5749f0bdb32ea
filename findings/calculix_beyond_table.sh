#!/usr/bin/env bash
# CalculiX 2.20: a tabulated law beyond its last row.
#
# Guess: the last slope is continued, as Abaqus does.
# Seen: with TYPE=NODE TO SURFACE the last pressure is held: the contact has lost its stiffness, and a cube that is
# pressed further bears no more (5 N where the slope would make 6.3333 and 17 N). TYPE=MORTAR continues the slope.
# No warning by either. End tables beyond the largest pressure that can occur.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n1., 0.001\n5., 0.0015"  # then 8000 MPa/mm
for shift, held, continued in (("0.003", 1.888889, 1.888889), ("0.008", 5.0, 6.333333), ("0.02", 5.0, 17.0)):
    for kind, seen in (("NODE TO SURFACE", held), ("MORTAR", continued)):
        expect(f"displacement of {shift} mm, {kind}", forces(law=law, shift=shift, kind=kind)[0][2], seen)
EOF
