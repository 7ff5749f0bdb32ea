#!/usr/bin/env bash
# X3P (.x3p): maps that SurfaceTopography writes, read by others.
#
# Guess: what one package writes as X3P the others read.
# Seen: surfalize and x3pio refuse it: the checksum in md5checksum.hex is that of the heights, where theirs is that
# of main.xml. SurfaceTopography, which does not look at it, reads the file. Its .gwy files are read by all.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 surfalize==0.19.2 x3pio==2.0.0
python - <<'END'
import hashlib
import zipfile

import numpy as np
import surfalize
import SurfaceTopography
import x3pio

heights = np.arange(12.0).reshape(4, 3)
written = SurfaceTopography.Topography(heights, (8.0, 9.0), unit="µm")
written.to_x3p("map.x3p")
written.to_gwy("map.gwy")
np.testing.assert_allclose(SurfaceTopography.read_topography("map.x3p").heights(), 1e-6 * heights)
np.testing.assert_allclose(surfalize.Surface.load("map.gwy").data, heights.T)
with zipfile.ZipFile("map.x3p") as file:
    stated = file.read("md5checksum.hex").decode().lower()
    sums = {name: hashlib.md5(file.read(name)).hexdigest() for name in ("main.xml", "bindata/data.bin")}
print("md5checksum.hex:", stated.strip())
print(sums)
assert sums["bindata/data.bin"] in stated and sums["main.xml"] not in stated
for name, read in (("surfalize", surfalize.Surface.load), ("x3pio", x3pio.read)):
    try:
        read("map.x3p")
    except Exception as error:
        print(name, type(error).__name__, error)
        assert "hecksum" in f"{type(error).__name__} {error}"
    else:
        raise SystemExit(f"{name} reads it now")
END
