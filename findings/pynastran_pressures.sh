#!/usr/bin/env bash
# pyNastran 1.3.4: the load that pressures of PLOAD4 with another value at each corner amount to (sum_forces_moments), as of a contact,
# and the centre of gravity of pyramids.
#
# Guess: force and moments are integrals of the pressure, which is bilinear on the face; a pyramid's centre is at a quarter of its height.
# Seen: the corners' mean times the area, at the mean of the corners. On a rectangle of 2 x 1, with 0 to 3 along it, the moment is 3 in place
# of 4; on a trapezoid the force, too, is 7.5 in place of 9. With one value for all corners both are right. Pyramids have theirs at
# half the height. A PLOAD2 on a CQUAD8 counts nothing, which it says.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pyNastran==1.3.4 scipy==1.17.1
python - <<'END'
import numpy as np
from pyNastran.bdf.bdf import BDF
from pyNastran.bdf.mesh_utils.loads import sum_forces_moments
from pyNastran.bdf.mesh_utils.mass_properties import mass_properties


def model(nodes):
    """Return a model of these nodes with a material."""
    made = BDF(debug=None)
    for number, at in enumerate(nodes):
        made.add_grid(number + 1, at)
    made.add_mat1(1, 1.0, None, 0.3, rho=2.0)
    return made


def exact(corners, pressures):
    """Return the force along z and the moment about y of a bilinear pressure."""
    force = moment = 0.0
    points, weights = np.polynomial.legendre.leggauss(4)
    for r, w in zip(points, weights):
        for s, v in zip(points, weights):
            shape = np.array([(1 - r) * (1 - s), (1 + r) * (1 - s), (1 + r) * (1 + s), (1 - r) * (1 + s)]) / 4
            along = np.array([s - 1, 1 - s, 1 + s, -1 - s]) @ corners / 4
            across = np.array([r - 1, -1 - r, 1 + r, 1 - r]) @ corners / 4
            part = w * v * (along[0] * across[1] - along[1] * across[0]) * (shape @ pressures)
            force, moment = force + part, moment - part * (shape @ corners)[0]
    return force, moment


rectangle = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])
trapezoid = np.array([[0.0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 1, 0]])
for name, corners, pressures, seen in (
    ("rectangle, even", rectangle, [3.0] * 4, (6.0, -6.0)),
    ("rectangle", rectangle, [0.0, 3, 3, 0], (3.0, -3.0)),
    ("trapezoid", trapezoid, [6.0, 6, 0, 0], (7.5, -9.375)),
):
    plate = model(corners)
    plate.add_pshell(1, 1, t=0.1)
    plate.add_cquad4(1, 1, [1, 2, 3, 4])
    plate.add_pload4(1, [1], pressures, None, None)
    plate.cross_reference()
    forces, moments = sum_forces_moments(plate, np.zeros(3), 1, include_grav=False)
    print(f"{name}: force {forces[2]:.4f}, moment {moments[1]:.4f}, integrals", np.round(exact(corners, pressures), 4))
    np.testing.assert_allclose([forces[2], moments[1]], seen, rtol=1e-9)
    assert name != "rectangle, even" or np.allclose(exact(corners, pressures), seen)

pyramid = model([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)])
pyramid.add_psolid(1, 1)
pyramid.add_cpyram(1, 1, [1, 2, 3, 4, 5])
pyramid.cross_reference()
mass, centre, _ = mass_properties(pyramid)
print(f"pyramid 1 high: mass {mass:.4f}, centre at {centre[2]:.4f}, in place of 0.25")
np.testing.assert_allclose([mass, centre[2]], [2 / 3, 0.5], rtol=1e-9)
END
