#!/bin/bash
# Points x y z of a regular grid (.xyz) in another order than rows of constant y.
#
# Guess: a reader looks at x and y, or refuses another order.
# Instead: SurfaceTopography does so; surfalize takes z in the order of the lines, whatever x and y say: the
# map of points in columns is another one. Its sides are (n - 1)²/n steps, and x, y in metres.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import surfalize
import SurfaceTopography

heights = np.random.default_rng(3).permutation(20).reshape(4, 5)  # [row, column]
points = [(2 * i, 3 * j, heights[j, i]) for j in range(4) for i in range(5)]
print("SurfaceTopography", version("SurfaceTopography"), "surfalize", version("surfalize"))
for name, order in (("rows", points), ("columns", sorted(points))):
    open("map.xyz", "w").write("".join("%d %d %d\n" % point for point in order))
    topography, surface = SurfaceTopography.read_topography("map.xyz"), surfalize.Surface.load("map.xyz")
    found, taken = topography.heights().T, surface.data * 1e-6
    print(name, "first row", heights[0], found[0], taken[0])
    print("sides", topography.physical_sizes, 1e-6 * surface.width_um, 1e-6 * surface.height_um)
    np.testing.assert_allclose(found, heights)
    np.testing.assert_allclose(taken.ravel(), [z for *_, z in order])
    np.testing.assert_allclose((surface.width_um, surface.height_um), (6.4e6, 6.75e6))
END
