#!/usr/bin/env bash
# Igor binary wave (.ibw) of Asylum Research: distance of points of a scan of 8 x 2 um with 8 x 2 points.
#
# Guess: 1 um in all readers.
# Seen: 1 um in SurfaceTopography and Gwyddion, 0.25 um in AFMReader: it divides the slow side by the number of points along
# the fast one. Square scans are right. The rows are the same in all three.
set -euo pipefail
source "$(dirname "$0")/packages.sh" AFMReader==0.0.7 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0 scipy==1.17.1
python - <<'EOF' 2>errors.log || { cat errors.log; exit 1; }
import struct

import gwyddionpy
import numpy as np
import SurfaceTopography
from AFMReader.ibw import load_ibw


def write(nx, ny):
    """Write heights of 1, 2, ... nm at points 1 um apart, in the fifth version of the format."""
    heights = np.arange(1.0, nx * ny + 1).reshape(ny, nx).T
    raw = (1e-9 * heights).astype("<f4").tobytes(order="F")
    note = f"ScanSize: {nx}e-6\rFastScanSize: {nx}e-6\rSlowScanSize: {ny}e-6\r".encode()
    labels = bytes(32) + b"HeightRetrace".ljust(32, b"\0")
    wave = bytearray(320)
    struct.pack_into("<ih", wave, 12, nx * ny, 2)
    struct.pack_into("<h", wave, 26, 1)
    wave[28:32] = b"wave"
    struct.pack_into("<4i4d", wave, 68, nx, ny, 1, 0, 1e-6, 1e-6, 1, 1)
    wave[148:149] = wave[152:153] = wave[156:157] = b"m"
    sizes = [5, 0, 320 + len(raw), 0, len(note), 0, 0, 0, 0, 0, 0, 0, len(labels), 0, 0, 0, 0]
    head = bytearray(struct.pack("<2h15i", *sizes))
    total = sum(struct.unpack("<192h", bytes(head + wave)))
    struct.pack_into("<h", head, 2, (32768 - total) % 65536 - 32768)
    with open("scan.ibw", "wb") as file:
        file.write(bytes(head + wave) + raw + note + labels)
    return heights.T[::-1]


for nx, ny, seen in ((8, 2, 0.25), (4, 4, 1.0)):
    rows = write(nx, ny)
    one = SurfaceTopography.read_topography("scan.ibw")
    (channel,) = gwyddionpy.load("scan.ibw").channels.values()
    image, step = load_ibw("scan.ibw", "HeightRetrace")
    steps = [1e6 * one.pixel_size[0], 1e6 * channel.xreal / nx, 1e-3 * step]
    print(f"{nx} x {ny} points: SurfaceTopography, Gwyddion, AFMReader [um]", np.round(steps, 6))
    assert np.allclose(steps, [1, 1, seen])
    assert np.allclose(image, rows) and np.allclose(1e9 * one.heights().T, rows) and np.allclose(1e9 * channel.data, rows)
EOF
