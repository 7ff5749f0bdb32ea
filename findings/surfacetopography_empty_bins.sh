#!/usr/bin/env bash
# SurfaceTopography 1.27.1: curves by distance or by wave number (slopes, autocorrelation, power spectrum of profiles) in their usual spacing.
#
# Guess: distances that no pair of points has are left out, or their values are nan.
# Seen: such values are masked, with 0 below the mask: 7 of 28 slopes, autocorrelations and powers of a map of 128 × 128 points. np.asarray, np.savetxt
# and np.trapezoid take no notice of the mask: texts and integrals have slopes and powers of 0 between true ones. Take np.ma.compressed of the
# values, and the distances where none is masked, or resampling_method=None.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import numpy as np
from SurfaceTopography import Topography

heights = np.random.default_rng(0).standard_normal((128, 128)).cumsum(axis=0)
topography = Topography(heights, (1.0, 1.0), periodic=True, unit="um")
for name in ("scale_dependent_slope_from_profile", "autocorrelation_from_profile", "power_spectrum_from_profile"):
    places, values = getattr(topography, name)()[:2]
    np.savetxt("curve.txt", np.column_stack([places, values]))
    written = np.loadtxt("curve.txt")[:, 1]
    masked = np.ma.getmaskarray(values)
    print(f"{name}: {len(places)} values, {masked.sum()} masked, {(written == 0).sum()} written as 0")
    assert len(places) == 28 and masked.sum() == 7 and not np.isnan(written).any()
    assert np.array_equal(written == 0, masked)
    alone = getattr(topography, name)(resampling_method=None)[1]
    assert not np.ma.getmaskarray(alone).any()
END
