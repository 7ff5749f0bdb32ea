#!/usr/bin/env bash
# scikit-fem: named faces of tetrahedra where some elements are refined.
#
# Guess: a name stands for the same faces afterwards, or is dropped with a warning, as when all elements are refined.
# Seen: it keeps the numbers of the faces, which are now those of others: of eight faces on top none is left, seven of them lie
# within the body, and their area is 1.207 in place of 1. No warning. Name faces after the refinement.
set -euo pipefail
source "$(dirname "$0")/packages.sh" scikit-fem==12.0.2 scipy==1.17.1
python - <<'END'
import numpy as np
from skfem import ElementTetP1, FacetBasis, MeshTet

mesh = MeshTet.init_tensor(*(np.linspace(0, 1, 3),) * 3).with_boundaries({"top": lambda x: x[2] == 1})
some, every = mesh.refined([0, 1]), mesh.refined(1)
for name, one in (("before", mesh), ("two elements refined", some)):
    faces = one.boundaries["top"]
    on_top = (one.p[2][one.facets[:, faces]] == 1).all(axis=0).sum()
    within = len(faces) - np.isin(faces, one.boundary_facets()).sum()
    area = FacetBasis(one, ElementTetP1(), facets="top").dx.sum()
    print(f"{name}: of {len(faces)} faces {on_top} on top, {within} within the body, area {area:.4f}")
    assert (len(faces), on_top, within) == ((8, 8, 0) if one is mesh else (8, 0, 7))
    assert abs(area - (1 if one is mesh else 1.2071)) < 1e-4
print("all refined:", every.boundaries)
assert every.boundaries is None and len(some.facets_satisfying(lambda x: x[2] == 1)) == 8
END
