#!/bin/bash
# ISO 25178-71 (.sdf), text, of the second edition, aISO-2.0: heights are whole numbers of an increment.
#
# Guess: a reader knows the edition, or refuses the file.
# Instead: SurfaceTopography takes it for a bare matrix of numbers: it asks for the sides that the header
# states, and then hands out the whole numbers as heights, a billion times too high. surfalize and sdfio read it.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2 sdfio==2.0.0
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import sdfio
import surfalize
import SurfaceTopography

for name in ("SurfaceTopography", "surfalize", "sdfio"):
    print(name, version(name))
heights = 1e-9 * np.arange(20.0).reshape(4, 5)
metadata = sdfio.Metadata(revision=sdfio.Revision.ISO_2_0, data_type=sdfio.DataType.INT32)
scales = {"x_scale": 1e-6, "y_scale": 1e-6, "z_scale": 1e-9}
sdfio.write("map.sdf", heights, **scales, metadata=metadata, format=sdfio.FileFormat.ASCII)
print(open("map.sdf").read())
np.testing.assert_allclose(sdfio.read("map.sdf").data, heights)
np.testing.assert_allclose(surfalize.Surface.load("map.sdf").data, 1e6 * heights)
try:
    SurfaceTopography.read_topography("map.sdf")
except ValueError as error:
    print("SurfaceTopography:", error)
    assert "physical_sizes" in str(error)
else:
    raise SystemExit("it knows the sides now")
found = SurfaceTopography.read_topography("map.sdf", physical_sizes=(5.0, 4.0)).heights()
print("heights between", found.min(), "and", found.max())
assert np.isclose(found.max(), 19.0)
END
