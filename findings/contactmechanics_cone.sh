#!/usr/bin/env bash
# ContactMechanics 1.8.3: a cone on a half-space, ReferenceSolutions.Cone.
#
# Guess: with beta between cone and surface, the contact's area over the square of the penetration is pi (2 / (pi tan beta))^2, and displacements
# in the contact are 1 - r tan beta of the penetration (Johnson 1985, section 5.2).
# Seen: the area is pi times the radius, not its square: 6.47 in place of 13.3 at beta 0.3. Displacements in the contact depend on the points asked
# at: they are 0.363 at the outermost one of them within the contact, 0.682 or 0.936 in the middle in place of 1. Outside, and pressures over the
# mean one, are right. Forces are over the contact modulus times the area, where "Young's" is said.
set -euo pipefail
source "$(dirname "$0")/packages.sh" ContactMechanics==1.8.3 SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import numpy as np
from ContactMechanics.ReferenceSolutions import Cone

beta = 0.3
opening = np.pi / 2 - beta
radius, area = Cone.contact_radius_and_area(opening)
true = 2 / (np.pi * np.tan(beta))
print(f"radius {radius:.5f}, area {area:.5f}, true {true:.5f} and {np.pi * true**2:.5f}")
np.testing.assert_allclose([radius, area], [true, np.pi * true], rtol=1e-12)
for last, middle in ((0.5, 0.681690), (0.9, 0.936338)):
    at = np.linspace(0, last * true, 3)
    found, exact = Cone.deformation(at, opening), 1 - at * np.tan(beta)
    print("displacements at", at.round(4), "are", found.round(5), "true", exact.round(5))
    np.testing.assert_allclose(found[-1], 1 - 2 / np.pi, rtol=1e-9)
    np.testing.assert_allclose(found[0], middle, rtol=1e-5)
beyond = true * np.array([1.2, 3.0])
ratio = beyond / true
np.testing.assert_allclose(
    Cone.deformation(np.append(0.1, beyond), opening)[1:],
    2 / np.pi * (np.arcsin(1 / ratio) - ratio + np.sqrt(ratio**2 - 1)),
    rtol=1e-9,
)
inside = true * np.array([0.1, 0.7])
np.testing.assert_allclose(Cone.pressure(inside, opening), np.arccosh(true / inside), rtol=1e-9)
# Sneddon's force, E* a^2 pi tan(beta) / 2, over E* and the true area
np.testing.assert_allclose(Cone.load_and_mean_pressure(opening)[0], np.tan(beta) / 2, rtol=1e-12)
END
