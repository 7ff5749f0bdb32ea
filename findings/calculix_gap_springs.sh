#!/usr/bin/env bash
# CalculiX 2.20: a tabulated law that begins before the faces touch carries nothing across the gap.
#
# Guess: PRESSURE-OVERCLOSURE=TABULAR takes negative overclosures (the manual's tables may start below 0), so a
# law of 0 MPa at -0.001 mm and 5 MPa at 0 acts across gaps of up to 0.001 mm on every mesh.
# Seen: a node gets its spring only where the gap is within about 1e-3 of the square root of its area. A gap of
# 0.5 um bears 0.156 N on one cell (0.4167 N by the law in series with the cube) and exactly 0 on 2, 4, 8
# cells; a gap of 0.2 um bears 0 on all. Exit code 0, no warning. Let tables begin at overclosure 0 and put
# the faces where the law begins.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., -0.001\n5., 0.\n55., 0.01"
for gap, series, seen in ((5e-4, 0.4166667, 0.15625), (2e-4, 0.6666667, 0.0)):
    for cells in (1, 2, 4, 8):
        found = forces(cells=cells, law=law, gap=gap, shift="0.")[0][2]
        expect(f"gap of {1e3 * gap} um, {cells} cells an edge, by the law {series} N", found, seen if cells == 1 else 0.0)
EOF
