"""Every model at one load step: the same as its curve, with any control, from any start."""

import numpy as np
import pytest

from geometry import Control, InputError, PatchGrid, Spectrum, patch_means, synthesise
from micro import MODEL_NAMES, HalfSpaceModel, RigidPlane, micro_model

SPECTRUM = Spectrum(hurst=0.9, waves=(2, 6), rms_slope=0.2, seed=5)
SURFACE = synthesise(SPECTRUM, grid=(48, 40), lengths=(1.0, 0.9))
OTHER = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=6), grid=(24, 20), lengths=(1.0, 0.9)
)
PATCHES = PatchGrid(grid=(3, 2), lengths=SURFACE.lengths)
MEANS = patch_means(SURFACE, PATCHES)
APPROACH, TILT = 8e-3, (4e-3, -3e-3)

KINDS = [*((name, "summit") for name in MODEL_NAMES), ("elliptic", "contact")]


@pytest.fixture(params=KINDS, ids="-".join)
def model(request):
    name, curvature = request.param
    return micro_model(name, SURFACE, contact_modulus=4000.0, curvature=curvature)


def press(model, *, start=None, **given):
    control = Control(**{"tilt": (0.0, 0.0)} | (given or {"approach": APPROACH}))
    return model.press(control, patches=PATCHES, mean_heights=MEANS, start=start)


def same(one, other, rel):
    assert one.force[0] == pytest.approx(other.force[0], rel=rel)
    assert one.patch_force == pytest.approx(other.patch_force, rel=10 * rel, abs=rel)
    assert one.moment == pytest.approx(other.moment, abs=10 * rel * other.force[0])
    assert one.patch_separation == pytest.approx(other.patch_separation, abs=1e-8)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
def test_is_a_row_of_the_curve(model, tilt):
    row = model.respond([APPROACH], patches=PATCHES, mean_heights=MEANS, tilt=tilt)
    assert row.force[0] > 0.0
    found = press(model, approach=APPROACH, tilt=tilt)
    # each model's fits of contacts and curvatures stop at 1e-6 of the approach at worst
    same(found.response, row, rel=1e-6 if "curvature" in model.name else 1e-12)
    assert found.plane == RigidPlane.above(SURFACE, APPROACH, tilt)


def test_a_vanishing_tilt_changes_nothing(model):
    level = press(model).response
    # 1e-12 of tilt are 1e-10 of the approach at the border
    same(press(model, approach=APPROACH, tilt=(1e-12, 0.0)).response, level, rel=1e-9)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
def test_a_given_force_is_the_same_contact(model, tilt):
    by_approach = press(model, approach=APPROACH, tilt=tilt).response
    found = press(model, force=by_approach.force[0], tilt=tilt)
    assert found.response.force == pytest.approx(by_approach.force, rel=1e-8)
    # fits of curvatures and islands stop at 1e-6 of the approach
    assert found.plane.approach == pytest.approx(APPROACH, rel=3e-6)
    assert found.plane.tilt == tilt


def test_a_plane_free_to_turn_has_no_moment(model):
    found = press(model, force=0.5, tilt=None)
    assert found.response.force[0] == pytest.approx(0.5, rel=1e-8)
    half = 0.5 * np.hypot(*SURFACE.lengths)
    assert np.abs(found.response.moment[0]).max() < 1e-8 * 0.5 * half
    plane = found.plane
    assert np.abs(plane.tilt).min() > 1e-6
    # the same plane prescribed carries the same; curvatures and islands are known to 1e-6
    fixed = press(model, approach=plane.approach, tilt=plane.tilt).response
    assert fixed.force[0] == pytest.approx(0.5, rel=2e-5)


@pytest.mark.parametrize("name", [name for name in MODEL_NAMES if name != "islands"])
def test_a_plane_may_turn_at_a_given_approach(name):
    """Islands too, by the same search for the plane, but they take their time."""
    model = micro_model(name, SURFACE, contact_modulus=4000.0)
    found = press(model, approach=APPROACH, tilt=None)
    assert found.plane.approach == APPROACH
    force = found.response.force[0]
    assert np.abs(found.response.moment[0]).max() < 1e-8 * force * 0.5 * np.hypot(*SURFACE.lengths)
    same_force = press(model, force=force, tilt=None)
    # moments vanish to 1e-9 of the force, approaches are those of solutions to 1e-8
    assert same_force.plane.approach == pytest.approx(APPROACH, rel=1e-7)


def test_without_force_the_plane_touches(model):
    """Under the tilt prescribed, which lets no coupling choose another point than the model."""
    found = press(model, force=0.0, tilt=TILT)
    assert found.response.force[0] < 1e-12  # rounding of the heights
    assert found.plane.tilt == TILT
    assert press(model, approach=found.plane.approach - 1e-9, tilt=TILT).response.force[0] == 0.0
    assert press(model, approach=found.plane.approach + 1e-9, tilt=TILT).response.force[0] > 1e-12


def test_goes_on_from_a_plane_nearby(model):
    first = press(model)
    again = press(model, start=first.start).response
    # each solution stops at its own tolerance, at worst 1e-6 of the approach
    same(again, first.response, rel=1e-6)
    assert again.iterations[0] <= first.response.iterations[0]
    nearby = press(model, approach=1.01 * APPROACH, start=first.start)
    same(nearby.response, press(model, approach=1.01 * APPROACH).response, rel=1e-5)


@pytest.mark.parametrize("name", [name for name in MODEL_NAMES if name != "islands"])
def test_the_same_plane_again_costs_nothing(name):
    model = micro_model(name, SURFACE, contact_modulus=4000.0)
    first = press(model)
    # the half-space evaluates the displacement once to see that nothing is left to do
    assert press(model, start=first.start).response.iterations[0] <= 1


@pytest.mark.parametrize(
    "given", [{"approach": 1.0001 * APPROACH}, {"approach": APPROACH, "tilt": (1e-6, 1e-6)}]
)
def test_a_slightly_other_plane_costs_less_than_a_start_from_nothing(given):
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    warm = press(model, start=press(model).start, **given).response
    cold = press(model, **given).response
    assert warm.iterations[0] < 0.75 * cold.iterations[0]
    # both residuals are 1e-8 of the approach, and bound the error of the force
    assert warm.force == pytest.approx(cold.force, rel=5e-8)


def test_cells_that_reach_out_of_a_patch_alone_stay_in_it():
    """Borders cut cells here; what reaches beyond the one patch counts for it all the same."""
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    patches = PatchGrid(grid=(5, 3), lengths=SURFACE.lengths)
    control = Control(approach=4 * APPROACH)
    for index in range(patches.count):
        alone, patch = model.of_patch(patches, index)
        found = alone.press(control, patches=patch, mean_heights=np.zeros(1)).response
        assert found.force[0] > 0.0
        assert found.patch_force[0] == pytest.approx(found.force, rel=1e-13)
        assert found.patch_contact_area[0] == pytest.approx(found.contact_area, rel=1e-13)


def test_separation_counts_the_tilt(model):
    response = press(model, approach=APPROACH, tilt=TILT).response
    # the middle of the first patch lies 1/3 and 0.225 mm before the middle of the surface
    nearer = APPROACH - TILT[0] / 3.0 - TILT[1] * 0.225
    expected = SURFACE.highest - nearer - MEANS[0] + response.patch_displacement[0, 0]
    assert response.patch_separation[0, 0] == pytest.approx(expected, abs=1e-12)


def test_moment_of_cells():
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    found = press(model, approach=APPROACH, tilt=TILT).response
    state = model.solve(APPROACH, tilt=TILT)
    dx, dy = SURFACE.spacing
    x, y = np.meshgrid(SURFACE.x - 0.5, SURFACE.y - 0.45, indexing="ij")
    expected = [(state.pressure * arm).sum() * dx * dy for arm in (x, y)]
    assert found.moment[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", MODEL_NAMES)
def test_moment_turns_with_the_surface(name):
    """Mirrored along x the moment about the centre changes its sign along x alone."""
    mirrored = type(SURFACE)(heights=SURFACE.heights[::-1], lengths=SURFACE.lengths)
    results = [
        micro_model(name, surface, contact_modulus=4000.0)
        .respond([APPROACH], patches=PATCHES, mean_heights=MEANS)
        .moment[0]
        for surface in (SURFACE, mirrored)
    ]
    # the spline through periodic and through free heights differs at the border
    assert results[1] == pytest.approx(results[0] * [-1.0, 1.0], rel=0.02)


@pytest.mark.parametrize(
    ("approaches", "problem"),
    [
        ([], "at least one approach"),
        ([[1e-3, 2e-3]], r"\(1, 2\): the approaches are no list"),
        (["deep"], r"\['deep'\]: the approaches are no numbers"),
        ([1e-3, np.nan], "nan: the approach must be finite"),
    ],
)
def test_refuses_approaches_that_are_no_finite_list(model, approaches, problem):
    with pytest.raises(InputError, match=problem):
        model.respond(approaches, patches=PATCHES, mean_heights=MEANS)


@pytest.mark.parametrize(
    ("means", "problem"),
    [
        (np.full(PATCHES.count, np.nan), "a mean height is not finite"),
        (MEANS[:-1], r"\(5,\): every patch needs one mean height \(allowed: shape \(6,\)\)"),
        (np.append(MEANS, 0.0), r"\(7,\): every patch needs one mean height"),
        (MEANS[:, None], r"\(6, 1\): every patch needs one mean height"),
        (MEANS[0], r"\(\): every patch needs one mean height"),
        (["low"] * PATCHES.count, "the mean heights are no numbers"),
    ],
    ids=["nan", "too few", "too many", "column", "one", "words"],
)
def test_refuses_mean_heights_that_do_not_fit(model, means, problem):
    with pytest.raises(InputError, match=problem):
        model.respond([APPROACH], patches=PATCHES, mean_heights=means)
    with pytest.raises(InputError, match=problem):
        model.press(Control(approach=APPROACH), patches=PATCHES, mean_heights=means)


def test_refuses_to_start_from_other_asperities():
    model = micro_model("elliptic", SURFACE, contact_modulus=4000.0)
    other = micro_model("elliptic", OTHER, contact_modulus=4000.0)
    start = other.press(Control(approach=APPROACH), patches=PATCHES, mean_heights=MEANS).start
    with pytest.raises(InputError, match="the solution to start from is of other asperities"):
        press(model, start=start)


def test_refuses_to_start_from_another_grid():
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    other = HalfSpaceModel(surface=OTHER, contact_modulus=4000.0)
    start = other.press(Control(approach=APPROACH), patches=PATCHES, mean_heights=MEANS).start
    with pytest.raises(InputError, match=r"\(24, 20\): the solution to start from is of another"):
        press(model, start=start)
