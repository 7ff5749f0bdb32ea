#!/usr/bin/env bash
# Tamaas: tamaas.utils.radial_average, the profile of a contact's pressures.
#
# Guess: the mean over the angles; endpoint says whether the last angle is the first once more, as in numpy.linspace.
# Seen: with endpoint=False, the default, the sum over n angles is divided by n - 1: a field of 1 has the average 8/7 of
# 8 angles, 1.01 of 100; with the end among the angles and endpoint=True it counts twice. Take n angles without the end
# and endpoint=True.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0 scipy==1.17.1
python - <<'END'
import numpy as np
from tamaas.utils import radial_average

x, radii = np.linspace(-1, 1, 65), np.array([0.25, 0.5])
ones, half = np.ones((65, 65)), (x > 0)[:, None] * np.ones(65)
for n in (8, 100):
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    default, other = radial_average(x, x, ones, radii, angles), radial_average(x, x, ones, radii, angles, endpoint=True)
    print(n, "angles without the end: default", default, "endpoint=True", other)
    assert np.allclose(default, n / (n - 1)) and np.allclose(other, 1.0)
angles = np.linspace(0, 2 * np.pi, 9)
twice = radial_average(x, x, half, radii, angles, endpoint=True)
print("half plane, 9 angles with the end, endpoint=True:", twice, "by angles once each", 3 / 8)
assert np.allclose(twice, 4 / 9)
END
