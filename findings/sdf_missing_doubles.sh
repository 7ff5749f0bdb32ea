#!/bin/bash
# ISO 25178-71 (.sdf), binary, heights of doubles: the least double marks a missing height.
#
# Guess: three readers call it missing, as they do the least whole numbers of integers.
# Instead: SurfaceTopography makes a height of -1.8e305 µm of it, which every mean takes part in.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2 sdfio==2.0.0
cd "$folder"
venv/bin/python - <<'END'
import struct
from importlib.metadata import version

import numpy as np
import sdfio
import surfalize
import SurfaceTopography


def sdf(code, kind, least):
    """Return a file of 4 × 3 heights of 1 nm, the second of which is missing."""
    head = struct.pack("<8s10s12s12s", b"bISO-1.0", b"none", b"010120260000", b"010120260000")
    head += struct.pack("<2H4d3B", 4, 3, 1e-6, 1e-6, 1e-9, -1.0, 0, code, 0)
    numbers = np.arange(12).astype(kind)
    numbers[1] = least
    return head + numbers.tobytes()


def second(file):
    """Return the second height as three programs read it."""
    topography = SurfaceTopography.read_topography(file)
    return {
        "SurfaceTopography": np.ma.filled(np.ma.array(topography.heights()), np.nan)[1, 0],
        "surfalize": surfalize.Surface.load(file).data[0, 1],
        "sdfio": sdfio.read(file).data[0, 1],
    }


for name in ("SurfaceTopography", "surfalize", "sdfio"):
    print(name, version(name))
open("integers.sdf", "wb").write(sdf(6, "<i4", -(2**31)))
open("doubles.sdf", "wb").write(sdf(7, "<f8", np.finfo(float).min))
integers, doubles = second("integers.sdf"), second("doubles.sdf")
print("integers", integers)
print("doubles", doubles)
assert all(np.isnan(one) for one in integers.values())
assert np.isnan(doubles["surfalize"]) and np.isnan(doubles["sdfio"])
assert doubles["SurfaceTopography"] < -1e300
END
