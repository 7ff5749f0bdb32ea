#!/usr/bin/env bash
# pylife 2.3.1: surface_3D.is_at_surface_with_normals of a mesh of hexahedra, "the outward normals" by its documentation.
#
# Guess: a node within a face of a box has that face's normal, outward.
# Seen: of 96 rows of such nodes of 3 × 3 × 3 cubes 24 have it; 23 have the opposite one, 27 one along the face, 22 a slanting one. Which nodes lie
# at the surface is right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pylife==2.3.1
python - <<'END'
import itertools

import numpy as np
import pandas as pd
import pylife.mesh  # noqa: F401, which gives tables surface_3D

around = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
rows = [
    (element, int(np.ravel_multi_index(np.add(cell, one), (4, 4, 4))) + 1, *map(float, np.add(cell, one)))
    for element, cell in enumerate(itertools.product(range(3), repeat=3), 1)
    for one in around
]
mesh = pd.DataFrame(rows, columns=["element_id", "node_id", "x", "y", "z"]).set_index(["element_id", "node_id"])
found = mesh.surface_3D.is_at_surface_with_normals().join(mesh)
places = found[["x", "y", "z"]].to_numpy() - 1.5
outer = np.isclose(np.abs(places), 1.5)
assert np.array_equal(found["is_at_surface"].to_numpy(bool), outer.any(axis=1))
within = outer.sum(axis=1) == 1
normals = found[["normal_x", "normal_y", "normal_z"]].to_numpy()[within]
along = (normals * np.sign(places[within]) * outer[within]).sum(axis=1)
counts = [int(np.isclose(along, one).sum()) for one in (1, -1, 0)]
print(f"rows of nodes within one face: {len(along)}; outward {counts[0]}, inward {counts[1]}, along the face {counts[2]}, slanting {len(along) - sum(counts)}")
assert (len(along), *counts) == (96, 24, 23, 27)
END
