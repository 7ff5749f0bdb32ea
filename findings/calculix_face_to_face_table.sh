#!/usr/bin/env bash
# CalculiX 2.20: a tabulated law under TYPE=SURFACE TO SURFACE.
#
# Guess: it takes the laws that NODE TO SURFACE takes.
# Seen: it takes linear, hard and exponential ones; under a table the faces pass through each other without a force,
# exit code 0, no warning.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import TABLE, expect, forces

laws = {"table": TABLE, "linear": "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-4"}
for name, by_nodes, by_faces in (("table", 4.166667, 0.0), ("linear", 4.166655, 4.166667)):
    expect(f"{name}, NODE TO SURFACE", forces(law=laws[name])[0][2], by_nodes)
    expect(f"{name}, SURFACE TO SURFACE", forces(law=laws[name], kind="SURFACE TO SURFACE")[0][2], by_faces)
EOF
