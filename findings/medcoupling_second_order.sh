#!/usr/bin/env bash
# MEDCoupling, of Salome and Code_Aster: areas, volumes and integrals on cells of second order.
#
# Guess: measures of curved cells, and integrals of what stands at their nodes, by the cells' own functions, or by arcs throughout.
# Seen: in a plane sides are circular arcs, and exact; the same face among three coordinates is measured by its corners alone, as volumes
# are: a quarter ring has 1.5 in place of 2.33 (2.36 with arcs), a quarter of a cylinder's side 1.41 in place of 1.57. Integrals of fields
# at nodes give every node a share that only fields linear in space allow: of x^2 a face of 8 nodes has 7/16 in place of 1/3, a triangle of
# 6 nodes 50 % too much, a tetrahedron of 10 nodes 75 %. No warning.
set -euo pipefail
source "$(dirname "$0")/packages.sh" medcoupling==9.15.0
python - <<'END'
import medcoupling
import numpy as np


def cell(kind, nodes):
    """Return a mesh of one cell."""
    nodes = np.array(nodes, float)
    mesh = medcoupling.MEDCouplingUMesh("cell", medcoupling.MEDCouplingUMesh.GetDimensionOfGeometricType(kind))
    mesh.setCoords(medcoupling.DataArrayDouble(np.ascontiguousarray(nodes)))
    mesh.allocateCells(1)
    mesh.insertNextCell(kind, list(range(len(nodes))))
    mesh.finishInsertingCells()
    return mesh


def between(corners, pairs):
    """Return corners and the middles of their edges."""
    corners = np.array(corners, float)
    return np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in pairs]])


def at(radius, turns, z=0.0):
    return [radius * np.cos(turns * np.pi / 2), radius * np.sin(turns * np.pi / 2), z]


low, middles = [at(1, 0), at(1, 1), at(2, 1), at(2, 0)], [at(1, 0.5), at(1.5, 1), at(2, 0.5), at(1.5, 0)]
side = [at(1, 0), at(1, 1), at(1, 1, 1), at(1, 0, 1), at(1, 0.5), at(1, 1, 0.5), at(1, 0.5, 1), at(1, 0, 0.5)]
lifted = [[[x, y, z] for x, y, _ in part] for z in (1, 0.5) for part in (low, middles)]
block = [*low, *lifted[0], *middles, *lifted[1], *lifted[2]]
face, body = medcoupling.NORM_QUAD8, medcoupling.NORM_HEXA20
for name, kind, nodes, seen in (
    ("quarter ring in a plane", face, np.array(low + middles)[:, :2], 0.75 * np.pi),
    ("quarter ring in space", face, low + middles, 1.5),
    ("quarter of a tube", body, block, 1.5),
    ("quarter of a cylinder's side", face, side, 2**0.5),
):
    found = cell(kind, nodes).getMeasureField(True).getArray()[0]
    print(f"{name}: {found:.4f}")
    np.testing.assert_allclose(abs(found), seen, rtol=1e-6)

square, ring = [(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 1), (1, 2), (2, 3), (3, 0)]
triangle, corner = [(0, 0), (1, 0), (0, 1)], [(0, 0, 0), (0, 1, 0), (1, 0, 0), (0, 0, 1)]
for name, kind, nodes, seen, exact, linear in (
    ("8 nodes", face, between(square, ring), 7 / 16, 1 / 3, 1 / 2),
    ("6 nodes", medcoupling.NORM_TRI6, between(triangle, [(0, 1), (1, 2), (2, 0)]), 1 / 8, 1 / 12, 1 / 6),
    ("10 nodes", medcoupling.NORM_TETRA10, between(corner, [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]), 7 / 240, 1 / 60, 1 / 24),
):
    integrals = []
    for power in (1, 2):
        field = medcoupling.MEDCouplingFieldDouble(medcoupling.ON_NODES, medcoupling.ONE_TIME)
        field.setMesh(cell(kind, nodes))
        field.setArray(medcoupling.DataArrayDouble(np.ascontiguousarray(nodes[:, 0] ** power)))
        integrals.append(field.integral(0, True))
    print(f"{name}: integral of x {integrals[0]:.6f}, of x^2 {integrals[1]:.6f} in place of {exact:.6f}")
    np.testing.assert_allclose(integrals, [linear, seen], rtol=1e-9)
END
