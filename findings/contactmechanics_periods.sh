#!/usr/bin/env bash
# ContactMechanics, periodic half-space: one surface as 1, 2, 4 periods a side.
#
# Guess: the same mean pressure gives the same approach, however many periods are solved at once.
# Seen: pressures, contact area and mean gap are the same, but the offset of the surface is not (-1.95, -0.36, 2.83 um
# for waves of 10 um): a uniform displacement counts as elastic with the stiffness of the longest wave of the sample.
# Compare mean gaps.
set -euo pipefail
source "$(dirname "$0")/packages.sh" ContactMechanics==1.8.3 SurfaceTopography==1.27.1
python - <<'END'
import numpy as np
from ContactMechanics.Factory import make_system
from SurfaceTopography import Topography

n = 32
wave = np.cos(2 * np.pi * np.arange(n) / n)
period = 0.01 * wave[:, None] * wave  # mm, of sides of 1 mm
for periods, offset in ((1, -0.0019495), (2, -0.000358), (4, 0.0028251)):
    heights = np.tile(period, (periods, periods))
    topography = Topography(heights, (float(periods), float(periods)), periodic=True)
    system = make_system(young=1.0, surface=topography, substrate="periodic")
    result = system.minimize_proxy(external_force=5e-3 * periods**2, pentol=1e-9)
    gap = (system.disp - heights - result.offset).mean()
    area = system.compute_contact_area() / periods**2
    print(periods, "periods: offset", result.offset, "mean gap", gap, "contact area", area)
    assert result.success and abs(result.offset - offset) < 1e-6
    assert abs(gap - 0.00354108) < 1e-7 and area == 0.212890625
END
