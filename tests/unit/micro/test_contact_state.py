"""The contact state of all models: its sums, its spots and fields, what follows from them."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, patch_means, synthesise
from patchlaw.geometry.contact_state import peaks_of
from patchlaw.micro import HalfSpaceModel, micro_model

MODULUS, RADIUS, APPROACH, CELLS = 4000.0, 2.0, 0.02, 128
X = (np.arange(CELLS) + 0.5) / CELLS
SPHERE = Surface(
    heights=-((X[:, None] - 0.5) ** 2 + (X - 0.5) ** 2) / (2.0 * RADIUS), lengths=(1.0, 1.0)
)
SPECTRUM = Spectrum(hurst=0.9, waves=(2, 8), rms_slope=0.2, seed=3)
ROUGH = synthesise(SPECTRUM, grid=(96, 96), lengths=(1.0, 1.0))
PATCHES = PatchGrid(grid=(2, 3), lengths=(1.0, 1.0))
MEANS = patch_means(ROUGH, PATCHES)
LEVEL = Control(approach=0.01)

every_kind = pytest.mark.parametrize("name", ["half-space", "elliptic", "circular-independent"])


def pressed(name, control=LEVEL):
    model = micro_model(name, ROUGH, contact_modulus=MODULUS)
    return model.press(control, patches=PATCHES, mean_heights=MEANS)


@every_kind
def test_patches_and_spots_sum_to_the_whole(name):
    state, spots = pressed(name), pressed(name).spots
    for sums, whole in (
        (state.patch_force, state.force),
        (state.patch_area, state.contact_area),
        (state.patch_contacts, state.contacts),
        (spots.force, state.force),
        (spots.area, state.contact_area),
    ):
        assert sums.sum() == pytest.approx(whole, rel=1e-12)
    assert state.patch_separation.mean() == pytest.approx(state.mean_separation)
    assert state.patch_pressure.mean() == pytest.approx(state.mean_pressure)
    assert len(spots) == state.contacts > 2 and spots.place.shape == (len(spots), 2)
    assert state.peak_pressure == spots.peak_pressure.max()
    assert (spots.peak_pressure > spots.force / spots.area).all()


@every_kind
def test_derived_quantities(name):
    state = pressed(name)
    assert state.mean_pressure == pytest.approx(state.force)  # on 1 mm²
    expected = state.contact_area_fraction * 0.2 * MODULUS / state.mean_pressure
    assert state.kappa(0.2, MODULUS) == pytest.approx(expected)
    assert state.patch_closure + state.patch_displacement == pytest.approx(0.01)
    highest = ROUGH.highest - ROUGH.mean_height
    assert state.mean_separation > highest - 0.01  # displacements open the gap


@every_kind
def test_nothing_in_contact(name):
    state = pressed(name, Control(approach=-1e-3))
    assert state.peak_pressure == 0.0 and len(state.spots) == 0
    assert np.isnan(state.kappa(0.2, MODULUS))
    assert state.mean_separation == pytest.approx(ROUGH.highest - ROUGH.mean_height + 1e-3)


def test_summary_is_small_and_asperities_have_no_pressures():
    state, cells = pressed("elliptic"), pressed("half-space").summary()
    assert cells.pressure is None and cells.spots is None
    assert cells.force == pressed("half-space").force
    with pytest.raises(InputError, match="these contacts are not made of cells"):
        _ = state.pressures


def test_sphere_has_the_spot_and_the_gap_of_hertz():
    model = HalfSpaceModel(surface=SPHERE, contact_modulus=MODULUS, highest=0.0)
    state = model.press(Control(approach=APPROACH))
    spots, radius = state.spots, np.sqrt(RADIUS * APPROACH)
    # 25 cells along the radius of the contact; measured: 3e-4, 6e-4, 2e-3
    assert spots.peak_pressure == pytest.approx([2 * MODULUS * radius / (np.pi * RADIUS)], rel=1e-3)
    assert spots.force == pytest.approx([4 / 3 * MODULUS * radius * APPROACH], rel=2e-3)
    assert spots.area == pytest.approx([np.pi * radius**2], rel=1e-2)
    assert np.abs(spots.place - 0.5).max() <= 1.0 / CELLS  # a cell beside the centre
    assert state.peak_pressure == state.pressure.max()
    far = np.hypot(state.x[:, None] - 0.5, state.y - 0.5)
    outside = far > 1.1 * radius
    r = far[outside]
    # Johnson 1985, eq. 3.42a
    displaced = (2 * radius**2 - r**2) * np.arcsin(radius / r) + radius * np.sqrt(r**2 - radius**2)
    gap = displaced / (np.pi * RADIUS) + r**2 / (2 * RADIUS) - APPROACH
    np.testing.assert_allclose(state.gap[outside], gap, atol=2e-3 * APPROACH)
    assert np.abs(state.gap[state.in_contact]).max() <= state.residual * APPROACH


@pytest.mark.parametrize("name", ["elliptic", "circular", "elliptic-independent"])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), None])
def test_stiffness_of_asperities_is_the_derivative_of_the_force(name, tilt):
    model = micro_model(name, ROUGH, contact_modulus=MODULUS)
    state, step = model.press(Control(approach=0.01, tilt=tilt)), 1e-6
    stiffness = model.stiffness(state, turns=tilt is None).approach
    ahead, back = (
        model.press(Control(approach=0.01 + change, tilt=tilt), start=state.guess).force
        for change in (step, -step)
    )
    # contacts converge to 1e-10 and free planes to 1e-9 of the largest load
    rel = 1e-6 if tilt else 1e-5
    assert stiffness == pytest.approx((ahead - back) / (2.0 * step), rel=rel)


def test_peaks_are_the_largest_of_each_group():
    group, values = np.array([1, 0, 1, 2, 0]), np.array([3.0, 1.0, 5.0, 2.0, 4.0])
    assert peaks_of(group, values, 3).tolist() == [4, 2, 3]
