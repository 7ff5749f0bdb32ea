#!/usr/bin/env bash
# Gwyddion's files (.gwy) of images with unlike numbers of rows and columns, in AFMReader (TopoStats).
#
# Guess: 3 rows of 4 heights are 3 rows of 4 heights, as to SurfaceTopography and surfalize.
# Seen: AFMReader takes the numbers of rows and columns for each other, and cuts the same list of heights into 4 rows of 3:
# neighbours are torn apart, no transposed image. Its size of a point is the width divided by the number of rows.
set -euo pipefail
source "$(dirname "$0")/packages.sh" AFMReader==0.0.7 gwyfile==0.3.0 surfalize==0.19.2 SurfaceTopography==1.27.1
python - 2>log <<'END' || { cat log; exit 1; }
import numpy as np
import surfalize
import SurfaceTopography
from AFMReader.gwy import load_gwy
from gwyfile.objects import GwyContainer, GwyDataField, GwySIUnit

heights = np.arange(12.0).reshape(3, 4)  # nm, a plane
metres = [GwySIUnit(unitstr="m") for _ in range(2)]
image = GwyDataField(1e-9 * heights, xreal=8e-6, yreal=9e-6, si_unit_xy=metres[0], si_unit_z=metres[1])
container = GwyContainer()
container["/0/data/title"], container["/0/data"] = "Height", image
container.tofile("map.gwy")
cut, step = load_gwy("map.gwy", "Height")
print("AFMReader [nm]", cut.round(6).tolist(), "step", step)
topography = SurfaceTopography.read_topography("map.gwy").to_unit("nm")
np.testing.assert_allclose(topography.heights().T, heights, atol=1e-6)
np.testing.assert_allclose(1e3 * surfalize.Surface.load("map.gwy").data, heights, atol=1e-6)
np.testing.assert_allclose(cut, heights.reshape(4, 3), atol=1e-6)
assert np.isclose(step, 8000 / 3)  # 2000 nm along x, 3000 nm along y
END
