#!/usr/bin/env bash
# Sensofar (.plu): where the heights begin.
#
# Guess: SurfaceTopography, Gwyddion and surfalize read the same heights from one file.
# Seen: surfalize takes the two numbers of rows and columns that precede every layer for its first two heights (zero),
# so that each height stands two points too far along x and the last two of the map are lost.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0
python - <<'END'
import struct

import gwyddionpy
import numpy as np
import surfalize
import SurfaceTopography

ny, nx = 3, 4
heights = 1.0 + np.arange(12, dtype="<f4").reshape(ny, nx)  # µm
parts = [b"Mon Mar 02 10:00:00 2026".ljust(128, b"\0"), struct.pack("<I", 1772445600), bytes(256)]  # date, time, comment
parts += [struct.pack("<3I7f", ny, nx, 0, 1, 2, 3, 0, 0, 1, 0)]  # calibration: steps of 2 and 3 µm
parts += [struct.pack("<5I", 3, 0, 0, 0, 0), struct.pack("<5Id", nx, ny, nx, ny, 0, 0.1)]  # a topography
parts += [struct.pack("<f2I", 1, 1, 0), struct.pack("<8BI", 0, 1, 0, 0, 0, 0, 0, 0, 0)]  # one layer
parts += [struct.pack("<2I", ny, nx), heights.tobytes(), struct.pack("<2f", heights.min(), heights.max())]
open("map.plu", "wb").write(b"".join(parts))
channel = next(iter(gwyddionpy.load("map.plu").channels.values()))
topography = SurfaceTopography.read_topography("map.plu")
shifted = surfalize.Surface.load("map.plu")
print("Gwyddion", (1e6 * channel.data).round(3).tolist())
print("SurfaceTopography", np.asarray(topography.heights().T).tolist())
print("surfalize", shifted.data.round(3).tolist())
np.testing.assert_allclose(1e6 * channel.data, heights)
np.testing.assert_allclose(topography.heights().T.astype(float), heights)
assert (shifted.step_x, shifted.step_y) == (2, 3) and np.abs(shifted.data.ravel()[:2]).max() < 1e-40
np.testing.assert_allclose(shifted.data.ravel()[2:], heights.ravel()[:-2])
END
