#!/usr/bin/env bash
# rfgen, the random fields that come with aspher: summit_density_estimate.
#
# Guess: Nayak's summits per area, m4 / (6 pi sqrt(3) m2), those that a count of an isotropic Gaussian surface finds.
# Seen: its root of m4 / m2 makes a number per length of it: three times as many as there are at a spacing of 1, a third of them at 0.1, and
# 31 times too many at 10. nayak_parameter, m0 m4 / m2^2, is right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" rfgen==0.2.3 scipy==1.17.1
python - <<'END'
import numpy as np
import rfgen
from scipy import ndimage

n = 256
heights = rfgen.selfaffine_field(dim=2, N=n, Hurst=0.8, k_low=0.02, k_high=0.1, rng=np.random.default_rng(0))
summits = (heights == ndimage.maximum_filter(heights, 3, mode="wrap")).sum()
for spacing, seen in ((1.0, 3.1), (0.1, 0.31), (10.0, 31.0)):
    moments = rfgen.compute_standard_moments(heights, spacing)
    nayak = moments["m40"] / moments["m20"] / (6 * np.pi * 3**0.5)
    counted = summits / (n * spacing) ** 2
    found = rfgen.summit_density_estimate(heights, spacing)
    print(f"spacing {spacing}: {found:.4g}, counted {counted:.4g}, by Nayak {nayak:.4g} per area")
    assert abs(nayak / counted - 1) < 0.05 and abs(found / counted / seen - 1) < 0.05
moments = rfgen.compute_standard_moments(heights)
assert np.isclose(rfgen.nayak_parameter(heights), moments["m00"] * moments["m40"] / moments["m20"] ** 2, rtol=0.01)
END
