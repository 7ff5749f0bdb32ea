#!/bin/bash
# NanoFocus (.nms): the unit of the distances of points in the header, and the level of heights.
#
# Guess: two readers agree on both.
# Instead: SurfaceTopography takes distances for mm and counts heights from the lowest, surfalize takes
# distances for nm and adds the highest: a map of 8 µm is one of 8 m, the heights differ by their range.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2
cd "$folder"
venv/bin/python - <<'END'
import struct
from importlib.metadata import version

import numpy as np
import surfalize
import SurfaceTopography

head = bytearray(3468)
head[:8] = b"\1\2nms\0\0\0"
struct.pack_into("<2d", head, 16, -1.0, 2.0)  # lowest and highest height [µm]
head[1076:1092] = b"01.02.2026 03:04"
struct.pack_into("<2I2d", head, 1368, 4, 3, 2000.0, 2000.0)  # points, and their distances
numbers = np.linspace(0, 65534, 12).astype("<u2")
open("map.nms", "wb").write(bytes(head) + numbers.tobytes() + bytes(12))
topography, surface = SurfaceTopography.read_topography("map.nms"), surfalize.Surface.load("map.nms")
print("SurfaceTopography", version("SurfaceTopography"), topography.physical_sizes, topography.unit)
print("surfalize", version("surfalize"), "step", surface.step_x, "µm")
assert topography.unit == "µm" and np.allclose(topography.physical_sizes, (8e6, 6e6))
assert np.isclose(surface.step_x, 2.0)
low, high = topography.heights()[0, 0], surface.data[0, 0]
print("first height of a map from -1 to 2 µm:", low, high)
assert np.isclose(low, -1.0) and np.isclose(high, 2.0)
END
