#!/usr/bin/env bash
# slippy: developed area (sdr) and density of summits (sds) of a map.
#
# Guess: sdr of a plane is 0, sds is per unit area.
# Seen: sdr divides the area of (n - 1)^2 cells by that of n^2: a plane of 20 x 20 points has -10.8 %, one of 100 x 100
# points -2 %, and waves whose area is 2.4 % more have 0.38 %. sds is summits per point: the same waves have a quarter
# of it at half the spacing. Divide it by the area of a point.
set -euo pipefail
ALONE=slippy==0.5.2 # with the last packages that it runs with
source "$(dirname "$0")/packages.sh" numpy==1.26.4 scipy==1.11.4 matplotlib==3.8.4 numba==0.61.2 tinydb==4.8.2
python - <<'END' 2>warnings.log
import numpy as np
import slippy
from slippy.surface import Surface

print("slippy", slippy.__version__)
for n in (20, 100):
    area = Surface(profile=np.zeros((n, n)), grid_spacing=0.01).roughness("sdr", no_flattening=True)
    print("plane of", n, "x", n, "points: sdr", area)
    assert abs(area - (1 - n**2 / (n - 1) ** 2)) < 1e-6
wave, found = 2 * np.pi / 0.2, {}
for n in (100, 200):
    x = np.arange(n) / n
    heights = 0.01 * np.cos(wave * x)[:, None] * np.cos(wave * x)
    surface = Surface(profile=heights, grid_spacing=1 / n)
    found[n] = [surface.roughness(name, no_flattening=True) for name in ("sdr", "sds")]
    print(n, "x", n, "points on 1 x 1: sdr", found[n][0], "true 0.0242, sds", found[n][1], "summits inside the border 41")
assert abs(found[100][0] - 0.0038) < 1e-4 and abs(found[200][0] - 0.0145) < 1e-3
assert found[100][1] == 41 / 100**2 and found[200][1] == 41 / 200**2
END
