"""Every model under one plane: the same as its curve, with any sag, from any start."""

import numpy as np
import pytest

from geometry import InputError, PatchGrid, Spectrum, patch_means, synthesise
from micro import MODEL_NAMES, HalfSpaceModel, RigidPlane, micro_model

SPECTRUM = Spectrum(hurst=0.9, waves=(2, 6), rms_slope=0.2, seed=5)
SURFACE = synthesise(SPECTRUM, grid=(48, 40), lengths=(1.0, 0.9))
PATCHES = PatchGrid(grid=(3, 2), lengths=SURFACE.lengths)
MEANS = patch_means(SURFACE, PATCHES)
APPROACH, TILT = 8e-3, (4e-3, -3e-3)

KINDS = [*((name, "summit") for name in MODEL_NAMES), ("elliptic", "contact")]


@pytest.fixture(params=KINDS, ids="-".join)
def model(request):
    name, curvature = request.param
    return micro_model(name, SURFACE, contact_modulus=4000.0, curvature=curvature)


def press(model, *, approach=APPROACH, tilt=(0.0, 0.0), sag=None, start=None):
    plane = RigidPlane.above(SURFACE, approach, tilt, sag)
    return model.press(plane, patches=PATCHES, mean_heights=MEANS, start=start)


def same(one, other, rel):
    assert one.force[0] == pytest.approx(other.force[0], rel=rel)
    assert one.patch_force == pytest.approx(other.patch_force, rel=10 * rel, abs=rel)
    assert one.moment == pytest.approx(other.moment, abs=10 * rel * other.force[0])
    assert one.patch_separation == pytest.approx(other.patch_separation, abs=1e-8)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
def test_is_a_row_of_the_curve(model, tilt):
    row = model.respond([APPROACH], patches=PATCHES, mean_heights=MEANS, tilt=tilt)
    assert row.force[0] > 0.0
    same(press(model, tilt=tilt).response, row, rel=1e-12)


def test_sag_is_a_plane_that_came_less_near(model):
    """A constant and a linear sag are a lower and a tilted plane: no other code is involved."""

    def sag(x, y):
        return 2e-3 - TILT[0] * (x - 0.5) - TILT[1] * (y - 0.45)

    direct = press(model, approach=APPROACH - 2e-3, tilt=TILT).response
    # a sagging plane reaches the models through other sums: equal up to rounding alone
    same(press(model, sag=sag).response, direct, rel=1e-9)


def test_a_constant_sag_is_a_lower_plane(model):
    """Nothing leans, so neither may the border of a periodic surface seem another."""
    level = press(model, approach=APPROACH - 2e-3).response
    sagging = press(model, sag=lambda x, y: 2e-3 + 0.0 * np.add(x, y)).response
    same(sagging, level, rel=1e-9)  # each model's own rounding, of heights and approaches


def test_a_vanishing_tilt_changes_nothing(model):
    level = press(model).response
    # 1e-12 of tilt are 1e-10 of the approach at the border
    same(press(model, tilt=(1e-12, 0.0)).response, level, rel=1e-9)


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


def test_a_slightly_other_sag_costs_less_than_a_start_from_nothing():
    def sag(x, y):
        return 1e-6 * np.cos(3.0 * x) * np.cos(2.0 * y)

    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    warm = press(model, sag=sag, start=press(model).start).response
    cold = press(model, sag=sag).response
    assert warm.iterations[0] < 0.75 * cold.iterations[0]
    # both residuals are 1e-8 of the approach, and bound the error of the force
    assert warm.force == pytest.approx(cold.force, rel=5e-8)


def test_cells_that_reach_out_of_a_patch_alone_stay_in_it():
    """Borders cut cells here; what reaches beyond the one patch counts for it all the same."""
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    patches = PatchGrid(grid=(5, 3), lengths=SURFACE.lengths)
    plane = RigidPlane.above(SURFACE, 4 * APPROACH)
    for index in range(patches.count):
        alone, patch = model.of_patch(patches, index)
        found = alone.press(plane, patches=patch, mean_heights=np.zeros(1)).response
        assert found.force[0] > 0.0
        assert found.patch_force[0] == pytest.approx(found.force, rel=1e-13)
        assert found.patch_contact_area[0] == pytest.approx(found.contact_area, rel=1e-13)


def test_separation_counts_the_sag(model):
    def sag(x, y):
        return 1e-3 * np.cos(np.pi * x / SURFACE.lengths[0]) + 0.0 * y

    response = press(model, sag=sag).response
    low, high = 0.0, SURFACE.lengths[0] / 3
    mean = 1e-3 * SURFACE.lengths[0] / np.pi * (np.sin(np.pi / 3) - 0.0) / (high - low)
    expected = SURFACE.highest - APPROACH + mean - MEANS[0] + response.patch_displacement[0, 0]
    assert response.patch_separation[0, 0] == pytest.approx(expected, abs=1e-9)


def test_moment_of_cells():
    model = HalfSpaceModel(surface=SURFACE, contact_modulus=4000.0)
    found = press(model, tilt=TILT)
    dx, dy = SURFACE.spacing
    x, y = np.meshgrid(SURFACE.x - 0.5, SURFACE.y - 0.45, indexing="ij")
    pressure = found.start
    expected = [(pressure * arm).sum() * dx * dy for arm in (x, y)]
    assert found.response.moment[0] == pytest.approx(expected, rel=1e-12)


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


def test_refuses_mean_heights_that_are_no_numbers(model):
    with pytest.raises(InputError, match="a mean height is not finite"):
        model.respond([APPROACH], patches=PATCHES, mean_heights=np.full(PATCHES.count, np.nan))


def test_refuses_to_start_from_other_asperities():
    model = micro_model("elliptic", SURFACE, contact_modulus=4000.0)
    plane = RigidPlane.above(SURFACE, APPROACH)
    with pytest.raises(InputError, match=r"\(1,\): the solution to start from is of other"):
        model.press(plane, patches=PATCHES, mean_heights=MEANS, start=np.zeros(1))
