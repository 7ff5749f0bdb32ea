#!/usr/bin/env bash
# slippy 0.5.2: sizes and pressures of Hertzian contacts, contact.hertz_full.
#
# Guess: half axes and pressures are Hertz' for any two bodies of two radii each, and depend on the relative curvatures alone; mean pressures are
# 2/3 of the greatest one, pi/4 of it in line contacts (Johnson 1985, sections 4.1 to 4.3).
# Seen: half axes are right where at most one body has two different radii. Two equal crossed cylinders touch in a circle where they are given as
# (r, inf) and (inf, r), and in an ellipse of 2.07 to 1 with 0.94 of the pressure where they are given as (r, inf) twice with angle pi/2. A ball of
# 10 by 20 mm in a groove of 50 mm has half axes of 1.59 to 1 in place of 1.37 to 1. The mean pressure of an ellipse is the greatest one over
# the area (1e7 times it), that of a line twice the true one and more than the greatest. Spheres are right.
set -euo pipefail
ALONE=slippy==0.5.2 # with the last packages that it runs with
source "$(dirname "$0")/packages.sh" numpy==1.26.4 scipy==1.11.4 matplotlib==3.8.4 numba==0.61.2 tinydb==4.8.2 sympy==1.14.0
python - <<'END' 2>warnings.log
import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

np.float, np.product = float, np.prod  # names that slippy takes from an older numpy
from slippy.contact import hertz_full

YOUNG, POISSON, LOAD, FLAT = 200e9, 0.3, 50.0, float("inf")
MODULUS = YOUNG / (1 - POISSON**2) / 2


def true(first, second, angle):
    """Return half axes and greatest pressure by Johnson's equations 4.25 to 4.28, of the exact integrals."""
    one, two = 1 / np.array(first), 1 / np.array(second)
    total = (one.sum() + two.sum()) / 2
    spread = np.hypot(one[0] - one[1] + (two[0] - two[1]) * np.cos(2 * angle), (two[0] - two[1]) * np.sin(2 * angle)) / 2
    flat, steep = (total - spread) / 2, (total + spread) / 2
    if spread < 1e-9 * total:
        long = short = (3 * LOAD / (8 * flat * MODULUS)) ** (1 / 3)
    else:
        def excess(ratio):
            e = 1 - ratio**2
            return (ellipe(e) / ratio**2 - ellipk(e)) / (ellipk(e) - ellipe(e)) - steep / flat

        e = 1 - brentq(excess, 1e-3, 1 - 1e-6) ** 2
        long = (3 * LOAD * (ellipk(e) - ellipe(e)) / (2 * np.pi * flat * MODULUS * e)) ** (1 / 3)
        short = long * np.sqrt(1 - e)
    return np.array([long, short]), 3 * LOAD / (2 * np.pi * long * short)


for name, first, second, angle, axes, pressure in (
    ("sphere on a plane", (0.01, 0.01), (FLAT, FLAT), 0.0, (1, 1), 1),
    ("ellipsoid on a plane", (0.01, 0.02), (FLAT, FLAT), 0.0, (1, 1), 1),
    ("ellipsoid on a sphere", (0.01, 0.02), (0.03, 0.03), 0.0, (1, 1), 1),
    ("crossed cylinders, by radii", (0.01, FLAT), (FLAT, 0.01), 0.0, (1, 1), 1),
    ("crossed cylinders, by angle", (0.01, FLAT), (0.01, FLAT), np.pi / 2, (1.486, 0.717), 0.9386),
    ("two ellipsoids", (0.01, 0.02), (0.01, 0.02), 0.0, (0.964, 1.030), 1.0068),
    ("ellipsoid in a groove", (0.01, 0.02), (-0.05, FLAT), 0.0, (1.086, 0.934), 0.9858),
):
    found = hertz_full(list(first), list(second), YOUNG, POISSON, LOAD, angle)
    radii, greatest = true(first, second, angle)
    shares = np.array(found["contact_radii"]) / radii, found["max_pressure"] / greatest
    mean = found["mean_pressure"] / found["max_pressure"]
    print(f"{name}: half axes {shares[0].round(4)} of the true ones, pressure {shares[1]:.4f}, mean over greatest pressure {mean:.4g}")
    np.testing.assert_allclose(shares[0], axes, atol=1e-3)
    np.testing.assert_allclose(shares[1], pressure, atol=1e-3)
    np.testing.assert_allclose(mean, 2 / 3 if found["contact_shape"] == "sphere" else 1 / found["contact_area"], rtol=1e-6)
line = hertz_full([0.01, FLAT], [FLAT, FLAT], YOUNG, POISSON, 5e3, line=True)
half = np.sqrt(4 * 5e3 * 0.01 / np.pi / MODULUS)
np.testing.assert_allclose([line["contact_radii"][0], line["max_pressure"]], [half, 2 * 5e3 / np.pi / half], rtol=1e-9)
print(f"line: mean over greatest pressure {line['mean_pressure'] / line['max_pressure']:.4f}, true {np.pi / 4:.4f}")
np.testing.assert_allclose(line["mean_pressure"], 5e3 / half, rtol=1e-9)
END
