"""Spots and fields of a contact, from all models: Hertz's closed form, and their sums."""

import numpy as np
import pytest
from micro.contact_detail import peaks_of

from geometry import Control, Spectrum, Surface, synthesise
from micro import HalfSpaceModel, micro_model

MODULUS, RADIUS, APPROACH, CELLS = 4000.0, 2.0, 0.02, 128
X = (np.arange(CELLS) + 0.5) / CELLS
SPHERE = Surface(
    heights=-((X[:, None] - 0.5) ** 2 + (X - 0.5) ** 2) / (2.0 * RADIUS), lengths=(1.0, 1.0)
)
SPECTRUM = Spectrum(hurst=0.9, waves=(2, 8), rms_slope=0.2, seed=3)
ROUGH = synthesise(SPECTRUM, grid=(96, 96), lengths=(1.0, 1.0))


def test_sphere_has_the_spot_and_the_gap_of_hertz():
    model = HalfSpaceModel(surface=SPHERE, contact_modulus=MODULUS, highest=0.0)
    state = model.solve(APPROACH)
    found, radius = state.detail, np.sqrt(RADIUS * APPROACH)
    # 25 cells along the radius of the contact; measured: 3e-4, 6e-4, 2e-3
    assert found.peak_pressure == pytest.approx([2 * MODULUS * radius / (np.pi * RADIUS)], rel=1e-3)
    assert found.force == pytest.approx([4 / 3 * MODULUS * radius * APPROACH], rel=2e-3)
    assert found.area == pytest.approx([np.pi * radius**2], rel=1e-2)
    assert np.abs(found.place - 0.5).max() <= 1.0 / CELLS  # a cell beside the centre
    assert state.peak_pressure == found.pressure.max()
    far = np.hypot(found.x[:, None] - 0.5, found.y - 0.5)
    outside = far > 1.1 * radius
    r = far[outside]
    # Johnson 1985, eq. 3.42a
    displaced = (2 * radius**2 - r**2) * np.arcsin(radius / r) + radius * np.sqrt(r**2 - radius**2)
    gap = displaced / (np.pi * RADIUS) + r**2 / (2 * RADIUS) - APPROACH
    np.testing.assert_allclose(found.gap[outside], gap, atol=2e-3 * APPROACH)
    assert np.abs(found.gap[found.pressure > 0.0]).max() <= state.residual * APPROACH


@pytest.mark.parametrize("name", ["half-space", "elliptic", "circular-independent"])
def test_spots_add_up_to_the_contact(name):
    model = micro_model(name, ROUGH, contact_modulus=MODULUS)
    pressed = model.press(Control(approach=0.01, tilt=(0.0, 0.0)))
    found, response = pressed.state.detail, pressed.response
    assert len(found.force) == response.contacts[0] > 2
    assert found.force.sum() == pytest.approx(response.force[0], rel=1e-12)
    assert found.area.sum() == pytest.approx(response.contact_area[0], rel=1e-12)
    assert pressed.state.peak_pressure == found.peak_pressure.max()
    assert found.place.shape == (len(found.force), 2)
    assert (found.peak_pressure > found.force / found.area).all()


@pytest.mark.parametrize("name", ["elliptic", "circular", "elliptic-independent"])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), None])
def test_stiffness_of_asperities_is_the_derivative_of_the_force(name, tilt):
    model = micro_model(name, ROUGH, contact_modulus=MODULUS)
    pressed = model.press(Control(approach=0.01, tilt=tilt))
    stiffness = model.stiffness(pressed.state, turns=tilt is None).value
    step = 1e-6
    ahead, back = (
        model.press(Control(approach=0.01 + change, tilt=tilt), start=pressed.start).response.force
        for change in (step, -step)
    )
    # contacts converge to 1e-10 and free planes to 1e-9 of the largest load
    rel = 1e-6 if tilt else 1e-5
    assert stiffness == pytest.approx((ahead[0] - back[0]) / (2.0 * step), rel=rel)


def test_nothing_in_contact_has_no_spot():
    for name in ("half-space", "elliptic"):
        state = (
            micro_model(name, ROUGH, contact_modulus=MODULUS)
            .press(Control(approach=-1e-3, tilt=(0.0, 0.0)))
            .state
        )
        assert state.peak_pressure == 0.0
        assert len(state.detail.force) == 0


def test_peaks_are_the_largest_of_each_group():
    group, values = np.array([1, 0, 1, 2, 0]), np.array([3.0, 1.0, 5.0, 2.0, 4.0])
    assert peaks_of(group, values, 3).tolist() == [4, 2, 3]
