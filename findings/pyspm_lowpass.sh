#!/usr/bin/env bash
# pySPM: SPM_image.filter_lowpass of maps with an even and with an odd number of points along a side.
#
# Guess: waves that are longer than the filter's radius asks stay as they are, and so does the mean.
# Seen: so with 32 points. With 33 the heights are multiplied by a wave as long as the map along x and along y: a level map at 5 becomes waves of ±5 with
# mean 0, and one with waves of Sq 0.707 on it has 3.57. Cut a line off before.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pySPM==0.6.3
python - <<'END'
import numpy as np
from pySPM.SPM import SPM_image

for points, mean, rms in ((32, 5.0, 0.70711), (33, 0.0, 3.57071)):
    y, x = np.mgrid[:points, :points] / points
    heights = 5 + np.cos(6 * np.pi * x)
    image = SPM_image(heights.copy(), real={"x": 10.0 * points, "y": 10.0 * points, "unit": "nm"})
    image.filter_lowpass(8)
    found = image.pixels
    print(f"{points} points: mean {heights.mean():.4f} becomes {found.mean():.4f}, standard deviation {heights.std():.5f} becomes {found.std():.5f}")
    assert abs(found.mean() - mean) < 1e-9 and abs(found.std() - rms) < 1e-5
    carrier = np.cos(2 * np.pi * (x + y)) if points % 2 else 1.0
    assert np.allclose(found, heights * carrier)
END
