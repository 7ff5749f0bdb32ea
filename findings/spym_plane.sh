#!/usr/bin/env bash
# spym: a map whose tilt is taken away by DataArray.spym.plane, which subtracts a plane.
#
# Guess: the plane through the heights goes, so that their mean becomes 0.
# Seen: the mean goes twice, with the slope along x and with that along y: heights about 8.1 become heights about −8.1, and a level map at 7 one at −7. The
# tilt is taken away. Take the mean away before, or with fixzero(to_mean=True) after it.
set -euo pipefail
source "$(dirname "$0")/packages.sh" spym==0.9.2 xarray==2026.9.0 hvplot==0.12.2 dask==2026.8.0 matplotlib==3.11.2 scipy==1.17.1
python - <<'END'
import numpy as np
import spym  # noqa: F401 (gives arrays their attribute spym)
import xarray

y, x = np.mgrid[:48, :64]
waves = 0.2 * np.cos(np.pi * x / 8) * np.cos(np.pi * y / 8)
for name, heights, rough in (("level", np.full((48, 64), 7.0), 0.0), ("tilted", 7 + 0.05 * x - 0.02 * y + waves, waves.std())):
    image = xarray.DataArray(heights.copy(), dims=("y", "x"))
    image.spym.plane()
    found = image.values
    print(f"{name}: mean {heights.mean():.4f} becomes {found.mean():.4f}, standard deviation {heights.std():.4f} becomes {found.std():.4f}")
    assert abs(found.mean() + heights.mean()) < 1e-9 and abs(found.std() - rough) < 1e-3
    image.spym.fixzero(to_mean=True)
    assert abs(image.values.mean()) < 1e-9
END
