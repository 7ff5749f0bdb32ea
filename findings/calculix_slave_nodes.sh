#!/usr/bin/env bash
# CalculiX 2.20: a slave surface of nodes bears more than the same surface of element faces.
#
# Guess: with TYPE=NODE TO SURFACE both are the same, as the nodes are those of the faces, or a surface of nodes
# has no area and a law of pressures is refused.
# Seen: every node gets an area that is too large. Cube and law in series bear 4.1667 N, which faces of elements
# give on every mesh; nodes give 4.6875, 4.4924, 4.3574 N on 1, 2, 4 cells an edge. Exit code 0, no warning.
# With a law 200 times softer than the cube it is 2.97, 1.99, 1.50 times the force: every node of an n x n face
# carries (1 + 2/n) times its share.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import TABLE, expect, forces

soft = TABLE.replace("50.,", "0.05,")  # 5 MPa/mm: the cube is 200 times stiffer
for cells, nodes, softer in ((1, 4.6875, 0.07389163), (2, 4.492403, 0.04947450), (4, 4.357402, 0.03720812)):
    print(f"{cells} cells an edge")
    expect("  faces", forces(cells=cells)[0][2], 4.166667)
    expect("  nodes", forces(cells=cells, slave="NODE")[0][2], nodes)
    expect("  faces, soft law", forces(cells=cells, law=soft)[0][2], 0.02487562)
    expect("  nodes, soft law", forces(cells=cells, law=soft, slave="NODE")[0][2], softer)
EOF
