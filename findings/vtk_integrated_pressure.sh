#!/usr/bin/env bash
# VTK, and so ParaView's "Integrate Variables": the force of pressures at nodes of second-order faces, and of cells.
#
# Guess: the integral of the faces' own shape functions; pressures of cells made into pressures of nodes keep the force.
# Seen: faces are cut into triangles and squares between their nodes, with straight lines between: of p = x^2 a unit face
# of 8 or 9 nodes bears 0.375 in place of 1/3, a triangle of 6 nodes 25 % too much. With cells of different sizes Cell
# Data to Point Data changes the force, here by 14 %: means at nodes take no notice of areas. Integrate the cells' data.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pyvista==0.49.1 vtk==9.7.2
python - <<'END'
import numpy as np
import pyvista

corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
sides = [(0.5, 0), (1, 0.5), (0.5, 1), (0, 0.5)]
triangle = [(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)]
kinds = pyvista.CellType
for kind, nodes, seen, exact in (
    (kinds.QUADRATIC_QUAD, corners + sides, 3 / 8, 1 / 3),
    (kinds.BIQUADRATIC_QUAD, [*corners, *sides, (0.5, 0.5)], 3 / 8, 1 / 3),
    (kinds.LAGRANGE_QUADRILATERAL, [*corners, *sides, (0.5, 0.5)], 3 / 8, 1 / 3),
    (kinds.QUADRATIC_TRIANGLE, triangle, 5 / 48, 1 / 12),
    (kinds.LAGRANGE_TRIANGLE, triangle, 5 / 48, 1 / 12),
):
    face = pyvista.UnstructuredGrid([len(nodes), *range(len(nodes))], [kind], [(x, y, 0.0) for x, y in nodes])
    face["pressure"] = face.points[:, 0] ** 2
    force = face.integrate_data()["pressure"][0]
    print(kind.name, "force", force, "by its shape functions", exact)
    assert abs(force - seen) < 1e-12

x = np.array([0.0, 0.1, 0.2, 0.4, 1.0])
grid = pyvista.StructuredGrid(*np.meshgrid(x, x), np.zeros((5, 5)))
grid.cell_data["pressure"] = np.random.default_rng(0).random(16)
cells = grid.integrate_data()["pressure"][0]
nodes = grid.cell_data_to_point_data().integrate_data()["pressure"][0]
print("force of cells", cells, "of nodes made from them", nodes)
assert abs(cells - grid.cell_data["pressure"] @ grid.compute_cell_sizes()["Area"]) < 1e-12
assert abs(nodes / cells - 1.1437) < 1e-3
END
