"""Records of single Hertz contacts."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.micro import HertzContact


def test_sphere():
    E, R, w = 3000.0, 0.4, 0.002
    sphere = HertzContact(contact_modulus=E, radius_major=R, radius_minor=R, indentation=w)
    assert sphere.force == pytest.approx(4 / 3 * E * np.sqrt(R) * w**1.5)
    assert sphere.area == pytest.approx(np.pi * R * w)
    assert (sphere.semi_major, sphere.semi_minor) == pytest.approx((np.sqrt(R * w),) * 2)
    assert sphere.peak_pressure == pytest.approx(2 * E / np.pi * np.sqrt(w / R))


def test_ellipse_is_consistent():
    contact = HertzContact(
        contact_modulus=4000.0, radius_major=1.0, radius_minor=0.1, indentation=[1e-4, 1e-2]
    )
    assert contact.area == pytest.approx(np.pi * contact.semi_major * contact.semi_minor)
    assert contact.peak_pressure == pytest.approx(1.5 * contact.force / contact.area)
    ratio = contact.semi_minor / contact.semi_major
    assert ratio == pytest.approx(0.22225, abs=5e-6)  # 5 digits; see test_hertz_eccentricity


def test_no_indentation_no_contact():
    contact = HertzContact(
        contact_modulus=1.0, radius_major=2.0, radius_minor=1.0, indentation=[0.0, 0.1]
    )
    for values in (contact.force, contact.area, contact.peak_pressure, contact.semi_major):
        assert values[0] == 0.0 < values[1]
    assert contact.pressure(0.0, 0.0)[0] == 0.0
    assert contact.displacement(0.3, 0.0)[0] == 0.0


def test_fields_broadcast():
    contact = HertzContact(
        contact_modulus=1.0, radius_major=[2.0, 1.0], radius_minor=1.0, indentation=0.1
    )
    x, y = np.zeros((5, 1, 1)), np.zeros((3, 1))
    assert contact.pressure(x, y).shape == contact.displacement(x, y).shape == (5, 3, 2)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"contact_modulus": 0.0}, "0.0: the contact modulus must be positive"),
        ({"contact_modulus": np.inf}, "the contact modulus must be positive"),
        ({"indentation": [0.1, -0.2]}, "-0.2: an indentation is negative"),
        ({"indentation": np.nan}, "an indentation is negative or not a number"),
        ({"radius_minor": 3.0}, "these principal radii do not describe a summit"),
    ],
)
def test_refuses_contacts(change, problem):
    good = {"contact_modulus": 1.0, "radius_major": 2.0, "radius_minor": 1.0, "indentation": 0.1}
    with pytest.raises(InputError, match=problem):
        HertzContact(**(good | change))
