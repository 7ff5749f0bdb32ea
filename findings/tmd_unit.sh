#!/usr/bin/env bash
# TrueMap (.tmd): the unit of sides and heights.
#
# Guess: a map of 8 × 9 µm that surfalize writes is 8 × 9 µm to other readers.
# Seen: it is one of 8 × 9 mm with heights of millimetres to SurfaceTopography and Gwyddion: the format counts in
# mm. surfalize writes and reads it in µm, so that files of instruments are a thousand times too small there.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0
python - <<'END'
import gwyddionpy
import numpy as np
import surfalize
import SurfaceTopography

heights = 0.1 * np.arange(12.0).reshape(3, 4)  # µm
surfalize.Surface(heights, 2.0, 3.0).save("map.tmd")
back = surfalize.Surface.load("map.tmd")
topography = SurfaceTopography.read_topography("map.tmd")
channel = next(iter(gwyddionpy.load("map.tmd").channels.values()))
print("surfalize", back.step_x, "µm a step, highest", back.data.max(), "µm")
print("SurfaceTopography", topography.physical_sizes, topography.heights().max(), topography.unit)
print("Gwyddion", channel.xreal, channel.yreal, channel.data.max(), channel.si_unit_xy)
assert back.step_x == 2.0 and np.isclose(back.data.max(), 1.1)
assert topography.unit == "mm" and np.allclose(topography.physical_sizes, (8.0, 9.0))
assert np.isclose(topography.heights().max(), 1.1)
assert np.allclose((channel.xreal, channel.yreal, channel.data.max()), (8e-3, 9e-3, 1.1e-3))
END
