#!/usr/bin/env bash
# meshio: hexahedra of 20 nodes in Exodus files (.exo, .e), as for MOOSE and Cubit.
#
# Guess: VTK, whose reader ParaView has, reads the cube that meshio wrote: midside nodes in the middle of their edges, volume 1.
# Seen: Exodus numbers the upright edges before the upper ones, meshio after them, as in .vtk: eight midside nodes belong to other edges
# and the cube's volume is 0.083 to VTK. meshio itself reads its file without seeing it; tetrahedra of 10 nodes are right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" meshio==5.3.5 netCDF4==1.7.4 pyvista==0.49.1 vtk==9.7.2
python - <<'END'
import meshio
import numpy as np
import pyvista

ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
cube = np.array([(x, y, z) for z in (0, 1) for x, y in ring], float)
around = [(0, 1), (1, 2), (2, 3), (3, 0)]
cube_edges = around + [(a + 4, b + 4) for a, b in around] + [(n, n + 4) for n in range(4)]
shapes = {
    "hexahedron20": (cube, cube_edges, 8),
    "tetra10": (cube[[0, 1, 3, 4]], [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)], 0),
}
for kind, (corners, edges, wrong) in shapes.items():
    points = np.vstack([corners, corners[np.array(edges)].mean(axis=1)])
    meshio.Mesh(points, [(kind, [list(range(len(points)))])]).write("one.exo")
    again = meshio.read("one.exo")
    assert np.allclose(again.points[again.cells[0].data[0]], points)
    grid = pyvista.read("one.exo").combine()
    off = [edge.points[2] - edge.points[:2].mean(axis=0) for edge in grid.get_cell(0).edges]
    away, volume = sum(np.abs(one).max() > 0.1 for one in off), grid.compute_cell_sizes()["Volume"][0]
    print(f"{kind}: {away} midside nodes off their edge, volume {volume:.6f} to VTK")
    assert away == wrong and abs(volume - (1 / 12 if wrong else 1 / 6)) < 1e-6
END
