#!/usr/bin/env bash
# WSxM (.top): the amplitude of heights.
#
# Guess: heights that range over 2.75 µm do so to SurfaceTopography, Gwyddion and AFMReader (TopoStats), in the same order.
# Seen: AFMReader reads "2.75 µm" as 2 nm: what stands behind the point is cut off, and so is the unit. It also begins with
# the file's first point, where the other two turn the image by half a turn, as WSxM draws it.
set -euo pipefail
source "$(dirname "$0")/packages.sh" AFMReader==0.0.7 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0
python - 2>log <<'END' || { cat log; exit 1; }
import gwyddionpy
import numpy as np
import SurfaceTopography
from AFMReader.top import load_top

n = 4
numbers = (100 * np.arange(n * n, dtype="<i2")).reshape(n, n)
rows = ["WSxM file copyright UAM", "SxM Image file", "Image header size: 0000", "", "[Control]", ""]
rows += ["    X Amplitude: 8 µm", "    Y Amplitude: 8 µm", "", "[General Info]", "", "    Image Data Type: short"]
rows += [f"    Number of columns: {n}", f"    Number of rows: {n}", "    Z Amplitude: 2.75 µm", "", "[Miscellaneous]", ""]
rows += ["    Maximum: 1500", "    Minimum: 0", "", "[Header end]", ""]
head = "\r\n".join(rows).encode("latin-1")
open("map.top", "wb").write(head.replace(b"0000", f"{len(head):04d}".encode()) + numbers.tobytes())
heights = 2750.0 * numbers / 1500  # nm
topography = SurfaceTopography.read_topography("map.top").to_unit("nm")
channel = next(iter(gwyddionpy.load("map.top").channels.values()))
image, step = load_top("map.top")
print("SurfaceTopography [nm]", np.asarray(topography.heights().T)[0].round(3).tolist(), topography.physical_sizes)
print("Gwyddion [nm]", (1e9 * (channel.data - channel.data.min()))[0].round(3).tolist(), channel.xreal)
print("AFMReader [nm]", image[0].round(3).tolist(), "step", step)
np.testing.assert_allclose(topography.heights().T, heights[::-1, ::-1], rtol=1e-6)
np.testing.assert_allclose(1e9 * (channel.data - channel.data.min()), heights[::-1, ::-1], rtol=1e-6, atol=1e-6)
np.testing.assert_allclose(image, heights / 2750 * 2)
assert step == 2000
END
