#!/usr/bin/env bash
# tetgen 0.8.4: tetrahedra of second order, as arrays that tetrahedralize returns, and as a grid.
#
# Guess: both have the same cells, and the arrays go into meshio's tetra10.
# Seen: the grid has VTK's order, the arrays TetGen's, whose nodes on edges stand elsewhere, five of six: from the arrays a cube has the
# volume 0 in VTK. First order is the same in both. Take the grid.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tetgen==0.8.4 meshio==5.3.5 pyvista==0.49.1 vtk==9.7.2
python - <<'END' 2>errors.log || { cat errors.log; exit 1; }
import meshio
import numpy as np
import pyvista
import tetgen

edges = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])
for order, kind in ((1, "tetra"), (2, "tetra10")):
    made = tetgen.TetGen(pyvista.Cube().triangulate().subdivide(1))
    points, cells = made.tetrahedralize(order=order)[:2]
    grid = made.grid
    own = grid.cells.reshape(len(cells), -1)[:, 1:]
    meshio.Mesh(points, [(kind, cells)]).write("cube.vtu")
    found = pyvista.read("cube.vtu").volume
    print(f"order {order}: volume of the grid {grid.volume:.6f}, of the arrays {found:.6f}")
    assert abs(grid.volume - 1) < 1e-9
    if order == 1:
        assert abs(found - 1) < 1e-9 and (own == cells).all()
    else:
        middles = [np.abs(points[c[:, 4:]] - points[c[:, edges]].mean(axis=2)).max(axis=(0, 2)) < 1e-9 for c in (own, cells)]
        print("nodes in the middle of their edges: grid", middles[0], "arrays", middles[1])
        assert middles[0].all() and middles[1].sum() == 1 and abs(found) < 1e-9
END
