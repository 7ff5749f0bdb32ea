#!/usr/bin/env bash
# tribology: Hertz' contact of a ball of steel on a flat, by ahertz, phertz and dhertz with the modulus of eeff.
#
# Guess: eeff is the contact modulus E*; radius, pressure and approach are Hertz'.
# Seen: eeff is 2 E*. Radius, pressures and the boundary elements of besolve take it so and are right; dhertz takes it for E*:
# its approach is 0.63 of Hertz', and of that of besolve. Give dhertz half of it.
set -euo pipefail
source "$(dirname "$0")/packages.sh" opencv-python-headless==5.0.0.93 scipy==1.17.1 matplotlib==3.11.2 numexpr==2.14.2 setuptools==80.9.0
pip install -qq --disable-pip-version-check --no-deps --only-binary=:all: tribology==0.5.16 # which asks for another numpy
python - <<'EOF'
import numpy as np
import tribology

modulus, radius, force = 210e3 / (2 * (1 - 0.3**2)), 5.0, 10.0
a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
e_eff = tribology.eeff(210e3, 0.3, 210e3, 0.3)
radii = tribology.reff(radius, radius, 0, 0)
print("eeff / E*", e_eff / modulus)
print("contact radius", tribology.ahertz(*radii, e_eff, force)[0], "Hertz", a)
print("largest pressure", tribology.phertz(*radii, e_eff, force, ret="max"), "Hertz", 1.5 * force / (np.pi * a**2))
assert np.isclose(e_eff, 2 * modulus) and np.isclose(tribology.ahertz(*radii, e_eff, force)[0], a)
assert np.isclose(tribology.phertz(*radii, e_eff, force, ret="max"), 1.5 * force / (np.pi * a**2))
x = np.linspace(-0.12, 0.12, 25)
ball = np.add.outer(x**2, x**2) / (2 * radius)
influence = tribology.beinflumatred(tribology.beinflumat(x, x, e_eff))
numerical = tribology.besolve(ball, np.zeros_like(ball), force, influence, x[1] - x[0], x[1] - x[0], norm_disp=1e-3)[3]
flat = 1e12
approach, half = (tribology.dhertz(one, radius, radius, flat, flat, force) for one in (e_eff, e_eff / 2))
print("approach", approach, "with eeff / 2", half, "Hertz", a**2 / radius, "besolve", numerical)
assert np.isclose(approach, 2 ** (-2 / 3) * a**2 / radius, rtol=1e-3)
assert np.isclose(half, a**2 / radius, rtol=1e-3) and np.isclose(numerical, a**2 / radius, rtol=0.02)
EOF
