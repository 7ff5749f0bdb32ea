"""The half-space model: its calls, its states and its refusals."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.along import respond

from patchlaw import InputError, NotConverged
from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, patch_means, synthesise
from patchlaw.micro import FreeSides, HalfSpaceModel

E_STAR = 4000.0
PATCHES = PatchGrid(grid=(3, 2), lengths=(1.0, 1.0))


def rough(grid=(48, 48), **options):
    spectrum = Spectrum(hurst=0.95, waves=(2, 8), rms_slope=0.215, seed=3)
    return synthesise(spectrum, grid=grid, lengths=options.pop("lengths", (1.0, 1.0)))


@pytest.fixture(scope="module")
def surface():
    return rough()


@pytest.fixture(scope="module", params=[False, True], ids=["free", "periodic"])
def model(request, surface):
    return HalfSpaceModel(surface=surface, contact_modulus=E_STAR, periodic=request.param)


@pytest.mark.parametrize("approach", [1e-3, 2e-3, 8e-3, 18e-3])
def test_contact_conditions(model, approach):
    state = model.press(Control(approach=approach))
    assert state.residual <= model.tolerance
    assert np.all(state.pressure >= 0.0)
    # the displacement is evaluated anew on the whole grid, with another padding
    slack = 1.01 * model.tolerance * approach
    assert state.gap.min() >= -slack
    assert np.abs(state.gap[state.in_contact]).max(initial=0.0) <= slack


def test_patches_and_mean_heights_default_to_those_of_the_surface(surface):
    model = HalfSpaceModel(surface, contact_modulus=E_STAR)
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    for given, patches in (({}, whole), ({"patches": PATCHES}, PATCHES)):
        stated = {"patches": patches, "mean_heights": patch_means(surface, patches)}
        control = Control(force=1.0)
        found, expected = model.press(control, **given), model.press(control, **stated)
        assert found.patch_separation.shape == (patches.count,)
        assert np.array_equal(found.patch_separation, expected.patch_separation)
        assert np.array_equal(found.patch_force, expected.patch_force)


def test_patches_sum_to_the_whole(model):
    # 48 cells over 5 patches: cells straddle borders
    patches = PatchGrid(grid=(5, 7), lengths=(1.0, 1.0))
    means = patch_means(model.surface, patches)
    response = respond(model, [4e-3, 8e-3], patches=patches, mean_heights=means)
    assert response.patch_force.sum(axis=1) == pytest.approx(response.force, rel=1e-13)
    assert response.patch_area.sum(axis=1) == pytest.approx(response.contact_area, rel=1e-13)
    assert response.patch_contacts.sum(axis=1).tolist() == response.contacts.tolist()
    state = model.press(Control(approach=8e-3))
    mean = patch_means(Surface(heights=state.gap, lengths=(1.0, 1.0)), patches)
    # required and mean heights are averaged over the same shares of cells
    assert response.patch_separation[1] == pytest.approx(mean, rel=1e-7)
    assert response.mean_separation[1] == pytest.approx(state.gap.mean(), rel=1e-7)


def test_tilt_turns_the_plane_about_the_centre():
    model = HalfSpaceModel(surface=rough(), contact_modulus=E_STAR)
    tilt = (3e-3, -2e-3)
    state = model.press(Control(approach=6e-3, tilt=tilt))
    surface = model.surface
    plane = tilt[0] * (surface.x[:, None] - 0.5) + tilt[1] * (surface.y - 0.5)
    inclined = Surface(heights=surface.heights + plane, lengths=(1.0, 1.0))
    other = HalfSpaceModel(surface=inclined, contact_modulus=E_STAR)
    # the other surface counts its approach from a highest point of its own
    same = other.press(Control(approach=6e-3 + inclined.highest - surface.highest))
    assert same.force == pytest.approx(state.force, rel=1e-7)


@pytest.mark.parametrize("force", [1e-12, 1e-3, 1e4])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.1, 0.05)])
def test_any_force_and_tilt(force, tilt):
    model = HalfSpaceModel(surface=rough(), contact_modulus=E_STAR)
    state = model.press(Control(force=force, tilt=tilt))
    assert state.force == pytest.approx(force, rel=1e-12)  # met by scaling
    assert state.residual <= model.tolerance
    # with this tilt a cell touches before the approach at the centre is 0
    assert (state.approach < 0.0) == (tilt != (0.0, 0.0) and force < 1.0)


def test_refusals(surface):
    with pytest.raises(InputError, match="needs a periodic surface"):
        HalfSpaceModel(surface=replace(surface, periodic=False), contact_modulus=1.0, periodic=True)
    free = HalfSpaceModel(surface=surface, contact_modulus=1.0)
    other = HalfSpaceModel(surface=rough((24, 48)), contact_modulus=1.0).press(
        Control(approach=0.0)
    )
    with pytest.raises(InputError, match=r"\(24, 48\): the solution to start from is of another"):
        free.press(Control(approach=1e-3), start=other.guess)
    periodic = HalfSpaceModel(surface=surface, contact_modulus=1.0, periodic=True)
    with pytest.raises(InputError, match="a plane over a periodic surface must be level"):
        periodic.press(Control(approach=1e-3, tilt=(1e-3, 0.0)))
    with pytest.raises(InputError, match=r"no gap left at this approach.*beyond it give the force"):
        periodic.press(Control(approach=1.001 * (surface.highest - surface.mean_height)))


def test_what_cannot_be_reached_is_said(surface):
    # round-off of the convolution is about 1e-15 of the displacement
    model = HalfSpaceModel(surface=surface, contact_modulus=1.0, tolerance=1e-18)
    with pytest.raises(NotConverged, match=r"asked 1\.0e-18"):
        model.press(Control(approach=20e-3))


def test_the_approach_counts_from_the_height_given(surface):
    model = HalfSpaceModel(surface=surface, contact_modulus=E_STAR)
    above = replace(model, highest=surface.highest + 2e-3)
    assert above.reference_height == surface.highest + 2e-3
    assert above.first_touch == pytest.approx(model.first_touch + 2e-3, abs=1e-15)
    means = patch_means(surface, PATCHES)
    near, far = (
        respond(m, [d], patches=PATCHES, mean_heights=means)
        for m, d in ((model, 6e-3), (above, 8e-3))
    )
    assert far.force[0] == pytest.approx(near.force[0], rel=1e-7)  # tolerance of the solutions
    np.testing.assert_allclose(far.patch_separation, near.patch_separation, atol=1e-9)
    alone, _ = above.of_patch(PATCHES, 1)
    assert alone.reference_height == above.reference_height


@pytest.mark.parametrize("length", [0.3, 1.0, 7.3])
@pytest.mark.parametrize("grid", [6, 10, 22])
def test_patches_whose_borders_halve_cells_stand_alone(grid, length):
    """Their own cells fill them, so that a mirrored surface has mirrored patches."""
    heights = np.random.default_rng(0).standard_normal((grid, grid)) * 1e-3 * length
    patches = PatchGrid(grid=(4, 1), lengths=(length, length))
    forces = []
    for given in (heights, heights[::-1]):
        surface = Surface(heights=given, lengths=(length, length))
        model = HalfSpaceModel(surface=surface, contact_modulus=1.0)
        forces.append([])
        for index in range(patches.count):
            alone, patch = model.of_patch(patches, index)
            assert alone.surface.lengths == patch.lengths
            found = respond(alone, [0.05 * length], patches=patch, mean_heights=[0.0])
            assert found.patch_contacts[0].sum() == found.contacts[0] > 0
            forces[-1].append(found.force[0])
    # one problem, solved to 1e-8 of the approach
    np.testing.assert_allclose(forces[1][::-1], forces[0], rtol=1e-8)


def test_a_patch_alone_has_no_free_sides(surface):
    sides = FreeSides(lengths=surface.lengths, poisson_ratio=0.3, decay_length=0.5)
    model = HalfSpaceModel(surface=surface, contact_modulus=E_STAR)
    alone, expected = (replace(model, sides=each).of_patch(PATCHES, 1)[0] for each in (sides, None))
    assert alone.sides is None
    assert (
        alone.press(Control(approach=0.04)).force
        == expected.press(Control(approach=0.04)).force
        > 0.0
    )


def test_resampled_cells_count_from_the_same_height(surface):
    model = HalfSpaceModel(surface, contact_modulus=E_STAR, tolerance=1e-9)
    fine = model.resampled((96, 80))
    assert fine.surface.grid == (96, 80) and fine.tolerance == 1e-9
    assert fine.reference_height == model.reference_height == surface.highest
    # measured 0.9 %
    assert fine.press(Control(approach=8e-3)).force == pytest.approx(
        model.press(Control(approach=8e-3)).force, rel=0.03
    )


def test_iterations_do_not_grow_with_cells_that_enter_in_vain():
    waves = Spectrum(hurst=0.8, waves=(4, 128), rms_slope=0.1, seed=1)
    surface = synthesise(waves, grid=(512, 512), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=1.0, tolerance=1e-6)
    found = model.press(Control(force=0.02))
    assert 0.3 < found.in_contact.mean() < 0.4
    assert found.iterations <= 72  # 63; 89 where all cells that overlap enter at once


@pytest.mark.long
@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("waves", [32, 64])
@pytest.mark.parametrize("load", [1e-3, 5e-3, 2e-2, 0.1])
def test_a_contact_takes_a_product_a_step(load, waves, periodic):
    """On 2 to 97 % of contact; 9 to 11 are measured, and twice as many with two products a step."""
    rough = Spectrum(hurst=0.8, waves=(4, waves), rms_slope=0.1, seed=1)
    surface = synthesise(rough, grid=(256, 256), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=1.0, periodic=periodic)
    found = model.press(Control(force=load))
    assert found.residual <= 1e-8
    assert found.iterations <= 12
    if not periodic:  # the load of a period at an approach is what the inverse errs by most
        again = model.press(Control(approach=found.approach))
        assert again.iterations <= 12
        assert again.force == pytest.approx(found.force, rel=4e-8)  # both within 1e-8 in δ
