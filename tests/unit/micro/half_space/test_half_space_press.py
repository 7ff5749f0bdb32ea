"""Every model at a load step: the same as its curve, and what is prescribed, from any start."""

import pickle

import numpy as np
import pytest
from helpers.along import respond

from patchlaw import InputError, NotConverged
from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, patch_means, synthesise
from patchlaw.micro import MODEL_NAMES, HalfSpaceModel, micro_model, press_along

SPECTRUM = Spectrum(hurst=0.9, waves=(2, 6), rms_slope=0.2, seed=5)
SURFACE = synthesise(SPECTRUM, grid=(48, 40), lengths=(1.0, 0.9))
PATCHES = PatchGrid(grid=(3, 2), lengths=SURFACE.lengths)
MEANS = patch_means(SURFACE, PATCHES)
APPROACH, TILT = 8e-3, (4e-3, -3e-3)
HALF = 0.5 * np.hypot(*SURFACE.lengths)


@pytest.fixture(params=MODEL_NAMES)
def model(request):
    return micro_model(request.param, SURFACE, contact_modulus=4000.0)


def press(model, *, start=None, **given):
    given = given or {"approach": APPROACH}
    return model.press(Control(**given), patches=PATCHES, mean_heights=MEANS, start=start)


def same(one, other, rel):
    assert one.force == pytest.approx(other.force, rel=rel)
    assert one.patch_force == pytest.approx(other.patch_force, rel=10 * rel, abs=rel)
    assert one.moment == pytest.approx(other.moment, abs=10 * rel * other.force)
    assert one.patch_separation == pytest.approx(other.patch_separation, abs=1e-8)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
def test_a_path_is_made_of_states(model, tilt):
    approaches = APPROACH * np.array([0.5, -0.1, 1.0, 0.25, 0.5])  # any order, repeated
    path = press_along(model, approaches, patches=PATCHES, mean_heights=MEANS, tilt=tilt)
    assert [state.approach for state in path] == approaches.tolist()
    for state in path:
        alone = press(model, approach=state.approach, tilt=tilt)
        same(state, alone, rel=1e-7)  # residuals of 1e-8 of the approach
        assert state.contacts == alone.contacts


def test_a_model_can_be_sent_to_other_ranks_after_it_was_pressed(model):
    found = press(model, force=0.5, tilt=None)
    sent = pickle.loads(pickle.dumps(model))
    same(press(sent, force=0.5, tilt=None), found, rel=1e-12)  # the same arithmetic


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
def test_force_finds_the_plane_that_gave_it(model, tilt):
    force = press(model, approach=APPROACH, tilt=tilt).force
    found = press(model, force=force, tilt=tilt)
    assert found.force == pytest.approx(force, rel=1e-8)
    # forces of asperities are met to 1e-9; those of the half-space to its residual of 1e-6
    assert found.plane.approach == pytest.approx(APPROACH, rel=1e-7)
    assert found.plane.tilt == tilt


@pytest.mark.parametrize("share", [1.0, 1e-4])
def test_free_plane_has_no_moment(model, share):
    """Also where three contacts bear hardly anything."""
    force = share * press(model).force
    found = press(model, force=force, tilt=None)
    assert found.force == pytest.approx(force, rel=1e-8)
    assert np.abs(found.moment).max() <= 1e-8 * HALF * force
    there = press(model, approach=found.plane.approach, tilt=found.plane.tilt)
    assert there.force == pytest.approx(force, rel=1e-6)  # the residual of the half-space


def test_a_plane_that_turns_bears_the_prescribed_moment(model):
    force = press(model).force
    moment = 0.1 * HALF * force * np.array([1.0, -0.6])
    found = press(model, force=force, tilt=None, moment=tuple(moment))
    assert found.moment == pytest.approx(moment, rel=1e-7)


def test_a_force_beside_the_face_is_refused_in_words():
    model = HalfSpaceModel(SURFACE, contact_modulus=4000.0)
    with pytest.raises(NotConverged, match="let the force act within the face, by smaller moments"):
        press(model, force=1.0, tilt=None, moment=(0.51 * SURFACE.lengths[0], 0.0))


def test_plane_turns_under_a_given_approach(model):
    found = press(model, approach=APPROACH, tilt=None)
    assert found.plane.approach == APPROACH
    force = found.force
    assert 0.0 < force < press(model).force  # it gives way
    assert np.abs(found.moment).max() <= 1e-8 * HALF * force


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
def test_no_force_is_first_touch(model, tilt):
    """The plane stands where its slopes let it touch first, which is above no level plane."""
    found = press(model, force=0.0, tilt=tilt)
    touch = found.plane.approach
    assert found.plane.tilt == tilt
    assert found.force < 1e-15
    nearer, above = (press(model, approach=touch + step, tilt=tilt).force for step in (1e-6, -1e-6))
    assert nearer > 0.0
    assert above == 0.0
    if tilt == (0.0, 0.0):
        assert touch == pytest.approx(model.first_touch, abs=1e-12)


def test_unloading_a_free_plane_keeps_its_slopes_without_force(model):
    loaded = press(model, force=1.0, tilt=None)
    found = press(model, force=0.0, tilt=None, start=loaded.start)
    assert found.plane.tilt == loaded.plane.tilt


def test_goes_on_from_a_plane_nearby(model):
    first = press(model)
    again = press(model, start=first.start)
    # each solution stops at its own tolerance, at worst 1e-6 of the approach
    same(again, first, rel=1e-6)
    assert again.iterations <= first.iterations
    nearby = press(model, approach=1.01 * APPROACH, start=first.start)
    same(nearby, press(model, approach=1.01 * APPROACH), rel=1e-5)


def test_the_same_plane_again_costs_nothing(model):
    first = press(model)
    # the half-space evaluates the displacement once to see that nothing is left to do
    assert press(model, start=first.start).iterations <= 1


def test_cells_that_reach_out_of_a_patch_alone_stay_in_it():
    """Borders cut cells here; what reaches beyond the one patch counts for it all the same."""
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    patches = PatchGrid(grid=(5, 3), lengths=SURFACE.lengths)
    for index in range(patches.count):
        alone, patch = model.of_patch(patches, index)
        control = Control(approach=4 * APPROACH)
        found = alone.press(control, patches=patch, mean_heights=np.zeros(1))
        assert found.force > 0.0
        assert found.patch_force[0] == pytest.approx(found.force, rel=1e-13)
        assert found.patch_area[0] == pytest.approx(found.contact_area, rel=1e-13)


def test_moment_of_cells():
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    state = model.press(Control(approach=APPROACH, tilt=TILT))
    found = press(model, approach=APPROACH, tilt=TILT)
    dx, dy = SURFACE.spacing
    x, y = np.meshgrid(SURFACE.x - 0.5, SURFACE.y - 0.45, indexing="ij")
    expected = [(state.pressure * arm).sum() * dx * dy for arm in (x, y)]
    assert found.moment == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("model", ["half-space", "circular"], indirect=True)  # cells, summits
@pytest.mark.parametrize(
    ("means", "problem"),
    [
        (np.full(PATCHES.count, np.nan), "every patch needs one finite mean height"),
        (MEANS[:-1], "every patch needs one finite mean height"),
        (["low"] * PATCHES.count, "not an array of real numbers"),
    ],
)
def test_refuses_mean_heights_that_do_not_fit(model, means, problem):
    with pytest.raises(InputError, match=problem):
        respond(model, [APPROACH], patches=PATCHES, mean_heights=means)
    with pytest.raises(InputError, match=problem):
        model.press(Control(approach=APPROACH), patches=PATCHES, mean_heights=means)


def test_refuses_to_start_from_other_asperities():
    model, other = (
        micro_model(
            "elliptic",
            synthesise(replace_seed, grid=(48, 40), lengths=(1.0, 0.9)),
            contact_modulus=4000.0,
        )
        for replace_seed in (SPECTRUM, Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=1))
    )
    with pytest.raises(InputError, match="the solution to start from is of other asperities"):
        press(model, start=press(other).start)


@pytest.mark.parametrize("hardness", [None, 50.0])
def test_no_cell_touches_under_no_force(hardness):
    """A tilted plane at first touch overlapped a cell by rounding: a contact of one cell."""
    dice = np.random.default_rng(5)
    for _ in range(40):
        heights = 1e-2 * dice.standard_normal(dice.integers(4, 25, 2))
        surface = Surface(heights=heights, lengths=(1.0, 1.3))
        made = HalfSpaceModel(surface, contact_modulus=1000.0, hardness=hardness)
        tilt = tuple(dice.uniform(-0.02, 0.02, 2))
        before = made.press(Control(force=5.0, tilt=tilt))
        state = made.press(Control(force=0.0, tilt=tilt), start=before.start)
        assert state.force == 0.0 and state.contact_area == 0.0 and not state.in_contact.any()
        assert state.gap.min() == pytest.approx(0.0, abs=1e-15)
