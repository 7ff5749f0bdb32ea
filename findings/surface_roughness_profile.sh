#!/usr/bin/env bash
# surface-roughness 0.0.3: profiles of a surface, Surface.sample_profile.
#
# Guess: hhcorr is the rms difference of heights at a distance, whatever the number of points; z2 is the rms slope of the levelled profile.
# Seen: hhcorr is the root of the sum, not of the mean: 30.8 and 43.6 on 500 and 1000 points of a wave whose heights at half its length are
# 1.41 apart. Fewer pairs at larger distances lower it, and a Hurst exponent taken from it. z2 divides heights that are levelled by steps that
# are not: of a profile tilted by 0.5 rad it is 13 % too large. Rq is right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surface-roughness==0.0.3 meshio==5.3.5 scipy==1.17.1 matplotlib==3.11.2
python - <<'END'
import meshio
import numpy as np
from surface_roughness import Surface


def profile(count, tilt=0.0):
    """Return the profile of cos(2 pi x), x = 0 to 10, after turning it by an angle [rad]."""
    x = np.arange(count + 1) * 10 / count
    height = 0.1 * np.cos(2 * np.pi * x)
    x, height = x * np.cos(tilt) - height * np.sin(tilt), x * np.sin(tilt) + height * np.cos(tilt)
    points = np.array([(at, y, z) for y in (-1, 1) for at, z in zip(x, height)])
    first = np.arange(count)
    corners = [np.stack([first, first + 1, first + count + 1], 1), np.stack([first + 1, first + count + 2, first + count + 1], 1)]
    surface = Surface(mesh=meshio.Mesh(points, {"triangle": np.vstack(corners)}), preprocess=False, verbose=False)
    return surface.sample_profile(np.stack([np.linspace(x[0], x[-1], count + 1), np.zeros(count + 1)], 1)), x, height


for count, seen in ((500, 30.8), (1000, 43.6)):
    found, _, _ = profile(count)
    at = count // 20 - 1  # half a wave
    distance, correlation = found.hhcorr()[at]
    heights = found.points[:, 1]
    mean = np.sqrt(np.mean((heights[at + 1 :] - heights[: -at - 1]) ** 2))
    print(f"{count} points: at a distance of {distance:.3f} {10 * correlation:.2f} amplitudes, rms difference {10 * mean:.3f}")
    np.testing.assert_allclose(10 * correlation, seen, rtol=5e-3)
    np.testing.assert_allclose(10 * mean, 2**0.5, rtol=5e-3)
for tilt, ratio in ((0.0, 1.0), (0.5, 1.0 / np.cos(0.5))):
    found, _, _ = profile(1000, tilt)
    level = found.points - found.points.mean(0)
    true = np.sqrt(np.mean((np.diff(level[:, 1]) / np.diff(level[:, 0])) ** 2))
    print(f"tilt {tilt}: rms slope {found.z2():.4f}, of its own points {true:.4f}; Rq {found.Rq:.4f}")
    np.testing.assert_allclose(found.z2() / true, ratio, rtol=1e-2)
    np.testing.assert_allclose(found.Rq, 0.1 * 2**-0.5, rtol=2e-2)
END
