#!/usr/bin/env bash
# Zygo MetroPro (.dat): the resolution of phases, and the sign of heights, in the header.
#
# Guess: four readers of one format have the same heights.
# Seen: a phase resolution of 1, "high", makes 32768 counts a fringe in SurfaceTopography, prysm and Gwyddion, and 4096 in
# surfalize: heights 8 times too high. Of 2 it makes 4 times as much of them; 0 it refuses (KeyError). Where the header
# says that the sign is reversed, SurfaceTopography and Gwyddion turn heights over, surfalize and prysm do not.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 prysm==0.19.1 gwyddionpy==0.1.0 \
    gwyddionpy-converter==0.1.0 scipy==1.17.1
python - <<'END'
import struct

import gwyddionpy
import numpy as np
import surfalize
import SurfaceTopography
from prysm.io import read_zygo_dat

counts = np.array([[32768, 65536, -4096], [0, 16384, 8192]])


def write(resolution, sign):
    """Write counts of phase: interferometric scale 1/2, wavelength 600 nm, points 2 um apart."""
    header = bytearray(834)
    struct.pack_into(">IHI", header, 0, 0x881B0370, 2, 834)
    struct.pack_into(">4HIi", header, 64, 0, 0, 3, 2, 4 * counts.size, 1_000_000_000)
    struct.pack_into(">2f4xf4xf", header, 164, 0.5, 600e-9, 1.0, 2e-6)
    struct.pack_into(">h", header, 218, resolution)
    struct.pack_into(">h", header, 232, sign)
    with open("map.dat", "wb") as file:
        file.write(bytes(header) + counts.astype(">i4").tobytes())


def read():
    """Return the first height that each reader finds [nm]."""
    (channel,) = gwyddionpy.load("map.dat").channels.values()
    found = {
        "SurfaceTopography": 1e9 * SurfaceTopography.read_topography("map.dat").heights()[0, 0],
        "Gwyddion": 1e9 * channel.data[0, 0],
        "surfalize": 1e3 * surfalize.Surface.load("map.dat").data[0, 0],
    }
    if struct.unpack(">h", open("map.dat", "rb").read()[218:220])[0] < 2:  # prysm knows 0 and 1
        found["prysm"] = read_zygo_dat("map.dat")["phase"][0, 0]
    return found


for resolution, sign, seen in (
    (1, 0, {"SurfaceTopography": 300, "Gwyddion": 300, "surfalize": 2400, "prysm": 300}),
    (2, 0, {"SurfaceTopography": 75, "Gwyddion": 75, "surfalize": 300}),
    (1, 1, {"SurfaceTopography": -300, "Gwyddion": -300, "surfalize": 2400, "prysm": 300}),
):
    write(resolution, sign)
    found = read()
    print(f"resolution {resolution}, sign {sign}:", {name: round(float(one), 3) for name, one in found.items()}, "nm")
    assert found.keys() == seen.keys() and all(np.isclose(found[name], seen[name], rtol=1e-6) for name in seen)
write(0, 0)
try:
    surfalize.Surface.load("map.dat")
except KeyError as error:
    print("resolution 0, surfalize: KeyError", error)
else:
    raise SystemExit("changed: surfalize reads a phase resolution of 0")
END
