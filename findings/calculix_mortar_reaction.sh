#!/usr/bin/env bash
# CalculiX 2.20: under TYPE=MORTAR the pressed plate has no reaction, and no contact stress is printed.
#
# Guess: *NODE PRINT of RF gives force and counterforce on both bodies, as with TYPE=NODE TO SURFACE, and
# *CONTACT PRINT of CSTR a row for each node in contact.
# Seen: the solution is right (the cube's base bears 4.1667 N with either type, on every mesh), but the
# prescribed plate's reaction is 0 and CSTR prints no row. Read the reaction at the other body.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

for kind, plate, rows in (("NODE TO SURFACE", -4.166667, 9), ("MORTAR", 0.0, 0)):
    base, other, printed = forces(cells=2, kind=kind)
    expect(f"{kind}: force on the base", base[2], 4.166667)
    expect(f"{kind}: force on the plate", other[2], plate)
    expect(f"{kind}: rows of contact stress", printed, rows)
EOF
