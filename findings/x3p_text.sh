#!/usr/bin/env bash
# X3P (.x3p): heights as text in main.xml, which the standard allows beside binary ones.
#
# Guess: what reads X3P reads both.
# Seen: SurfaceTopography refuses such a file (no reader takes it; its X3P reader misses 'DataLink'); surfalize
# and x3pio read it. So it is with a file of several layers, which surfalize refuses too.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 surfalize==0.19.2 x3pio==2.0.0
python - <<'END'
import numpy as np
import surfalize
import SurfaceTopography
import x3pio
from SurfaceTopography.Exceptions import CannotDetectFileFormat

heights = 1e-9 * np.arange(12.0).reshape(3, 4)
options = {"x_scale": 2e-6, "y_scale": 3e-6, "revision": x3pio.Revision.ISO5436_2000}
layers = np.stack([heights, heights])
for name, content, storage in (("BINARY", heights, "BINARY"), ("XML", heights, "XML"), ("layers", layers, "BINARY")):
    x3pio.write("map.x3p", content, storage=x3pio.DataStorage[storage], **options)
    np.testing.assert_allclose(x3pio.read("map.x3p").layers[0].z, heights)
    try:
        np.testing.assert_allclose(SurfaceTopography.read_topography("map.x3p").heights().T, heights)
        print(name, "SurfaceTopography reads it")
        assert name == "BINARY"
    except CannotDetectFileFormat:
        print(name, "SurfaceTopography refuses it")
        assert name != "BINARY"
    try:
        np.testing.assert_allclose(surfalize.Surface.load("map.x3p").data, 1e6 * heights)
        print(name, "surfalize reads it")
        assert name != "layers"
    except surfalize.exceptions.UnsupportedFileFormatError as error:
        print(name, "surfalize refuses it:", error)
        assert name == "layers"
END
