#!/usr/bin/env bash
# tribology: Hertz' contact of ellipses by reff, ahertz, phertz and dhertz, the last with half of eeff (see tribology_approach.sh).
#
# Guess: half axes along x and y, as they are described, pressures and approaches within 1 % of Hertz' integrals.
# Seen: pressures and half axes are within 1 %, but the axes come by length: with radii of 5 and 10 or of 10 and 5, the first is the
# shorter one. The approach is Hertz' for circles only: 0.79 of it at radii of 1 to 2, 0.28 at 1 to 10, 0.017 at 1 to 400; and of two
# equal cylinders crossed, whose contact is a circle, 0.35.
set -euo pipefail
source "$(dirname "$0")/packages.sh" opencv-python-headless==5.0.0.93 scipy==1.17.1 matplotlib==3.11.2 numexpr==2.14.2 setuptools==80.9.0
pip install -qq --disable-pip-version-check --no-deps --only-binary=:all: tribology==0.5.16 # which asks for another numpy
python - <<'END'
import numpy as np
import tribology
from scipy import optimize, special

modulus, force = 115e3, 100.0  # E* [MPa], [N]


def hertz(first, second):
    """Return the half axes along x and y and the approach of relative radii along x and y (K. L. Johnson, Contact Mechanics, 4.2)."""
    flat, sharp = max(first, second), min(first, second)
    if flat == sharp:
        a = (3 * force * flat / (4 * modulus)) ** (1 / 3)
        return a, a, a**2 / flat

    def ratio(m):
        return (special.ellipe(m) / (1 - m) - special.ellipk(m)) / (special.ellipk(m) - special.ellipe(m))

    m = optimize.brentq(lambda m: ratio(m) - flat / sharp, 1e-6, 1 - 1e-10)
    a = (3 * force * flat * (special.ellipk(m) - special.ellipe(m)) / (np.pi * modulus * m)) ** (1 / 3)
    axes = (a, a * np.sqrt(1 - m))
    return *(axes if first > second else axes[::-1]), 3 * force / (2 * np.pi * a * modulus) * special.ellipk(m)


flat = 1e12
for radii, seen in (
    ((5, 5, flat, flat), 1.0),
    ((5, 10, flat, flat), 0.787),
    ((10, 5, flat, flat), 0.787),
    ((5, 50, flat, flat), 0.282),
    ((5, 2000, flat, flat), 0.0172),
    ((5, flat, flat, 5), 0.348),
):
    relative = tribology.reff(*(0 if one == flat else one for one in radii))
    axes = tribology.ahertz(*relative, 2 * modulus, force)[:2]
    pressure = tribology.phertz(*relative, 2 * modulus, force, ret="max")
    approach = tribology.dhertz(modulus, *radii, force)
    *exact, deep = hertz(*relative[1:])
    print(f"radii {radii}: half axes {axes}, Hertz {exact}; approach {approach:.3e}, Hertz {deep:.3e}, ratio {approach / deep:.4f}")
    np.testing.assert_allclose(axes, sorted(exact), rtol=1e-2)
    np.testing.assert_allclose(pressure, 1.5 * force / (np.pi * np.prod(exact)), rtol=1e-2)
    np.testing.assert_allclose(approach / deep, seen, rtol=5e-3)
END
