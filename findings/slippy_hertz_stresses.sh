#!/usr/bin/env bash
# slippy 0.5.2: greatest stresses below spheres and lines, contact.hertz_full.
#
# Guess: at Poisson's ratio 0.3 the greatest shear stress below a sphere is 0.310 of the greatest pressure at 0.481 radii, that below a line
# 0.300 at 0.786 half widths, and its von Mises stress 0.558 at 0.704 (Johnson 1985, sections 3.4 and 4.2; Green 2005, which slippy names).
# Seen: 0.460, 0.067 and 1.795, at 0.481, 1.265 and 0.704. The stresses along the axis that stress_z_axis_b_f returns are right, and their greatest
# difference gives the 0.310. The function stress_f of a line returns thousands of times the pressure, by the length of the half width. Of
# spheres take the axis, of lines the pressure alone.
set -euo pipefail
ALONE=slippy==0.5.2 # with the last packages that it runs with
source "$(dirname "$0")/packages.sh" numpy==1.26.4 scipy==1.11.4 matplotlib==3.8.4 numba==0.61.2 tinydb==4.8.2 sympy==1.14.0
python - <<'END' 2>warnings.log
import numpy as np

np.float, np.product = float, np.prod  # names that slippy takes from an older numpy
from slippy.contact import hertz_full

NU, FLAT = 0.3, float("inf")
z = np.linspace(0.01, 2, 200_000)  # depth over the contact's radius or half width


def greatest(stress):
    """Return the greatest of these and its depth."""
    at = np.abs(stress).argmax()
    return abs(stress[at]), z[at]


sphere = hertz_full(0.01, FLAT, 200e9, NU, 50.0)
radius, pressure = sphere["contact_radii"][0], sphere["max_pressure"]
down = -1 / (1 + z**2)
along = -(1 + NU) * (1 - z * np.arctan(1 / z)) - down / 2
axis = sphere["stress_z_axis_b_f"][0](z * radius)
np.testing.assert_allclose(axis["sigma_z"] / pressure, down, rtol=1e-9)
np.testing.assert_allclose(axis["sigma_r"] / pressure, along, atol=1e-9)
found = sphere["max_shear_stress_b"][0] / pressure, float(sphere["max_shear_depth_b"][0][0]) / radius
print("sphere: shear stress", np.round(found, 4), "true", np.round(greatest((down - along) / 2), 4))
np.testing.assert_allclose(found, (0.4600, 0.4809), atol=2e-4)
np.testing.assert_allclose(greatest((down - along) / 2), (0.3100, 0.4809), atol=2e-4)

line = hertz_full([0.01, FLAT], [FLAT, FLAT], 200e9, NU, 5e3, line=True)
half, pressure = line["contact_radii"][0], line["max_pressure"]
root = np.sqrt(1 + z**2)
down, along = -1 / root, 2 * z - (1 + 2 * z**2) / root
across = NU * (down + along)
mises = np.sqrt(((down - along) ** 2 + (along - across) ** 2 + (across - down) ** 2) / 2)
shear = line["max_shear_stress_b"][0] / pressure, float(line["depth_of_max_shear"][0][0]) / half
found = line["max_von_mises_stress"][0] / pressure, line["max_von_mises_depth"][0] / half
print("line: shear stress", np.round(shear, 4), "true", np.round(greatest((down - along) / 2), 4))
print("line: von Mises", np.round(found, 4), "true", np.round(greatest(mises), 4))
np.testing.assert_allclose(shear, (0.0668, 1.2652), atol=2e-4)
np.testing.assert_allclose(greatest((down - along) / 2), (0.3003, 0.7862), atol=2e-4)
np.testing.assert_allclose(found, (1.7950, 0.7036), atol=2e-4)
np.testing.assert_allclose(greatest(mises), (0.5575, 0.7043), atol=2e-4)
within = line["stress_f"](np.zeros(1), np.array([0.786 * half]))["sigma_z"][0] / pressure
print(f"line: stress {within:.5g} of the pressure at 0.786 half widths, true -0.786")
assert within < -1e4
END
