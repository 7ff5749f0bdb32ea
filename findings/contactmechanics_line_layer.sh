#!/usr/bin/env bash
# ContactMechanics 1.8.3: a layer on a rigid base (thickness, poisson) under profiles, as of line contacts, and under maps.
#
# Guess: PeriodicFFTElasticHalfSpace has the same displacements under a wave whether it is given as a profile or as a map.
# Seen: of a profile the thickness is left out without a word: displacements are those of a half-space, 7.75 times those of a layer of a
# twentieth of the wavelength. Of a map they are right. Repeat the profile in a few columns.
set -euo pipefail
source "$(dirname "$0")/packages.sh" ContactMechanics==1.8.3 SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import numpy as np
from ContactMechanics import PeriodicFFTElasticHalfSpace

n, columns, young, poisson = 64, 4, 3.0, 0.3
wave = np.cos(2 * np.pi * np.arange(n) / n)
half_space = 2 * (1 - poisson**2) / young / (2 * np.pi)
for thickness in (None, 0.05):
    line = PeriodicFFTElasticHalfSpace((n,), young, (1.0,), thickness=thickness, poisson=poisson)
    area = PeriodicFFTElasticHalfSpace((n, columns), young, (1.0, 1.0), thickness=thickness, poisson=poisson)
    profile = -line.evaluate_disp(wave * line.area_per_pt).ravel()[0] / half_space
    spread = -area.evaluate_disp(np.tile(wave[:, None], columns) * area.area_per_pt)[0, 0] / half_space
    true = 1.0
    if thickness:  # bonded to its base, in plane strain
        q, k = 2 * np.pi * thickness, 3 - 4 * poisson
        true = (k * np.sinh(2 * q) - 2 * q) / (k * np.cosh(2 * q) + 2 * q**2 + 1 + 4 * (1 - poisson) * (1 - 2 * poisson))
    print(f"thickness {thickness}: over a half-space's: profile {profile:.5f}, map {spread:.5f}, closed form {true:.5f}")
    np.testing.assert_allclose([profile, spread], [1.0, true], rtol=1e-9)
END
