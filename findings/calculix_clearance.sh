#!/usr/bin/env bash
# CalculiX 2.20: *CLEARANCE between faces that are drawn in touch.
#
# Guess: its value is the gap from which the law counts, with all types of contact.
# Seen: with TYPE=SURFACE TO SURFACE it is. With NODE TO SURFACE, the type that takes tables, it does nothing: the
# force is that without a gap, exit code 0, no warning. Draw the gap.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-4"
clearance = "*CLEARANCE, SLAVE=SLAVE, MASTER=MASTER, VALUE=0.001"
for kind, touching, stated in (("SURFACE TO SURFACE", 4.166667, 3.333333), ("NODE TO SURFACE", 4.166655, 4.166655)):
    expect(f"{kind}, drawn in touch", forces(law=law, kind=kind)[0][2], touching)
    expect(f"{kind}, drawn with a gap of 0.001 mm", forces(law=law, kind=kind, gap=1e-3)[0][2], 3.333333)
    expect(f"{kind}, *CLEARANCE of 0.001 mm", forces(law=law, kind=kind, more=clearance)[0][2], stated)
EOF
