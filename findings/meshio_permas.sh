#!/usr/bin/env bash
# meshio 5.3.5 and its descendants meshlane 5.5.0 and meshioplusplus 17.21.0: meshes of second order in PERMAS files (.dato, .post).
#
# Guess: what one of them writes it reads back with the same nodes of each cell, as other formats do.
# Seen: tetrahedra of 10 nodes come back in another order: their volume by shape functions is 0.19 of the true one, values of fields stand at the
# right points. Hexahedra of 20 nodes and tetrahedra of 4 are the same. All three do this. No warning.
set -euo pipefail
source "$(dirname "$0")/packages.sh" meshio==5.3.5 meshlane==5.5.0 meshioplusplus==17.21.0
python - <<'END'
import numpy as np
import meshio
import meshioplusplus
import meshlane

corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
nodes = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])


def written(module, suffix, kind, points):
    """Return the order in which the nodes of one cell come back."""
    name = f"{module.__name__}_{kind}.{suffix}"
    module.Mesh(points, [(kind, [list(range(len(points)))])]).write(name)
    back = module.read(name)
    np.testing.assert_allclose(back.points, points)
    order = np.asarray(back.cells[0].data)[0]
    assert back.cells[0].type == kind and sorted(order) == list(range(len(points)))
    return list(map(int, order))


def volume(points):
    """Integrate the Jacobian of a tetrahedron of 10 nodes, of third degree, by Gauss's points on a cube folded into it."""
    x, w = np.polynomial.legendre.leggauss(4)
    x, w, total = (x + 1) / 2, w / 2, 0.0
    for a, b, c in np.ndindex(4, 4, 4):
        share = np.array([0.0, x[a], x[b] * (1 - x[a]), x[c] * (1 - x[a]) * (1 - x[b])])
        share[0] = 1 - share.sum()
        rise = np.vstack([-np.ones(3), np.eye(3)])
        shapes = [(4 * share[i] - 1) * rise[i] for i in range(4)]
        shapes += [4 * (share[i] * rise[j] + share[j] * rise[i]) for i, j in edges]
        total += w[a] * w[b] * w[c] * (1 - x[a]) ** 2 * (1 - x[b]) * np.linalg.det(points.T @ np.array(shapes))
    return total


brick = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
around = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
brick = np.vstack([brick, [(brick[a] + brick[b]) / 2 for a, b in around]])
np.testing.assert_allclose(volume(nodes), 1 / 6)
for module, suffixes in ((meshio, ["dato", "post"]), (meshlane, ["dato", "post"]), (meshioplusplus, ["dato", "post"])):
    for suffix in suffixes:
        order = written(module, suffix, "tetra10", nodes)
        print(f"{module.__name__} {module.__version__}, .{suffix}: nodes come back as {order}, volume {6 * volume(nodes[order]):.4f} of the true one")
        assert order == [0, 4, 1, 5, 2, 6, 7, 8, 9, 3]
        np.testing.assert_allclose(6 * volume(nodes[order]), 23 / 120, atol=1e-9)
        assert written(module, suffix, "tetra", corners) == list(range(4))
        assert written(module, suffix, "hexahedron20", brick) == list(range(20))
END
