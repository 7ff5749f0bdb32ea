#!/usr/bin/env bash
# SurfaceTopography 1.27.1: curvatures by distance, scale_dependent_curvature_from_profile, of one map with sides of other lengths.
#
# Guess: it has as many distances whatever the sides are; distances grow with them, curvatures fall with their square.
# Seen: of the same heights of 128 × 128 points there are 20 distances with sides of 1 and 2, and one, without a word, with sides of 3 to 300: what is
# left depends on the unit of lengths. Periodic, 16 distances up to sides of 4, one of 5. Slopes keep theirs. With resampling_method=None all are there, 63 and 31.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import numpy as np
from SurfaceTopography import Topography

heights = np.random.default_rng(0).standard_normal((128, 128)).cumsum(axis=0)
for periodic, slopes, seen in ((False, 31, {1: 20, 2: 20, 3: 1, 30: 1, 300: 1}), (True, 28, {1: 16, 2: 16, 4: 16, 5: 1, 300: 1})):
    for side, expected in seen.items():
        topography = Topography(heights, (side, side), periodic=periodic, unit="um")
        distances, curvatures = topography.scale_dependent_curvature_from_profile()
        every, exact = topography.scale_dependent_curvature_from_profile(resampling_method=None)
        slope = topography.scale_dependent_slope_from_profile()[0]
        print(f"periodic {periodic}, sides {side}: {len(distances)} distances, {len(every)} without resampling, {len(slope)} of slopes")
        assert (len(distances), len(every), len(slope)) == (expected, 31 if periodic else 63, slopes)
        assert np.isclose(distances[0], 2 * side / 128) and np.isclose(curvatures[0], exact[0])
END
