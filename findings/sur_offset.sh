#!/bin/bash
# Digital Surf (.sur): the header's offset of heights, and what heights count from.
#
# Guess: heights are numbers times increment plus offset in all readers.
# Instead: so they are in surfalize; SurfaceTopography leaves the offset out, rosettasciio adds it but
# counts from the lowest number. Three readers, three levels, of no harm to roughness but to steps between files.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2 rosettasciio==0.15.0
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import surfalize
import SurfaceTopography
from rsciio.digitalsurf import file_reader

import struct

NUMBERS = [[5, 6, 7, 8], [9, 10, 11, 12], [13, 14, 15, 16]]  # 4 × 3 heights of 0.1 µm


def sur(inversion=0, offset=0.0):
    """Return a Digital Surf file: 512 bytes of header, whole numbers, lines along x."""
    text = [b"X", b"Y", b"Z", *[b"um"] * 6]
    head = struct.pack("<12s4H30s30s", b"DIGITAL SURF", 0, 1, 1, 2, b"map", b"none")
    head += struct.pack("<5H8xH5i", 0, 0, 0, 0, 0, 32, 5, 16, 4, 3, 12)
    head += struct.pack("<3f", 2.0, 2.0, 0.1) + b"".join(one.ljust(16) for one in text)
    head += struct.pack("<3f3H", 1, 1, 1, 0, inversion, 0)
    head = head.ljust(466, b"\0") + struct.pack("<3f", 0.0, 0.0, offset)
    return head.ljust(512, b"\0") + struct.pack("<12i", *sum(NUMBERS, []))


def heights(file):
    """Return the lines [µm] that three programs read."""
    return {
        "SurfaceTopography": SurfaceTopography.read_topography(file).heights().T,
        "surfalize": surfalize.Surface.load(file).data,
        "rosettasciio": file_reader(file)[0]["data"],
    }


for name in ("SurfaceTopography", "surfalize", "rosettasciio"):
    print(name, version(name))
open("map.sur", "wb").write(sur(offset=7.0))
found = {name: float(one[0, 0]) for name, one in heights("map.sur").items()}
print("first height, 5 increments of 0.1 µm and an offset of 7 µm:", found)
expected = {"SurfaceTopography": 0.5, "surfalize": 7.5, "rosettasciio": 7.0}
for name, height in expected.items():
    assert abs(found[name] - height) < 1e-5, name
END
