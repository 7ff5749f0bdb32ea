#!/usr/bin/env bash
# CalculiX 2.20, TYPE=MORTAR: one face dealt to two slave surfaces, as regions with a law each are.
#
# Guess: with the same law for both the face carries what it carries as one surface, 1.666667 N by two springs in series.
# Seen: nodes on the border of both count twice: the force is 50, 22, 11 % too high on 2, 4, 8 cells an edge. Exit
# code 0, no warning. NODE TO SURFACE is right.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n5., 0.01"
for cells, seen in ((2, 2.5), (4, 2.029826), (8, 1.855341)):
    for kind in ("NODE TO SURFACE", "MORTAR"):
        alike = dict(cells=cells, law=law, kind=kind)
        expect(f"{cells} cells, one surface, {kind}", forces(**alike)[0][2], 1.6666667)
        two = seen if kind == "MORTAR" else 1.6666667
        expect(f"{cells} cells, two surfaces, {kind}", forces(**alike, halves=True)[0][2], two)
EOF
