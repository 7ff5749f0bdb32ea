#!/usr/bin/env bash
# MMG by mmgpy 0.17.1: a mesh with a named face within the body, such as a plane to cut free later, is made finer.
#
# Guess: faces keep their reference, within the body as on its border.
# Seen: part of a plane border keeps its own, with the right area. Of the face within, no triangle is left, without a message, unless
# opnbdy=True is asked for, or the bodies on both sides have references of their own.
set -euo pipefail
source "$(dirname "$0")/packages.sh" mmgpy==0.17.1
python - <<'END' 2>log || { cat log; exit 1; }
from itertools import permutations, product

import numpy as np
from mmgpy import MmgMesh3D

# a unit cube of 2 x 2 x 2 cubes of six tetrahedra
points = np.array(list(product((0, 0.5, 1), repeat=3)))
cells = []
for corner, order in product(product(range(2), repeat=3), permutations(range(3))):
    path = np.array(corner) + np.cumsum(np.vstack([np.zeros(3, int), np.eye(3, dtype=int)[list(order)]]), axis=0)
    cell = [9 * i + 3 * j + k for i, j, k in path]
    a, b, c, d = points[cell]
    cells.append(cell if np.dot(np.cross(b - a, c - a), d - a) > 0 else [cell[i] for i in (0, 1, 3, 2)])
cells = np.array(cells)
faces, count = np.unique(np.sort(cells[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3)), axis=0, return_counts=True)
centres = points[faces].mean(axis=1)
within = (count == 2) & np.isclose(points[faces][:, :, 2], 0.5).all(axis=1)
names = np.where(within, 9, np.where(np.isclose(centres[:, 2], 1) & (centres[:, 0] < 0.5), 7, 1))
kept = (count == 1) | within
halves = np.where(points[cells][:, :, 2].mean(axis=1) < 0.5, 1, 2)
for label, bodies, options, seen in (
    ("one body", np.ones(len(cells), int), {}, {1: 5.5, 7: 0.5}),
    ("one body, opnbdy", np.ones(len(cells), int), {"opnbdy": True}, {1: 5.5, 7: 0.5, 9: 1.0}),
    ("two bodies", halves, {}, {1: 5.5, 7: 0.5, 9: 1.0}),
):
    mesh = MmgMesh3D()
    mesh.set_mesh_size(vertices=len(points), tetrahedra=len(cells), triangles=int(kept.sum()))
    mesh.set_vertices(points)
    mesh.set_tetrahedra(cells, bodies)
    mesh.set_triangles(faces[kept], names[kept])
    mesh.remesh(hmax=0.3, verbose=-1, **options)
    corners = mesh.get_vertices()
    triangles, found = mesh.get_triangles_with_refs()
    a, b, c = corners[triangles].transpose(1, 0, 2)
    sizes = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    areas = {int(name): float(sizes[found == name].sum()) for name in np.unique(found)}
    print(f"{label}: areas by reference", {name: round(area, 6) for name, area in areas.items()}, "of 1: 5.5, 7: 0.5, 9: 1")
    assert areas.keys() == seen.keys() and np.allclose([areas[name] for name in seen], list(seen.values()))
END
