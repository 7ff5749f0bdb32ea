#!/usr/bin/env bash
# meshio 5.3.5: cells of a body in CGNS and FLAC3D files (.cgns, .f3grid), written without a warning.
#
# Guess: what it writes without a warning it reads back, other cells are refused.
# Seen: hexahedra, prisms and second order leave no cells in a .cgns file, which it cannot read; tetrahedra are kept. Second order in .f3grid comes
# back as first order with all its points, those in the middle of edges in no cell. Prisms come back with negative Jacobians, whichever they had.
set -euo pipefail
source "$(dirname "$0")/packages.sh" meshio==5.3.5 h5py==3.16.0
python - <<'END'
import contextlib
import io

import h5py
import meshio
import numpy as np

corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
brick = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
prism = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1.0]])
bodies = {
    "tetra": corners,
    "tetra10": np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]]),
    "hexahedron": brick,
    "wedge": prism,
}


def written(suffix, kind, points):
    """Write one cell, without a word; return the file's name."""
    name, said = f"{kind}.{suffix}", io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        meshio.Mesh(points, [(kind, [list(range(len(points)))])]).write(name)
    assert not said.getvalue().strip(), said.getvalue()
    return name


def volume(points):
    """Return the signed volume of a prism of first order."""
    return np.linalg.det(points[[1, 2, 3]] - points[0]) / 2


for kind, points in bodies.items():
    name = written("cgns", kind, points)
    with h5py.File(name) as file:
        ends = []
        file.visit(lambda path, ends=ends: ends.append(path) if "ElementConnectivity/" in path else None)
    try:
        back = len(meshio.read(name).cells[0].data)
    except KeyError:
        back = 0
    print(f".cgns, {kind}: {len(ends)} arrays of cells in the file, {back} cells read")
    assert (len(ends), back) == ((1, 1) if kind == "tetra" else (0, 0))
back = meshio.read(written("f3grid", "tetra10", bodies["tetra10"]))
print(f".f3grid, tetra10: {back.cells[0].type} and {len(back.points)} points read")
assert back.cells[0].type == "tetra" and len(back.points) == 10
for order in ([0, 1, 2, 3, 4, 5], [0, 2, 1, 3, 5, 4]):
    back = meshio.read(written("f3grid", "wedge", prism[order]))
    sign = volume(back.points[back.cells[0].data[0]])
    print(f".f3grid, a prism of volume {volume(prism[order]):+.2f}: {sign:+.2f} read")
    np.testing.assert_allclose(sign, -0.5)
END
