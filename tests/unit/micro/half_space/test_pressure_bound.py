"""Pressures bounded from above: three states of a cell, the elastic and the plastic limit."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.free_motions import approach, contact_problem

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.complementarity.active_set import ActiveSet

E_STAR = 4000.0
SURFACE = synthesise(
    Spectrum(hurst=0.8, waves=(2, 7), rms_slope=0.2, seed=3), grid=(48, 40), lengths=(1.0, 0.9)
)
ELASTIC = HalfSpaceModel(surface=SURFACE, contact_modulus=E_STAR, tolerance=1e-9)
CONTROLS = {
    "approach": Control(approach=8e-3),
    "tilted": Control(approach=8e-3, tilt=(3e-3, -2e-3)),
    "force": Control(force=1.0),
    "free tilt": Control(force=1.0, tilt=None),
    "approach, free tilt": Control(approach=8e-3, tilt=None),
}


@pytest.fixture(params=CONTROLS)
def control(request):
    return CONTROLS[request.param]


@pytest.mark.parametrize("share", [0.2, 0.6, 0.95])
def test_three_states(control, share):
    hardness = share * ELASTIC.press(control).pressure.max()
    state = replace(ELASTIC, hardness=hardness).press(control)
    full = state.pressure >= hardness * (1.0 - 1e-10)
    assert state.pressure.min() >= 0.0 and state.pressure.max() <= hardness * (1.0 + 1e-10)
    assert full.any() and (state.in_contact & ~full).any()
    # evaluated anew on the whole grid: round-off beside the residual, of the largest displacement
    slack = 1.1e-9 * ELASTIC.interference(state.plane).max()
    assert state.gap[state.pressure == 0.0].min() >= -slack
    assert np.abs(state.gap[state.in_contact & ~full]).max() <= slack
    assert np.abs(state.gap[full]).max() <= slack  # of the surface with its plastic depth
    assert state.plastic_depth[full].max() > 1e3 * slack
    assert not state.plastic_depth[~full].any()


def test_a_bound_that_nothing_reaches_changes_nothing(control):
    elastic = ELASTIC.press(control)
    for factor in (1.001, 1e6):
        state = replace(ELASTIC, hardness=factor * elastic.pressure.max()).press(control)
        assert state.pressure == pytest.approx(elastic.pressure, abs=1e-7 * elastic.pressure.max())
        assert state.force == pytest.approx(elastic.force, rel=1e-8)


def test_a_sphere_pressed_far_beyond_yield():
    """F = π a² H with a² = 2 R δ, as everything that the plane overlaps yields."""
    n, radius, approach, upper = 128, 2.0, 0.02, 1.0
    x = (np.arange(n) + 0.5) / n - 0.5
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2) / (2.0 * radius), lengths=(1.0, 1.0))
    model = HalfSpaceModel(
        surface=sphere, contact_modulus=E_STAR, highest=0.0, hardness=upper, tolerance=1e-8
    )
    force = np.pi * 2.0 * radius * approach * upper
    # cells count a circle of 36 cells' radius to 1 %; the surface moves by 4 a H/(π E*), δ/220
    assert model.press(Control(approach=approach)).force == pytest.approx(force, rel=0.02)
    assert model.press(Control(force=force)).approach == pytest.approx(approach, rel=0.02)
    elastic = replace(model, hardness=None).press(Control(approach=approach))
    assert elastic.force > 10.0 * force


@pytest.mark.parametrize("hardness", [0.05, 1.0, 50.0])
@pytest.mark.parametrize("cells", [1, 3, 192, 1728, 1919, 1920])
def test_force_that_cells_bear_at_the_bound(cells, hardness):
    """A force of n H cells: nearly all that touch yield, or all, and none tells the approach."""
    model = replace(ELASTIC, hardness=hardness)
    force = cells * hardness * float(np.prod(SURFACE.spacing))
    state = model.press(Control(force=force))
    assert state.force == pytest.approx(force, rel=1e-12)
    interference = model.interference(state.plane)
    slack = 1.1e-9 * interference.max()
    gap = state.displacement - interference
    touching = state.pressure > 0.0
    assert gap[~touching].min(initial=0.0) >= -slack
    assert gap[state.yielding].max(initial=0.0) <= slack
    assert np.abs(gap[touching & ~state.yielding]).max(initial=0.0) <= slack


def test_a_plane_clear_of_all_cells_carries_no_force():
    """A cell yields far below the plane, which rounding of a pressure on another one holds up."""
    interference, start, hardness = np.full((8, 8), -1.0), np.zeros((8, 8)), 1e-3
    interference[1, 1], start[1, 1], start[5, 5] = 0.0, 1e-18, hardness
    motions = approach((8, 8), hardness)
    problem = contact_problem(interference, (1.0, 1.0), motions, periodic=True, hardness=hardness)
    search = ActiveSet(problem, start)
    assert (interference + search.motion[0]).max() < 0.0
    assert search.residual > 0.5


@pytest.mark.parametrize("seed", [8, 9])
def test_a_far_larger_force_is_not_started_from_a_contact_that_cannot_bear_it(seed):
    spectrum = Spectrum(hurst=0.8, waves=(4, 32), rms_slope=0.1, seed=seed)
    surface = synthesise(spectrum, grid=(128, 128), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=E_STAR, periodic=True, hardness=100.0)
    little, nothing = model.solve_force(0.5), model.solve_force(2.0)
    state = model.solve_force(2.0, start=little.guess)
    assert little.in_contact.sum() * 100.0 * surface.spacing[0] ** 2 < 2.0
    assert state.force == pytest.approx(2.0, rel=1e-12)
    # the residual bounds the error of the approach
    assert state.approach == pytest.approx(nothing.approach, rel=2e-8)
    # 1.0 times on both; 1.7 times with the pressures of the smaller force spread over all cells
    assert state.iterations <= 1.25 * nothing.iterations


@pytest.mark.parametrize(("cells", "share"), [((9, 14), 1.0), ((18, 18), 0.4), ((5, 8), 0.05)])
def test_a_flat_period_bears_the_same_pressure_everywhere(cells, share):
    """Its interference is rounding: what the gaps are left at is small beside displacements."""
    flat = Surface(heights=np.zeros(cells), lengths=(1.0, 1.3), periodic=True)
    for hardness in (None, 10.0):
        made = HalfSpaceModel(flat, contact_modulus=E_STAR, hardness=hardness, periodic=True)
        start = None
        for force in (0.1, share * 10.0 * flat.area, 1.0):
            state = made.press(Control(force=force), start=start)
            start = state.start
            np.testing.assert_allclose(state.pressure, force / flat.area, rtol=1e-7)
            assert state.residual <= made.tolerance and state.contact_area_fraction == 1.0
    state = made.press(Control(approach=1e-3), start=start)  # beyond full contact
    assert state.yielding.all()
    again = made.press(Control(approach=1.5e-3), start=state.start)
    np.testing.assert_allclose(again.plastic_depth, 1.5e-3, rtol=1e-6)


@pytest.mark.parametrize("seed", [3, 11, 35])
def test_a_period_that_fits_the_plane_is_pressed_further(seed):
    """Unloaded from full plasticity all its cells touch below the hardness, at any mean pressure.

    Nothing but the hardness then resists a plane that comes nearer.
    """
    dice = np.random.default_rng(seed)
    heights = 1e-3 * dice.standard_normal(dice.integers(4, 24, 2))
    surface = Surface(heights=heights, lengths=(1.0, 1.3), periodic=True)
    made = HalfSpaceModel(surface, contact_modulus=1000.0, hardness=20.0, periodic=True)
    lowest = surface.highest - float(heights.min())
    top = made.press(Control(approach=lowest + 5e-4))
    assert top.yielding.all()
    for share in (0.9, 0.1):
        low = made.press(Control(force=share * top.force), start=top.start)
        assert low.in_contact.all() and not low.yielding.any()
        for further in (1e-6, 5e-4):
            state = made.press(Control(approach=top.approach + further), start=low.start)
            assert state.force == pytest.approx(top.force, rel=1e-7)
            deeper = state.plastic_depth - top.plastic_depth
            np.testing.assert_allclose(deeper, further, rtol=1e-5, atol=1e-9)
