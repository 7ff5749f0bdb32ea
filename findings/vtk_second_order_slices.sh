#!/usr/bin/env bash
# VTK, and so ParaView: slices, clips and contours of cells of second order; here one of 20 nodes, 1 mm high, with the field z^2.
#
# Guess: a slice shows what a probe shows at the same point, and a contour passes where the field has its value.
# Seen: only probes and gradients use the cell's own functions. Slices, clips and contours go in straight lines from node to node, without
# a word: a slice at z = 0.1 shows 0.05 in place of 0.01, the contour of 0.1 lies at 0.2 in place of 0.316, and a clip leaves cells of
# first order. Where contact ends, or a stress is largest, they are off by a part of a cell; probe instead, or refine.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pyvista==0.49.1 vtk==9.7.2
python - <<'END'
import numpy as np
import pyvista

ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
edges = [(0, 1), (1, 2), (2, 3), (3, 0)]
corners = np.array([(*at, z) for z in (0, 1) for at in ring], float)
pairs = edges + [(a + 4, b + 4) for a, b in edges] + [(a, a + 4) for a in range(4)]
nodes = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in pairs]])
cell = pyvista.UnstructuredGrid(np.array([20, *range(20)]), [pyvista.CellType.QUADRATIC_HEXAHEDRON], nodes)
cell["field"] = nodes[:, 2] ** 2
for z, seen in ((0.1, 0.05), (0.3, 0.15), (0.6, 0.4)):
    probe = pyvista.PolyData([(0.4, 0.4, z)]).sample(cell)["field"][0]
    slice_ = cell.slice(normal="z", origin=(0, 0, z))["field"]
    below = cell.clip("z", origin=(0, 0, z))
    print(f"at z = {z}: probe {probe:.4f}, slice {slice_.min():.4f} to {slice_.max():.4f}, clip {below['field'].max():.4f}")
    np.testing.assert_allclose(probe, z**2, atol=5e-4)
    np.testing.assert_allclose([slice_.min(), slice_.max(), below["field"].max()], seen, atol=1e-6)
    assert set(below.celltypes) == {pyvista.CellType.HEXAHEDRON}
for value, seen in ((0.1, 0.2), (0.3, 8 / 15), (0.6, 11 / 15)):
    found = cell.contour([value], scalars="field").points[:, 2]
    print(f"contour of {value}: at z = {found.min():.4f} to {found.max():.4f}, in place of {value**0.5:.4f}")
    np.testing.assert_allclose([found.min(), found.max()], seen, atol=1e-6)
slope = cell.compute_derivative("field")["gradient"][:, 2]
np.testing.assert_allclose(slope, 2 * nodes[:, 2], atol=1e-6)
END
