"""Finite slopes that remember, against the same slopes worked out anew every time."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import FiniteSlopes, FreeSides, HalfSpaceModel, SideStresses
from patchlaw.micro.boundary_elements import compliance_matrix
from patchlaw.micro.boundary_elements.compliance_matrix import RememberedSlopes
from patchlaw.micro.complementarity import slope_iteration

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 6), rms_slope=0.2, seed=3), grid=(64, 48), lengths=(1.0, 0.75)
)
SIDES = FreeSides(lengths=SURFACE.lengths, poisson_ratio=0.3, decay_length=0.5)
EDGES = {"half-space": (), "free sides": [SideStresses(SIDES, SURFACE.spacing)]}
LARGEST = Control(approach=8e-3, tilt=(3e-3, -2e-3))


@pytest.fixture(params=EDGES)
def slopes(request):
    return FiniteSlopes(SURFACE, MATERIAL, edge_stresses=EDGES[request.param], grid=SURFACE.grid)


def model_with(slopes, **options):
    return HalfSpaceModel(
        surface=SURFACE,
        contact_modulus=MATERIAL.contact_modulus,
        slopes=(slopes,),
        highest=SURFACE.highest,
        tolerance=1e-10,
        **options,
    )


def scattered(cells, values):
    everywhere = np.zeros(SURFACE.grid)
    everywhere.ravel()[cells] = values
    return everywhere


def by_columns(remembering, loaded, pressure):
    """Return displacements of the few cells, the second order's share that of other pressures."""
    first, second = remembering.columns(loaded)
    matrix = np.einsum("ik,jk->ij", first, second)
    return (matrix + matrix.T) @ pressure


def test_new_pressures_and_their_combinations_are_exact(slopes):
    cells = np.flatnonzero(SURFACE.heights > np.quantile(SURFACE.heights, 0.97))
    one, other = np.random.default_rng(1).random((2, len(cells)))
    remembering = RememberedSlopes(slopes, cells)
    for few in (one, other, one + 3.0 * other, np.zeros_like(one)):
        exact = slopes.displacement(scattered(cells, few))
        remembering.learn(few, 1e-6)
        slack = 1e-12 * np.abs(exact).max()  # rounding of sums over 3072 cells
        assert remembering.displacement(few) == pytest.approx(exact, abs=slack)
        on_cells = by_columns(remembering, few, few)
        assert on_cells == pytest.approx(exact.ravel()[cells], abs=slack)


def test_what_is_known_to_rounding_is_not_worked_out_again(slopes):
    """Directions of rounding are not at right angles: sums of them double what others tell."""
    cells = np.flatnonzero(SURFACE.heights > np.quantile(SURFACE.heights, 0.97))
    drawn = np.random.default_rng(2).random((3, len(cells)))
    remembering = RememberedSlopes(slopes, cells)
    for few in drawn:
        assert remembering.learn(few, 0.0)
    for shares in np.random.default_rng(3).random((20, len(drawn))):
        assert not remembering.learn(shares @ drawn, 0.0)


def test_the_interface_stiffness_is_that_of_the_slopes_worked_out_anew(slopes):
    quick = model_with(slopes).quick_up_to(LARGEST)
    state = quick.press(LARGEST)
    found = quick.stiffness(state)
    exact = model_with(slopes).stiffness(state)
    # what rates are remembered to, 4e-4, times the few per cent by slopes
    assert found.interface == pytest.approx(exact.interface, rel=2e-6)


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 200.0], ids=["elastic", "yielding"])
def test_a_path_of_loads_has_the_same_forces(slopes, hardness):
    model = model_with(slopes, hardness=hardness)
    quick, start = model.quick_up_to(LARGEST), None
    for part in (0.2, 0.5, 0.35, 1.0):
        control = replace(LARGEST, approach=part * LARGEST.approach)
        state = quick.press(control, start=start)
        start = state.guess
        exact = model.press(control)
        # the search ends at 3e-9 of the interference; a rest of 1e-6 counts by its square
        assert state.force == pytest.approx(exact.force, rel=2e-8)
        assert state.patch_displacement == pytest.approx(exact.patch_displacement, rel=2e-8)
        slack = 1e-7 * exact.pressure.max()
        assert state.pressure == pytest.approx(exact.pressure, abs=slack)


def test_a_full_memory_begins_anew(slopes, monkeypatch):
    monkeypatch.setattr(compliance_matrix, "_MOST", 3)
    model = model_with(slopes)
    quick, start = model.quick_up_to(LARGEST), None
    for part in (0.5, 0.7, 1.0):
        control = replace(LARGEST, approach=part * LARGEST.approach)
        state = quick.press(control, start=start)
        start = state.guess
        assert state.force == pytest.approx(model.press(control).force, rel=2e-8)
        exact = model.stiffness(state, turns=False).approach
        assert quick.stiffness(state, turns=False).approach == pytest.approx(exact, rel=2e-7)


def test_a_larger_load_than_foreseen_is_solved_all_the_same(slopes):
    quick = model_with(slopes).quick_up_to(replace(LARGEST, approach=1e-3))
    assert quick.press(LARGEST).force == pytest.approx(
        model_with(slopes).press(LARGEST).force, rel=2e-8
    )


def test_loads_on_a_path_take_few_evaluations(slopes, monkeypatch):
    """Twenty loads between two that are known take fewer than two evaluations each."""
    quick, count = model_with(slopes).quick_up_to(LARGEST), 0
    orders = FiniteSlopes.orders

    def counted(*given):
        nonlocal count
        count += 1
        return orders(*given)

    monkeypatch.setattr(FiniteSlopes, "orders", counted)
    start = None
    for part in np.linspace(0.5, 1.0, 20):
        control = replace(LARGEST, approach=part * LARGEST.approach)
        start = quick.press(control, start=start).guess
    assert 1 < count < 40
    before = count
    quick.press(replace(LARGEST, approach=0.77 * LARGEST.approach), start=start)
    assert count - before <= 3


def test_the_stiffness_is_that_of_slopes_without_memory(slopes):
    model = model_with(slopes)
    quick, start = model.quick_up_to(LARGEST), None
    for part in (0.6, 1.0):
        control = replace(LARGEST, approach=part * LARGEST.approach)
        state = quick.press(control, start=start)
        start = state.guess
        exact = model.stiffness(model.press(control), turns=False).approach
        # both iterations end where the square of what is left is below 1e-7
        assert quick.stiffness(state, turns=False).approach == pytest.approx(exact, rel=2e-7)


def test_few_cells_are_searched_apart(slopes, monkeypatch):
    """Among few cells the search for all cells of the surface is not entered."""
    monkeypatch.setattr(
        slope_iteration, "solve_on_surface", lambda *_: pytest.fail("searched everywhere")
    )
    assert model_with(slopes).quick_up_to(LARGEST).press(LARGEST).force > 0.0
