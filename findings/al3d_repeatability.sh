#!/usr/bin/env bash
# Alicona (.al3d): heights that the file itself calls not repeatable.
#
# Guess: readers give the same heights and miss the same ones.
# Seen: a file may hold a map of repeatability and the limit that its own program applies by default. surfalize leaves out
# heights beyond it; SurfaceTopography and Gwyddion return them as measured, spikes beside steep flanks among them.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0
python - <<'END'
import gwyddionpy
import numpy as np
import surfalize
import SurfaceTopography

ny, nx = 3, 8
heights = 1e-6 * np.arange(24, dtype="<f4").reshape(ny, nx)  # m
heights[1, 2] = 9e-4  # a spike
repeatability = np.full((ny, nx), 50, np.uint8)
repeatability[1, 2] = 250  # × 1 nm, above the limit of 200 nm
tags = {"PixelSizeXMeter": 1e-6, "PixelSizeYMeter": 1e-6, "Cols": nx, "Rows": ny, "NumberOfPlanes": 1, "IconOffset": 0}
tags |= {"InvalidPixelValue": "3e15", "DepthImageResPtr": 1, "DepthResFilterVal": 2e-7, "DepthResShiftVal": 1e-9}
start = 17 + 52 * (2 + len(tags) + 2) + 256
tags |= {"DepthImageOffset": start, "TextureImageOffset": start + 4 * nx * ny}


def tag(key, value):
    return key.encode().ljust(20, b"\0") + str(value).encode().ljust(30, b"\0") + b"\r\n"


head = b"AliconaImaging\0\r\n" + tag("Version", 1) + tag("TagCount", len(tags))
head += b"".join(tag(key, value) for key, value in tags.items()) + bytes(254) + b"\r\n"
assert len(head) == start
grey = bytes(nx * ny)
open("map.al3d", "wb").write(head + heights.tobytes() + grey + repeatability.tobytes())
channels = gwyddionpy.load("map.al3d").channels
topography = SurfaceTopography.read_topography("map.al3d").to_unit("µm")
filtered = surfalize.Surface.load("map.al3d")
print("Gwyddion [µm]", (1e6 * next(iter(channels.values())).data[1]).round(2).tolist(), len(channels), "channels")
print("SurfaceTopography [µm]", np.asarray(topography.heights().T[1]).round(2).tolist())
print("surfalize [µm]", filtered.data[1].round(2).tolist())
np.testing.assert_allclose(next(iter(channels.values())).data, heights, rtol=1e-6)
np.testing.assert_allclose(topography.heights().T.astype(float), 1e6 * heights, rtol=1e-6)
assert np.ma.count_masked(topography.heights()) == 0 and np.argwhere(np.isnan(filtered.data)).tolist() == [[1, 2]]
END
