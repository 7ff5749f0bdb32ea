"""What every model does with degenerate surfaces and loads: a defined answer or a clear error."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.along import respond

from patchlaw import InputError
from patchlaw.geometry import (
    Control,
    PatchGrid,
    Spectrum,
    Surface,
    find_asperities,
    patch_means,
    synthesise,
)
from patchlaw.micro import MODELS, AsperityModel, HalfSpaceModel

PATCHES = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))


def models(surface):
    """Return every model of asperities on a surface."""
    asperities = find_asperities(surface)
    for kind in MODELS:
        yield AsperityModel(kind, asperities, contact_modulus=1.0)


def curve(model, surface, approaches):
    means = patch_means(surface, PATCHES)
    return respond(model, approaches, patches=PATCHES, mean_heights=means)


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.2, seed=2)
    return synthesise(spectrum, grid=(40, 40), lengths=(1.0, 1.0))


@pytest.mark.parametrize("base", [0.0, 1.0])
@pytest.mark.parametrize("grid", [31, 41, 61])
def test_flat_tops_are_no_asperities_whatever_rounding_says(grid, base):
    """Rounding made radii of 1e12 mm of them, and forces of meganewtons."""
    x = (np.arange(grid) + 0.5) / grid
    dome = -((x[:, None] - 0.5) ** 2 + (x - 0.5) ** 2) / 0.4
    ties = Surface(heights=np.round(dome, 2) + base, lengths=(1.0, 1.0))  # steps of 10 µm
    found = find_asperities(ties)
    assert len(found) == 0 and found.rejected == 1
    for model in models(ties):
        assert curve(model, ties, [5e-3]).force[0] == 0.0


def test_approach_beyond_the_range_of_heights(surface):
    span = np.ptp(surface.heights)
    for model in models(surface):
        response = curve(model, surface, span * np.array([1.0, 3.0, 30.0]))
        assert np.all(np.isfinite(response.force)) and np.all(np.diff(response.force) > 0.0)
        if not model.name.startswith(("elliptic-", "circular-")):
            assert response.overlapping_contacts[-1] > 0  # merged: the result tells so


def test_tiny_approach(surface):
    for model in models(surface):
        response = curve(model, surface, [1e-9, 1e-7])
        assert response.contacts.tolist() == [1, 1]
        # One Hertz contact: P ∝ δ^(3/2); the highest summit and z_M differ by 1e-13 mm at most.
        assert response.force[1] == pytest.approx(1e3 * response.force[0], rel=1e-2)


def test_nan_is_refused_where_it_enters(surface):
    asperities = find_asperities(surface)
    for name in ("x", "z", "angle", "border_z"):
        values = getattr(asperities, name).copy()
        values[1] = np.nan
        message = rf"nan: {name} of 1 asperities is not finite, the first at index 1"
        with pytest.raises(InputError, match=message):
            replace(asperities, **{name: values})


def test_one_summit_outside_the_patches():
    x = (np.arange(48) + 0.5) / 48
    bumps = [
        height * np.exp(-((x[:, None] - 0.4) ** 2 + (x - y) ** 2) / 0.01)
        for height, y in ((0.02, 0.3), (0.015, 0.8))
    ]
    surface = Surface(heights=sum(bumps), lengths=(1.0, 1.0))
    part = PatchGrid(grid=(1, 1), lengths=(1.0, 0.6))
    for model in (*models(surface), HalfSpaceModel(surface=surface, contact_modulus=1.0)):
        with pytest.raises(InputError, match=r"points lie outside the patches.*y ≤ 0\.6 mm"):
            respond(model, [8e-3], patches=part, mean_heights=[0.0])
        if isinstance(model, HalfSpaceModel):  # it sees what the plane reaches
            reached = respond(model, [3e-3], patches=part, mean_heights=[0.0])
            assert reached.contacts[0] == 1


def test_models_of_summits_say_where_they_end(surface):
    for model in models(surface):
        few, many = (curve(model, surface, [a]) for a in (1e-4, 3.0 * np.ptp(surface.heights)))
        assert few.contact_area_fraction[0] < 0.01 and few.warning[0] == ""
        assert many.contact_area_fraction[0] > 0.1
        assert "stands for up to" in many.warning[0]
        control = Control(approach=float(many.approach[0]))
        means = patch_means(surface, PATCHES)
        pressed = model.press(control, patches=PATCHES, mean_heights=means)
        assert pressed.warning == many.warning[0]


def test_half_space_has_an_answer_to_each(surface):
    flat = Surface(heights=np.zeros((12, 12)), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface=flat, contact_modulus=1.0)
    response = curve(model, flat, [-1e-3, 0.0, 1e-3])
    assert response.force[:2].tolist() == [0.0, 0.0] and response.force[2] > 0.0
    assert response.contact_area_fraction[2] == pytest.approx(1.0)  # every cell, no border inside
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0)
    assert not curve(model, surface, [0.0, -1.0]).force.any()
    beyond = curve(model, surface, np.ptp(surface.heights) * np.array([1.0, 3.0, 30.0]))
    assert np.all(np.isfinite(beyond.force)) and np.all(np.diff(beyond.force) > 0.0)


def test_one_contact_alone_stands_for_itself():
    x = (np.arange(41) + 0.5) / 41
    dome = -((x[:, None] - 0.5) ** 2 + (x - 0.5) ** 2) / 2.0
    surface = Surface(heights=dome, lengths=(1.0, 1.0))
    asperities = find_asperities(surface)
    model = AsperityModel("circular", asperities, contact_modulus=1.0)
    response = curve(model, surface, [5e-2])
    assert response.contact_area_fraction[0] == pytest.approx(0.05 * np.pi)  # π R δ, R = 1 mm
    assert response.warning[0] == ""


def test_plateaus_are_flat_punches_on_the_half_space():
    heights = np.zeros((40, 40))
    heights[5:9, 5:9] = heights[30:33, 20:26] = 1e-2  # two ties of many cells
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0)
    response = curve(model, surface, model.first_touch + np.array([0.0, 1e-6, 1e-3]))
    assert response.force[0] == 0.0 and response.contacts.tolist() == [0, 2, 2]
    assert response.patch_contacts[1].tolist() == [1, 0, 0, 1]
    # nothing but the plateaus touches: force ∝ indentation, whatever the shape (residual 1e-8)
    assert response.force[2] == pytest.approx(1e3 * response.force[1], rel=1e-7)
    state = model.press(Control(approach=model.first_touch + 1e-3))
    assert np.array_equal(state.in_contact, heights > 0.0)


def test_force_beyond_full_contact_of_a_periodic_surface(surface):
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0, periodic=True)
    some, more = (model.press(Control(force=force)) for force in (1.0, 10.0))
    flat = surface.highest - surface.heights.mean()  # where no gap is left
    for state in (some, more):
        assert state.in_contact.all() and state.contact_area == pytest.approx(1.0)
        assert state.approach == pytest.approx(flat, rel=1e-12)  # counts from the mean
    # once all is flat a force adds the same pressure everywhere (round-off of 10 MPa)
    np.testing.assert_allclose(more.pressure - some.pressure, 9.0, rtol=1e-11)
    with pytest.raises(InputError, match=r"no gap left at this approach.*beyond it give the force"):
        curve(model, surface, [1.01 * flat])
