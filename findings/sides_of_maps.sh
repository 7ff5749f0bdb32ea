#!/bin/bash
# Sides of one map of n points a distance d apart, in an ISO 25178-71 file (.sdf).
#
# Guess: n d in all readers, the area of n pixels.
# Instead: n d in SurfaceTopography, (n - 1) d in surfalize: of 4 × 3 points 8 × 6 and 6 × 4 µm, the
# nominal area of a contact, and with it mean pressures, differ by a factor of 2; on 512 points by 0.4 %.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import surfalize
import SurfaceTopography

header = {"ManufacID": "none", "CreateDate": "010120260000", "ModDate": "010120260000"}
header |= {"NumPoints": 4, "NumProfiles": 3, "Xscale": 2e-6, "Yscale": 2e-6, "Zscale": 1e-9}
header |= {"Zresolution": -1, "Compression": 0, "DataType": 6, "CheckType": 0}
lines = ["aISO-1.0", *(f"{key} = {value}" for key, value in header.items()), "*"]
lines += ["0 1 2 3", "4 5 6 7", "8 9 10 11", "*", ""]
open("map.sdf", "w").write("\n".join(lines))
topography, surface = SurfaceTopography.read_topography("map.sdf"), surfalize.Surface.load("map.sdf")
print("SurfaceTopography", version("SurfaceTopography"), topography.physical_sizes, topography.unit)
print("surfalize", version("surfalize"), (surface.width_um, surface.height_um), "µm")
np.testing.assert_allclose(topography.physical_sizes, (8.0, 6.0))
np.testing.assert_allclose((surface.width_um, surface.height_um), (6.0, 4.0))
END
