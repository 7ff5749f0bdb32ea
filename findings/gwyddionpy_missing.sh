#!/usr/bin/env bash
# Missing heights, read by Gwyddion through gwyddionpy.
#
# Guess: missing heights are nan, or masked.
# Seen: they are heights like all others, which Gwyddion fills in from their neighbours. Its mask, which says where,
# is in the .gwy file that its converter writes, but not in what gwyddionpy returns. SurfaceTopography has them
# masked.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0 SurfaceTopography==1.27.1
python - <<'END'
import gwyddionpy
import numpy as np
import SurfaceTopography

head = ["fileformat = bcrstm", "headersize = 2048", "xpixels = 4", "ypixels = 3", "xlength = 8000", "ylength = 6000"]
head += ["xunit = nm", "yunit = nm", "zunit = nm", "intelmode = 1", "bit2nm = 1", "voidpixels = 1"]
numbers = np.array([[0, 32767, 8, 12], [1, 5, 9, 13], [2, 6, 10, 14]], "<i2")  # BCR-STM: 32767 is missing
open("map.bcr", "wb").write("\n".join([*head, ""]).encode().ljust(2048, b"\0") + numbers.tobytes())
masked = SurfaceTopography.read_topography("map.bcr").heights().T
channel = next(iter(gwyddionpy.load("map.bcr").channels.values()))
print("SurfaceTopography [nm]", masked[0].tolist())
print("gwyddionpy [nm]", (1e9 * channel.data[0]).round(3).tolist(), sorted(vars(channel)))
assert np.ma.count_masked(masked) == 1 and masked.mask[0, 1]
assert np.isfinite(channel.data).all() and 0 < channel.data[0, 1] < 9e-9
assert not any("mask" in name for name in vars(channel))
np.testing.assert_allclose(1e9 * channel.data[~masked.mask], masked.compressed(), rtol=1e-6)
END
