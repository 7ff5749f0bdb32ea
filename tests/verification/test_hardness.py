"""Pressures bounded by a hardness, and the plastic depth that loads leave behind."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.geometry import (
    Control,
    Material,
    PatchGrid,
    Spectrum,
    Surface,
    patch_means,
    synthesise,
)
from patchlaw.micro import FiniteSlopes, HalfSpaceModel
from patchlaw.multiscale import CellContact, LoadHistory, Problem
from patchlaw.multiscale.observers.step_observers import missing_energy, work_of

WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
RADIUS, MODULUS, HARDNESS = 5.0, 1000.0, 0.3


def with_stiffness(step, found):
    """Return a load step that knows its stiffness against the approach."""
    return replace(
        step, approach_stiffness_N_per_mm=found.approach, stiffness_scatter=found.scatter
    )


def rough(seed=5, cells=64):
    spectrum = Spectrum(hurst=0.8, waves=(2, 10), rms_slope=0.2, seed=seed)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def cap(cells):
    x = (np.arange(cells) + 0.5) / cells - 0.5
    return Surface(heights=-(x[:, None] ** 2 + x**2) / (2 * RADIUS), lengths=(1.0, 1.0))


def model(surface=None, hardness=400.0, **given):
    given = {"contact_modulus": 4000.0, "tolerance": 1e-10, "hardness": hardness, **given}
    return HalfSpaceModel(surface or rough(), **given)


def loaded(approaches, made=None):
    """Return the states of load steps one after another."""
    start, states = None, []
    for approach in approaches:
        state = (made or model()).press(Control(approach=approach), start=start)
        start = state.start
        states.append(state)
    return states


@pytest.mark.parametrize("cells", [128, pytest.param(512, marks=pytest.mark.slow)])
def test_full_plastic_limit_of_a_sphere(cells):
    """Every contact bears the hardness; its edge lies where the sphere would meet the plane.

    Mean pressure of a disc bends its edge down by 4 H a / (π E*) (Johnson 1985, 3.29a), less than
    2 % of the approach here.
    """
    sphere, approach = cap(cells), 6e-3
    state = model(sphere, HARDNESS, contact_modulus=MODULUS).press(Control(approach=approach))
    area = state.in_contact.mean() * sphere.area
    assert state.force == pytest.approx(area * HARDNESS, rel=2e-3)
    assert area == pytest.approx(2.0 * np.pi * RADIUS * approach, rel=0.02)
    radius = np.sqrt(area / np.pi)
    sunk = 4.0 * HARDNESS * radius / (np.pi * MODULUS)
    # cells on the edge count wholly
    expected = 2.0 * np.pi * RADIUS * (approach - sunk)
    assert area == pytest.approx(expected, rel=4.0 / (radius * cells) ** 1.5)


def test_unloading_is_elastic_on_the_changed_heights():
    """By hand: lower the heights by the overlap under the hardness, then solve elastically."""
    surface = rough()
    top, below = loaded([8e-3, 6e-3])
    overlap = np.maximum(model().interference(top.plane) - top.displacement, 0.0)
    depth = np.where(top.pressure >= 400.0, overlap, 0.0)
    assert depth.max() > 1e-5
    changed = replace(surface, heights=surface.heights - depth)
    by_hand = model(changed, None, highest=surface.highest).press(Control(approach=6e-3))
    assert below.force == pytest.approx(by_hand.force, rel=1e-9)
    np.testing.assert_allclose(below.pressure, by_hand.pressure, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(below.gap, by_hand.gap, atol=1e-12)
    np.testing.assert_allclose(below.plastic_depth, depth, atol=1e-15)


def test_reloading_repeats_unloading():
    states = loaded([3e-3, 8e-3, 6e-3, 3e-3, 6e-3, 8e-3])
    loading, top, down, low, up, again = (state.force for state in states)
    assert up == pytest.approx(down, rel=1e-8)
    assert again == pytest.approx(top, rel=1e-8)
    assert low < 0.98 * loading, "flattened summits are touched later"


def test_monotone_loading_does_not_depend_on_its_steps():
    once = model().press(Control(approach=8e-3))
    assert loaded(np.linspace(1e-3, 8e-3, 8))[-1].force == pytest.approx(once.force, rel=1e-6)


def test_work_is_elastic_and_plastic_energy():
    """The rise of energy lies between first and last force times motion, at every step."""
    surface = rough()
    coupling = CellContact(model(surface), WHOLE, patch_means(surface, WHOLE))
    history, steps = LoadHistory(approach=(8e-3, 2e-3, 8e-3), steps=16), []
    for step in Problem(coupling, history).steps():
        known = with_stiffness(step, coupling.stiffness())
        work = work_of(known, steps[-1] if steps else None)
        steps.append(replace(known, work_mJ=work))
    assert missing_energy(steps) < 1e-9
    for step in (steps[15], steps[-1]):
        stored = step.elastic_energy_mJ + step.plastic_work_mJ
        assert step.work_mJ == pytest.approx(stored, rel=3e-4)  # trapezoidal rule
    assert steps[-1].plastic_work_mJ == pytest.approx(steps[15].plastic_work_mJ, rel=1e-6)
    broken = [replace(step, elastic_energy_mJ=1.2 * step.elastic_energy_mJ) for step in steps]
    assert missing_energy(broken) > 1e-3


def test_a_step_that_is_halved_leaves_no_plastic_depth():
    """A force that changes by too much was pressed for, and must not have flattened anything."""
    surface, ends = rough(), []
    for change in (None, 0.3):
        coupling = CellContact(model(surface), WHOLE, patch_means(surface, WHOLE))
        history = LoadHistory(approach=(2e-3, 8e-3, 4e-3), steps=1, force_change=change)
        ends.append(list(Problem(coupling, history).steps()))
    assert len(ends[1]) > len(ends[0])
    assert ends[1][-1].force_N == pytest.approx(ends[0][-1].force_N, rel=1e-6)


def test_yielding_does_not_depend_on_the_digits_of_hardness_and_modulus():
    """In units of E*, where nothing is left to round, the same cells yield to the same depth."""
    dice = np.random.default_rng(28)
    surface = Surface(heights=dice.standard_normal((4, 4)), lengths=(1.0, 1.0))
    drawn = 10.0 ** dice.uniform((3.0, 0.0), (6.0, 3.0), (1000, 2))
    back = drawn[:, 1] / drawn[:, 0] * drawn[:, 0]
    # a comparison of products would miss those that are rounded down
    chosen = [np.flatnonzero(way)[:20] for way in (back < drawn[:, 1], back >= drawn[:, 1])]
    assert [len(some) for some in chosen] == [20, 20]
    for modulus, hardness in drawn[np.concatenate(chosen)]:
        given = {"highest": surface.heights.max(), "hardness": hardness / modulus}
        alike = HalfSpaceModel(surface, contact_modulus=1.0, **given).press(Control(approach=2.0))
        given["hardness"] = hardness
        state = HalfSpaceModel(surface, contact_modulus=modulus, **given).press(
            Control(approach=2.0)
        )
        assert state.yielding.any()
        np.testing.assert_array_equal(state.yielding, alike.yielding)
        np.testing.assert_array_equal(state.pressure == hardness, state.yielding)
        assert state.peak_pressure == hardness
        # the same numbers in the solver, but for the last digit of the bound
        np.testing.assert_allclose(state.plastic_depth, alike.plastic_depth, rtol=1e-9)
        assert state.plastic_work == pytest.approx(modulus * alike.plastic_work, rel=1e-9)


def test_unloading_where_rounding_hid_the_hardness():
    """E = 70 GPa, ν = 0.3 and H = 1000 MPa: (H/E*) E* < H."""
    modulus, hardness = 70e3 / (1.0 - 0.3**2), 1000.0
    assert hardness / modulus * modulus < hardness
    surface = rough()
    given = {"contact_modulus": modulus, "hardness": hardness}
    top, below = loaded([10e-3, 8e-3], model(surface, **given))
    changed = replace(surface, heights=surface.heights - top.plastic_depth)
    given = {"contact_modulus": modulus, "highest": surface.highest}
    by_hand = model(changed, None, **given).press(Control(approach=8e-3))
    assert top.yielding.any()
    assert below.force == pytest.approx(by_hand.force, rel=1e-9, abs=1e-9 * top.force)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("periodic", [False, True])
def test_area_bears_the_force_and_holds_what_yields(seed, periodic):
    dice = np.random.default_rng(seed)
    for _ in range(5):
        cells = int(dice.integers(16, 40)), int(dice.integers(16, 40))
        heights = (
            0.01 * dice.standard_normal(cells) if seed < 2 else rough(seed, 64).heights[::2, ::2]
        )
        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=periodic)
        approach = 10.0 ** dice.uniform(-2.0, -0.5) * np.ptp(heights)
        made = model(surface, 10.0 ** dice.uniform(-1.0, 3.0), periodic=periodic, tolerance=1e-8)
        state = made.press(Control(approach=approach))
        # sums of as many numbers as there are cells: rounding alone
        assert state.contact_area >= state.force / made.hardness * (1.0 - 1e-12)
        cell = np.prod(surface.spacing)
        assert state.contact_area >= np.count_nonzero(state.yielding) * cell * (1.0 - 1e-12)
        spots = state.spots
        assert np.all(spots.area >= spots.force / made.hardness * (1.0 - 1e-12))


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))]
)
def test_area_converges_with_half_of_the_contact_yielding(seed):
    spectrum = Spectrum(hurst=0.8, waves=(2, 8), rms_slope=0.2, seed=seed)
    areas = []
    for cells in (64, 256):
        surface = synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))
        state = model(surface, 400.0, tolerance=1e-8).press(Control(force=60.0))
        areas.append(state.contact_area)
    share = np.count_nonzero(state.yielding) / np.count_nonzero(state.in_contact)
    assert 0.4 < share < 0.7
    assert areas[0] == pytest.approx(areas[1], rel=0.02)


def test_stiffness_of_a_sphere_that_yields_is_that_of_full_plasticity():
    """F = 2π R H (δ − u) of the rigid-plastic limit, u the displacement of the rim: 2 % of δ."""
    made = model(cap(128), HARDNESS, contact_modulus=MODULUS)
    found = made.stiffness(made.press(Control(approach=6e-3)), turns=False)
    expected = 2.0 * np.pi * RADIUS * HARDNESS
    assert found.approach == pytest.approx(expected, rel=found.scatter)
    assert found.scatter < 0.7  # eight cells of a circle come at a time


@pytest.mark.parametrize(
    ("hardness", "cells"),
    [
        (100.0, 64),
        pytest.param(400.0, 64, marks=pytest.mark.long),
        pytest.param(400.0, 128, marks=pytest.mark.slow),
    ],
)
def test_stiffness_while_yielding_is_within_its_error(hardness, cells):
    """Against the slope of a parabola through forces from 15 % below to 15 % above."""
    worst = []
    for seed in (1, 2, 3, 4):
        made = model(rough(seed, cells), hardness)
        state = made.press(Control(approach=8e-3))
        found = made.stiffness(state, turns=False)
        top = made.interference(state.plane).max()
        ways = np.linspace(-0.15, 0.15, 21) * top
        forces = [made.press(Control(approach=8e-3 + way), start=state.guess).force for way in ways]
        slope = np.polyfit(ways, forces, 2)[1]
        assert 0.0 < found.scatter < 0.8
        ahead = 0.05 * top
        elastic = replace(made, hardness=None).press(
            Control(approach=8e-3 + ahead), start=state.start
        )
        assert found.approach < (elastic.force - state.force) / ahead
        worst.append(abs(1.0 - slope / found.approach) / found.scatter)
    # the parabola itself is off by some per cent, as new contacts come within its range
    assert np.median(worst) < 1.0 and max(worst) < 1.5


def slopes_of_parabolas(made, state, displaced=None):
    """Return dF over closing gap and over approach, through three solutions from nothing."""
    away = 0.1 * float(made.interference(state.plane).max())
    away *= min(1.0, (100 / state.in_contact.sum()) ** 0.2)
    planes = state.approach + away * np.array([-1.0, 0.0, 1.0])
    states = [made.press(Control(approach=one), displaced=displaced) for one in planes]
    closed = -np.array([one.gap.mean() for one in states])
    roots = np.sqrt([one.force for one in states])
    return [2.0 * roots[1] * np.polyfit(x - x[1], roots, 2)[1] for x in (closed, planes)]


@pytest.mark.long
@pytest.mark.parametrize(("seed", "hardness"), [(3, 100.0), (5, 400.0)])
def test_stiffness_while_yielding_is_one_however_many_steps_lead_there(seed, hardness):
    """It is the slope of the first loading, whether the last step was long or short."""
    made, found = model(rough(seed, 32), hardness), []
    for count in (1, 4, 20, 100):
        state = loaded(np.linspace(0.0, 8e-3, count + 1)[1:], made)[-1]
        found.append(made.stiffness(state, turns=False))
    values = np.array([one.approach for one in found])
    # the residual of the forces over the increment
    np.testing.assert_allclose(values, values[0], rtol=1e-3)
    # rough solutions both ways
    assert values[0] == pytest.approx(slopes_of_parabolas(made, state)[1], rel=2e-3)


def test_stiffness_while_yielding_knows_what_else_displaces_the_surface():
    """As tractions do where friction is coupled: it is the slope of the curve with them."""
    made = model(rough(3, 32), 100.0)
    x, y = made.surface.x[:, None] - 0.5, made.surface.y - 0.5
    displaced = 2e-3 * (0.7 + x) * (1.3 - y)
    state = made.press(Control(approach=8e-3), displaced=displaced)
    found = made.stiffness(state)
    # rough solutions both ways
    assert found[:2] == pytest.approx(slopes_of_parabolas(made, state, displaced), rel=2e-3)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_stiffness_while_yielding_knows_how_finite_slopes_grow(seed):
    """Against solutions that work them out on every plane, and with what they add here on all."""
    steep, material = rough(seed, 32), Material(young_modulus=4000.0, poisson_ratio=0.0)
    steep = replace(steep, heights=2.0 * steep.heights)
    made = model(steep, 600.0, slopes=(FiniteSlopes(steep, material),))
    state = made.press(Control(approach=2e-2))
    found = made.stiffness(state)
    known = slopes_of_parabolas(made, state)
    off = np.abs(np.divide(found[:2], known) - 1.0)
    stays = slopes_of_parabolas(made.with_slopes(()), state, state.by_slopes)
    assert off.max() < 0.25 * found.scatter
    assert (off < 0.5 * np.abs(np.divide(stays, known) - 1.0)).all()


def test_no_gap_closes_on_a_period_that_yields_everywhere():
    made = model(
        Surface(heights=rough(3, 24).heights, lengths=(1.0, 1.0), periodic=True), 1.0, periodic=True
    )
    state = made.press(Control(approach=0.5))
    assert state.yielding.all()
    found = made.stiffness(state)
    assert found.interface is None and found.approach == 0.0  # every cell bears the hardness


@pytest.mark.parametrize("turns", [False, True])
def test_a_single_cell_that_yields_has_no_stiffness_left(turns):
    heights = np.full((9, 8), -0.3)
    heights[4, 3] = 0.0
    made = model(Surface(heights=heights, lengths=(1.0, 0.9)), 50.0, tolerance=1e-8)
    state = made.press(Control(approach=0.1))
    found = made.stiffness(state, turns=turns)
    elastic = made.unloading_stiffness(state).approach
    # rounding of the force by the residual of rough solutions
    assert 0.0 <= found.approach < 0.01 * elastic and 0.0 <= found.interface < 0.01 * elastic
    assert found.scatter >= 0.0


@pytest.mark.parametrize("by_force", [False, True])
def test_stiffness_back_at_the_turning_point_is_elastic(by_force):
    """There it jumps; the plane came from below, where nothing yields anew."""
    made, start = model(hardness=150.0), None
    top = made.press(Control(approach=8e-3))
    back = Control(force=top.force) if by_force else Control(approach=8e-3)
    for control in (Control(approach=8e-3), Control(approach=6e-3), back):
        state = made.press(control, start=start)
        start = state.start
    found = made.stiffness(state, turns=False)
    assert found.scatter == 0.0
    assert found.approach > 1.2 * made.stiffness(top, turns=False).approach
    step = 1e-4 * 8e-3
    below = made.press(Control(approach=state.approach - step), start=start)
    # the same cells touch, and the force is linear
    assert found.approach == pytest.approx((state.force - below.force) / step, rel=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 100.0, 400.0])
def test_work_of_a_first_step_is_that_of_many(hardness):
    surface, ends = rough(5, 32), []
    for count in (1, 64):
        coupling = CellContact(model(surface, hardness), WHOLE, patch_means(surface, WHOLE))
        history, before = LoadHistory(approach=(8e-3,), steps=count), None
        for step in Problem(coupling, history).steps():
            step = with_stiffness(step, coupling.stiffness())
            before = replace(step, work_mJ=work_of(step, before))
        ends.append(before.work_mJ)
    # the trapezoidal rule, in 64 steps
    assert ends[0] == pytest.approx(ends[1], rel=2e-4)
