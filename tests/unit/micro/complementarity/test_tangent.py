"""The stiffness of a solved contact: Hertz's, and finite differences of the solved force."""

import numpy as np
import pytest

from patchlaw.geometry import Control, Material, Spectrum, Surface, synthesise
from patchlaw.micro import FiniteSlopes, HalfSpaceModel

MODULUS = 4092.0
SPECTRUM = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.1, seed=7)
ROUGH = synthesise(SPECTRUM, grid=(48, 48), lengths=(1.0, 1.0))
SLOPES = FiniteSlopes(ROUGH, Material(young_modulus=4000.0, poisson_ratio=0.15))
LEVEL, TURNING = (0.0, 0.0), None


def model(**terms):
    return HalfSpaceModel(surface=ROUGH, contact_modulus=MODULUS, tolerance=1e-12, **terms)


@pytest.mark.parametrize(
    ("terms", "control"),
    [
        ({}, Control(approach=0.006, tilt=LEVEL)),
        ({}, Control(approach=0.006, tilt=(0.002, -0.001))),
        ({}, Control(approach=0.006, tilt=TURNING)),
        ({}, Control(force=1.0, tilt=TURNING)),
        ({"periodic": True}, Control(force=1.0, tilt=LEVEL)),
        ({"slopes": (SLOPES,)}, Control(approach=0.006, tilt=LEVEL)),
        ({"slopes": (SLOPES,)}, Control(approach=0.006, tilt=TURNING)),
    ],
)
def test_stiffness_is_the_derivative_of_the_force(terms, control):
    contact = model(**terms)
    state = contact.press(control)
    turns = control.tilt is None
    found = contact.stiffness(state, turns=turns)
    # small enough for the same cells in contact, over which the force is linear
    step = 1e-4 * state.approach
    near = [
        contact.press(
            Control(approach=state.approach + change, tilt=control.tilt), start=state.guess
        )
        for change in (step, -step)
    ]
    for other in near:
        np.testing.assert_array_equal(other.in_contact, state.in_contact)
    # differences err by the residual of finite slopes, 3e-9 of the approach, over the step
    slopes = "slopes" in terms
    expected = (near[0].force - near[1].force) / (2.0 * step)
    assert found.approach == pytest.approx(expected, rel=1e-6 if slopes else 3e-7)
    closed = near[1].mean_separation - near[0].mean_separation
    expected = (near[0].force - near[1].force) / closed
    # single precision, and that finite slopes lack the last 3e-9 in mean gaps too
    assert found.interface == pytest.approx(expected, rel=1e-5 if slopes else 2e-6)
    assert 0 < found.iterations < state.iterations  # less than what the contact itself took


def test_stiffness_of_a_sphere_is_that_of_hertz():
    radius, approach, cells = 2.0, 0.02, 128
    x = (np.arange(cells) + 0.5) / cells - 0.5
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2) / (2.0 * radius), lengths=(1.0, 1.0))
    contact = HalfSpaceModel(surface=sphere, contact_modulus=MODULUS)
    stiffness = contact.stiffness(contact.press(Control(approach=approach)), turns=False).approach
    # 25 cells along the contact's radius: 8e-4 were measured
    assert stiffness == pytest.approx(2.0 * MODULUS * np.sqrt(radius * approach), rel=2e-3)


def test_stiffness_is_zero_without_contact():
    contact = model()
    assert contact.stiffness(contact.press(Control(approach=-1e-3)), turns=False)[:3] == (
        0.0,
        0.0,
        1,
    )


def test_stiffness_of_a_period_in_full_contact_is_not_known():
    """Further pressures, which are equal, do not displace a surface from its mean."""
    contact = model(periodic=True)
    full = contact.press(Control(force=2000.0))
    assert full.in_contact.all()
    assert contact.stiffness(full, turns=False)[:2] == (None, None)
