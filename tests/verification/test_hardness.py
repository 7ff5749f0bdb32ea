"""Pressures bounded by a hardness, and the plastic depth that loads leave behind."""

from dataclasses import replace

import numpy as np
import pytest

from geometry import Control, PatchGrid, Spectrum, Surface, patch_means, synthesise
from micro import HalfSpaceModel
from multiscale.couplings.contact import ContactCoupling
from multiscale.loading.energy import missing_energy, with_work
from multiscale.loading.stepper import LoadHistory, load_steps

WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
RADIUS, MODULUS, HARDNESS = 5.0, 1000.0, 0.3


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
        _, _, start, state = (made or model()).press(Control(approach=approach), start=start)
        states.append(state)
    return states


@pytest.mark.parametrize("cells", [128, pytest.param(512, marks=pytest.mark.long)])
def test_full_plastic_limit_of_a_sphere(cells):
    """Every contact bears the hardness; its edge lies where the sphere would meet the plane.

    Mean pressure of a disc bends its edge down by 4 H a / (π E*) (Johnson 1985, 3.29a), less than
    2 % of the approach here.
    """
    sphere, approach = cap(cells), 6e-3
    state = model(sphere, HARDNESS, contact_modulus=MODULUS).solve(approach)
    area = state.counted_area
    assert state.force == pytest.approx(area * HARDNESS, rel=2e-3)
    assert area == pytest.approx(2.0 * np.pi * RADIUS * approach, rel=0.02)
    radius = np.sqrt(area / np.pi)
    sunk = 4.0 * HARDNESS * radius / (np.pi * MODULUS)
    # cells on the edge count wholly
    expected = 2.0 * np.pi * RADIUS * (approach - sunk)
    assert area == pytest.approx(expected, rel=4.0 / (radius * cells) ** 1.5)


def test_no_pressure_exceeds_the_hardness():
    states = loaded([4e-3, 1e-2, 5e-3])
    assert max(state.peak_pressure for state in states) <= 400.0 * (1 + 1e-10)
    assert [bool(state.yielding.any()) for state in states] == [True, True, False]


def test_an_endless_hardness_is_the_elastic_solution():
    elastic = model(hardness=None).solve(6e-3)
    hard = model(hardness=1e6).solve(6e-3)
    np.testing.assert_array_equal(hard.pressure, elastic.pressure)
    assert elastic.plastic_depth is None
    assert not hard.plastic_depth.any()


def test_unloading_is_elastic_on_the_changed_heights():
    """By hand: lower the heights by the overlap under the hardness, then solve elastically."""
    surface = rough()
    top, below = loaded([8e-3, 6e-3])
    overlap = np.maximum(top.contact.interference(top.plane) - top.displacement, 0.0)
    depth = np.where(top.pressure >= 400.0, overlap, 0.0)
    assert depth.max() > 1e-5
    changed = replace(surface, heights=surface.heights - depth)
    by_hand = model(changed, np.inf, highest=surface.highest).solve(6e-3)
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
    once = model().solve(8e-3)
    assert loaded(np.linspace(1e-3, 8e-3, 8))[-1].force == pytest.approx(once.force, rel=1e-6)


def test_work_is_elastic_and_plastic_energy():
    """The rise of energy lies between first and last force times motion, at every step."""
    surface = rough()
    coupling = ContactCoupling(model(surface), WHOLE, patch_means(surface, WHOLE))
    history, steps = LoadHistory(quantity="approach", points=(8e-3, 2e-3, 8e-3), steps=16), []
    for step in load_steps(coupling, history):
        stiffness, _, error = coupling.stiffness()
        known = replace(step, stiffness_N_per_mm=stiffness, stiffness_error_N_per_mm=error)
        steps.append(with_work(known, steps[-1] if steps else None))
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
        coupling = ContactCoupling(model(surface), WHOLE, patch_means(surface, WHOLE))
        history = LoadHistory(
            quantity="approach", points=(2e-3, 8e-3, 4e-3), steps=1, force_change=change
        )
        ends.append(list(load_steps(coupling, history)))
    assert len(ends[1]) > len(ends[0])
    assert ends[1][-1].force_N == pytest.approx(ends[0][-1].force_N, rel=1e-6)
