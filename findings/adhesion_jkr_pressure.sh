#!/usr/bin/env bash
# Adhesion 0.93, beside ContactMechanics: a sphere with adhesion by Johnson, Kendall and Roberts, ReferenceSolutions.JKR.
#
# Guess: peak_pressure of a force is the pressure in the middle, as stress_distribution has it near there (tension counts positive).
# Seen: it is a length, the smaller contact radius that bears the same force, at which no contact is stable: of a force of 0.05, 0.0686 in place
# of 0.798; without adhesion it is the contact radius itself. Of a penetration it is refused. Contact radius, penetration and stresses are right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" adhesion==0.93 ContactMechanics==1.8.3 SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import numpy as np
from Adhesion.ReferenceSolutions import JKR

radius, modulus = 2.0, 3.0
for work, force in ((0.1, 0.05), (0.1, 1.0), (1e-9, 1.0)):
    sphere = {"radius": radius, "contact_modulus": modulus, "work_of_adhesion": work}
    pull = 3 * np.pi * work * radius
    both = [(3 * radius / (4 * modulus) * (force + pull + sign * np.sqrt(2 * pull * force + pull**2))) ** (1 / 3) for sign in (1, -1)]
    middle = 2 * modulus * both[0] / (np.pi * radius) - np.sqrt(2 * work * modulus / (np.pi * both[0]))
    found = JKR.peak_pressure(force=force, **sphere)
    theirs = -JKR.stress_distribution(np.array([1e-6]), both[0], **sphere)[0]
    print(f"work {work}, force {force}: peak_pressure {found:.5f}, pressure in the middle {theirs:.5f}, contact radii {np.round(both, 5)}")
    np.testing.assert_allclose(JKR.contact_radius(force=force, **sphere), both[0], rtol=1e-9)
    np.testing.assert_allclose(theirs, middle, rtol=1e-6)
    np.testing.assert_allclose(found, both[1], rtol=1e-4)
try:
    JKR.peak_pressure(penetration=0.1, **sphere)
except NotImplementedError:
    print("of a penetration: NotImplementedError")
else:
    raise SystemExit("changed: a penetration was refused")
END
