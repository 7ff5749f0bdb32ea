#!/usr/bin/env bash
# CalculiX 2.20, TYPE=MORTAR: a tabulated law whose slope falls.
#
# Guess: any table of rising pressures is taken, as with TYPE=NODE TO SURFACE.
# Seen: a part of the table whose line, drawn back, meets overclosure 0 at a pressure above 0 bears nothing: the
# force is 0, exit code 0, no warning. A slope that falls from 5000 to 4999 MPa/mm at 1 MPa is enough. Parts whose
# slope falls less far are right at some loads, lost at others. Laws that yield (hardness) and softening ones need
# NODE TO SURFACE.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

tables = {
    "5000, then 4999 MPa/mm": ("0., 0.\n1., 0.0002\n50.99, 0.0102", {"0.0008": 0.6666667, "0.002": 1.666644}),
    "5000, then 4000 MPa/mm": ("0., 0.\n1., 0.0002\n5., 0.0012", {"0.0008": 0.6666667, "0.002": 1.64}),
    "1237, 13975, 10269 MPa/mm": (
        "0., 0.\n0.6185, 0.0005\n7.606, 0.001\n12.7405, 0.0015",
        {"0.00486225": 4.11225, "0.01142325": 10.17325},
    ),
    "1000, 5000, 4000 MPa/mm": ("0., 0.\n1., 0.001\n2., 0.0012\n6., 0.0022", {"0.0008": 0.4, "0.004": 2.64}),
}
for name, (rows, cases) in tables.items():
    law = f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n{rows}"
    for shift, right in cases.items():
        expect(f"{name}, {shift} mm, NODE TO SURFACE", forces(law=law, shift=shift)[0][2], right)
        lost = (name[:4], shift) in (("5000", "0.002"), ("1237", "0.01142325"))
        mortar = forces(law=law, shift=shift, kind="MORTAR")[0][2]
        expect(f"{name}, {shift} mm, MORTAR", mortar, 0.0 if lost else right)
EOF
