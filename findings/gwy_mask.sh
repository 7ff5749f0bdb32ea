#!/usr/bin/env bash
# Gwyddion (.gwy): a channel with a mask, by which its users mark grains, summits or spikes.
#
# Guess: the mask is a mark of its own, and all heights are read.
# Seen: SurfaceTopography and surfalize call the marked heights missing. A map saved with its summits marked comes
# without summits. Delete the mask before you save a map that is to be pressed.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 surfalize==0.19.2 gwyfile==0.3.0
python - <<'END'
import numpy as np
import surfalize
import SurfaceTopography
from gwyfile.objects import GwyContainer, GwyDataField, GwySIUnit

heights = 1e-9 * np.arange(12.0).reshape(3, 4)
metre = GwySIUnit(unitstr="m")
for marked in (False, True):
    container = GwyContainer()
    container["/0/data"] = GwyDataField(heights, xreal=8e-6, yreal=6e-6, si_unit_xy=metre, si_unit_z=metre)
    container["/0/data/title"] = "Height"
    if marked:
        summits = (heights > 1e-8).astype(float)  # the highest point
        container["/0/mask"] = GwyDataField(summits, xreal=8e-6, yreal=6e-6, si_unit_xy=metre)
    container.tofile("map.gwy")
    topography = SurfaceTopography.read_topography("map.gwy").heights()
    missing = int(np.ma.count_masked(topography)), int(np.isnan(surfalize.Surface.load("map.gwy").data).sum())
    print("with" if marked else "without", "mask: missing heights", missing, "highest", float(topography.max()), "m")
    assert missing == ((1, 1) if marked else (0, 0))
    assert np.isclose(topography.max(), 1e-8 if marked else 1.1e-8, atol=0)
END
