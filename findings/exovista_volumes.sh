#!/usr/bin/env bash
# exovista: volumes of cells and areas of facets in Exodus files.
#
# Guess: those of geometry, wherever the body lies.
# Seen: tetrahedra and hexahedra are right. Half a unit cube as a prism has -3 in place of 0.5, six times as much with the other sign. The
# area of a triangle is that of the one with its first two nodes and the origin: 0.5 grows to 1.5 when the triangle is shifted
# by 1 along both axes. No warning. Volume averages and masses at nodes are made of these. VTK reads the same file rightly.
set -euo pipefail
source "$(dirname "$0")/packages.sh" exovista==1.3.0 pyvista==0.49.1 vtk==9.7.2 netCDF4==1.7.4 h5py==3.16.0
python - 2>log <<'END' || { cat log; exit 1; }
import exovista
import numpy as np
import pyvista
from exovista.element import factory

square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
half = square[[0, 1, 3]]
for name, kind, base, top, seen in (
    ("hexahedron", pyvista.CellType.HEXAHEDRON, square, square, 1.0),
    ("tetrahedron", pyvista.CellType.TETRA, half, square[:1], 1 / 6),
    ("prism", pyvista.CellType.WEDGE, half, half, -3.0),
):
    points = np.vstack([base, top + [0, 0, 1]])
    grid = pyvista.UnstructuredGrid(np.array([len(points), *range(len(points))]), [kind], points)
    grid.cell_data["region"] = [1]
    exovista.write_exo("one.exo", grid)
    found = exovista.compute_element_volumes(exovista.File("one.exo"), 1)[0]
    vtk = pyvista.read("one.exo").combine().compute_cell_sizes()["Volume"][0]
    print(f"{name}: {found:.6f}, to VTK {vtk:.6f}")
    assert abs(found - seen) < 1e-6 and abs(vtk - grid.compute_cell_sizes()["Volume"][0]) < 1e-6
for shift, seen in ((0, 0.5), (1, 1.5)):
    area = factory("TRI3", np.array([(1.0, 0), (0, 1), (0, 0)]) + shift).volume
    print(f"triangle shifted by {shift}: {area}")
    assert abs(area - seen) < 1e-9
END
