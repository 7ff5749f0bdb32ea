#!/usr/bin/env bash
# Wyko / Veeco (.opd): missing heights among heights in single precision.
#
# Guess: three readers miss the same points: those of 1e38 and beyond, which no height can be.
# Seen: SurfaceTopography does so. 1e38 in single precision is a little less than 1e38: Gwyddion takes it for a height of 5e31 m.
# surfalize misses this number alone, and takes 2e38 for 1e38 µm. One point of either makes every mean and rms height
# useless. Of whole numbers all three miss 32767.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0
python - <<'END'
import struct

import gwyddionpy
import numpy as np
import surfalize
import SurfaceTopography


def missing(numbers):
    """Return which readers miss the point of the second column, second line, and the largest height of each [µm]."""
    nx, ny = numbers.shape
    blocks = [(b"RAW_DATA", 3, struct.pack("<3H", nx, ny, numbers.itemsize) + numbers.tobytes())]
    for name, kind, code, value in ((b"Wavelength", 7, "f", 500), (b"Mult", 6, "h", 1), (b"Aspect", 7, "f", 1), (b"Pixel_size", 7, "f", 1e-3)):
        blocks.append((name, kind, struct.pack("<" + code, value)))
    table = [struct.pack("<16shlH", b"Directory", 1, 24 * (len(blocks) + 1), 0xFFFF)]
    table += [struct.pack("<16shlH", name, kind, len(block), 0) for name, kind, block in blocks]
    with open("map.opd", "wb") as file:  # sides in mm, heights in wavelengths of 500 nm
        file.write(b"\x01\x00" + b"".join(table) + b"".join(block for _, _, block in blocks))
    gwyddion = next(iter(gwyddionpy.load("map.opd").channels.values())).data
    one = SurfaceTopography.read_topography("map.opd").heights()
    other = surfalize.Surface.load("map.opd").data
    return 1e3 * np.ma.max(one), 1e6 * gwyddion.max(), np.nanmax(other)


numbers = np.arange(12.0).reshape(4, 3)
for mark, kind, seen in (
    (32767, "<i2", (5.5, 5.5, 5.5)),
    (1e38, "<f4", (5.5, 5e37 * 0.9999999684, 5.5)),
    (2e38, "<f4", (5.5, 5.5, 1e38 * 0.9999999684)),
):
    numbers[1, 1] = mark
    found = missing(numbers.astype(kind))
    print(f"{mark:g}: largest height of SurfaceTopography {found[0]:.4g}, Gwyddion {found[1]:.4g}, surfalize {found[2]:.4g} µm")
    np.testing.assert_allclose(np.array(found, float), seen, rtol=1e-6)
END
