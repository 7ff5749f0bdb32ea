#!/usr/bin/env bash
# trimesh 5.2.0: a closed plate with a rough face of 100 nm by 100 nm, points 3 nm apart, given in nanometres and in metres.
#
# Guess: the mesh is closed in either unit, and its volume and area are those of the triangles given.
# Seen: points less than 1e-8 apart are one, whatever the size of the mesh. In metres 242 of 2178 points are left, the plate is open, without a word,
# with 0.94 of its volume. In nanometres, or with process=False, it is right. Give lengths in µm or nm.
set -euo pipefail
PYTHONPATH=$(cd "$(dirname "$0")" && pwd)
export PYTHONPATH
source "$(dirname "$0")/packages.sh" trimesh==5.2.0
python - <<'END'
import numpy as np
import trimesh
from plate import plate, volume

points, faces = plate(33)

for unit, process, right in ((1.0, True, True), (1e-9, False, True), (1e-9, True, False)):
    mesh = trimesh.Trimesh(points * unit, faces, process=process)
    share = mesh.volume / (volume(points, faces) * unit**3)
    print(f"unit {unit}, process={process}: {len(mesh.vertices)} points of {len(points)}, closed {mesh.is_watertight}, volume {share:.4f} of the true one")
    assert mesh.is_watertight == right and (len(mesh.vertices) == len(points)) == right
    assert (abs(share - 1) < 1e-9) == right
assert len(mesh.vertices) == 242 and 0.93 < share < 0.95
END
