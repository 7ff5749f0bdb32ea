#!/bin/bash
# Digital Surf (.sur): the header's inversion flag says that heights were turned over.
#
# Guess: either all readers obey it, or none does.
# Instead: SurfaceTopography turns the heights over (1) and mirrors them besides (2, 3), surfalize and
# rosettasciio leave them: summits of one are valleys of the others.
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

NUMBERS = [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]  # 4 × 3 heights of 0.1 µm


def sur(inversion=0, offset=0.0):
    """Return a Digital Surf file: 512 bytes of header, whole numbers, lines along x."""
    text = [b"X", b"Y", b"Z", *[b"um"] * 6]
    head = struct.pack("<12s4H30s30s", b"DIGITAL SURF", 0, 1, 1, 2, b"map", b"none")
    head += struct.pack("<5H8xH5i", 0, 0, 0, 0, 0, 32, 0, 11, 4, 3, 12)
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
plain = 0.1 * np.array(NUMBERS)
there = {0: plain, 1: -plain, 2: -plain[:, ::-1], 3: -plain[::-1]}
for inversion, expected in there.items():
    open("map.sur", "wb").write(sur(inversion))
    found = heights("map.sur")
    print("flag", inversion, {name: one[0].round(3).tolist() for name, one in found.items()})
    np.testing.assert_allclose(found["SurfaceTopography"], expected, atol=1e-6)
    np.testing.assert_allclose(found["surfalize"], plain, atol=1e-6)
    np.testing.assert_allclose(found["rosettasciio"], plain, atol=1e-6)
END
