"""Few cells that can touch are solved by their compliance matrix: the same contact problem."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.dense_contact import dense_contact, matrix_of

from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import BodyModes, FiniteSlopes, FreeSides, HalfSpaceModel
from patchlaw.micro.boundary_elements import side_cells
from patchlaw.micro.boundary_elements.compliance_matrix import ComplianceMatrix
from patchlaw.micro.boundary_elements.grid_compliance import Compliance, GridCompliance
from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.boundary_elements.side_cells import SideTerm
from patchlaw.micro.complementarity import solver

E_STAR, LENGTHS, GRID = 4092.0, (1.0, 0.8), (24, 20)
SPACING = tuple(length / cells for length, cells in zip(LENGTHS, GRID, strict=True))
SIDES = FreeSides(lengths=LENGTHS, poisson_ratio=0.3, decay_length=0.2)
CORNER = FreeSides(
    lengths=LENGTHS, poisson_ratio=0.3, decay_length=0.2, present=(True, False, False, True)
)


def body(seed=0):
    """Return a smooth compliance, which couples all modes."""
    modes = np.random.default_rng(seed).standard_normal((9, 9))
    return BodyModes(LENGTHS, 2e-6 * modes @ modes.T)


def rough(seed):
    spectrum = Spectrum(hurst=0.8, waves=(2, 6), rms_slope=0.15, seed=seed)
    return synthesise(spectrum, grid=GRID, lengths=LENGTHS)


def model(seed, **terms):
    return HalfSpaceModel(rough(seed), contact_modulus=E_STAR, tolerance=1e-12, **terms)


@pytest.fixture
def few(monkeypatch):
    """Count the solutions by a matrix, which are taken for all contacts that may have one."""
    counted, among = [], solver.CellProblem.among

    def recorded(problem, cells):
        counted.append(len(cells))
        return among(problem, cells)

    monkeypatch.setattr(solver.CellProblem, "among", recorded)
    return counted


@pytest.mark.long
@pytest.mark.parametrize("lines", [2**22, 1000], ids=["all lines", "some rows at a time"])
@pytest.mark.parametrize(
    "terms",
    [[], [SideTerm(SIDES)], [SideTerm(CORNER)], [body()], [SideTerm(SIDES), body(1)]],
    ids=["half-space", "sides", "two sides", "body", "all"],
)
def test_matrix_is_that_of_the_products(terms, lines, monkeypatch):
    monkeypatch.setattr(side_cells, "_LINES", lines)
    dice = np.random.default_rng(3)
    cells = dice.choice(np.prod(GRID), 150, replace=False)
    compliance = Compliance(periodic=False, modulus=E_STAR, terms=terms)
    whole = matrix_of(compliance.on_grid(GRID, SPACING), GRID)
    part = compliance.matrix_on(cells, GRID, SPACING)
    pressure = dice.random((150, 1))
    expected = whole[np.ix_(cells, cells)] @ pressure
    assert part.displacement(pressure) == pytest.approx(expected, rel=1e-12)
    assert compliance.matrix_on(cells, GRID, SPACING) is part  # made once


def test_periodic_matrix_is_that_of_the_products():
    cells = np.arange(0, np.prod(GRID), 7)
    compliance = Compliance(periodic=True)
    whole = matrix_of(compliance.on_grid(GRID, SPACING), GRID)
    part = compliance.on_grid(GRID, SPACING).matrix(cells, GRID[1])
    found = part.displacement(np.eye(len(cells)))
    assert found == pytest.approx(whole[np.ix_(cells, cells)], abs=1e-14 * whole.max())


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 250.0], ids=["elastic", "hard"])
@pytest.mark.parametrize("given", ["approach", "force", "tilted"])
@pytest.mark.parametrize("seed", range(2))
def test_is_the_proved_solution_on_all_cells(seed, given, hardness, few):
    """The oracle sees every cell of the surface, and proves its solution by duality."""
    contact = model(seed, sides=SIDES, body=body(seed), hardness=hardness)
    controls = {
        "approach": Control(approach=6e-3),
        "force": Control(force=1.5),
        "tilted": Control(approach=6e-3, tilt=(3e-3, -2e-3)),
    }
    control = controls[given]
    state = contact.press(control)
    assert few and max(few) < 0.5 * np.prod(GRID)
    matrix = matrix_of(contact.compliance.on_grid(GRID, SPACING), GRID)
    upper = np.inf if hardness is None else hardness
    proved = dense_contact(matrix, contact.interference(state.plane), upper=upper)
    found = state.pressures.ravel()
    # the oracle's cells lie within 1e-11 of the largest gap of their conditions
    assert found == pytest.approx(proved.pressure, abs=1e-8 * proved.pressure.max())
    if hardness is not None and control.force is None:
        assert np.any(state.yielding)


@pytest.mark.parametrize("slopes", [False, True], ids=["flat", "slopes"])
@pytest.mark.parametrize("approach", [2e-3, 5e-3, 9e-3])
def test_agrees_with_transforms(approach, slopes, few, monkeypatch):
    contact = model(5, sides=SIDES, body=body())
    if slopes:
        material = Material(young_modulus=4000.0, poisson_ratio=0.15)
        contact = replace(contact, slopes=(FiniteSlopes(contact.surface, material),))
    one = contact.press(Control(approach=approach))
    assert few
    few.clear()
    monkeypatch.setattr(solver, "_MATRIX_WORK", 0.0)
    other = replace(contact).press(Control(approach=approach))
    assert not few
    assert one.force == pytest.approx(other.force, rel=1e-8 if slopes else 1e-11)
    np.testing.assert_array_equal(one.in_contact, other.in_contact)


def test_matrix_that_errs_is_still_solved():
    """Conjugate gradients iterate where rounding leaves no Cholesky factors."""
    dice = np.random.default_rng(1)
    turn = np.linalg.qr(dice.standard_normal((6, 6)))[0]
    singular = turn @ np.diag([3.0, 2.0, 1.0, 0.5, 0.2, -1e-13]) @ turn.T
    cells = Cells.of(np.arange(6), (6, 1))
    found = ComplianceMatrix(singular).inverse_on(cells)(np.ones(6))
    assert found == pytest.approx(1.0 / np.diag(singular), rel=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_cells_that_do_not_yield_are_solved_on_by_their_matrix(seed, monkeypatch):
    """They are few of those in contact; against iterations with transforms."""
    contact, load = model(seed, hardness=10.0), Control(force=5.0 * np.prod(LENGTHS))
    used, solved_on = [], GridCompliance.solved_on

    def recorded(grid, cells):
        used.append(solved_on(grid, cells))
        return used[-1]

    monkeypatch.setattr(GridCompliance, "solved_on", recorded)
    one = contact.press(load)
    assert any(isinstance(each, ComplianceMatrix) for each in used)
    monkeypatch.setattr(GridCompliance, "solved_on", lambda grid, cells: grid)
    other = contact.press(load)
    assert one.approach == pytest.approx(other.approach, rel=1e-10)
    np.testing.assert_allclose(one.pressures, other.pressures, atol=1e-8 * 10.0)


def test_many_cells_take_transforms(few):
    """As many cells as the whole of a small surface are cheaper by transforms."""
    flat = replace(model(2), surface=replace(rough(2), heights=1e-3 * rough(2).heights))
    flat.press(Control(approach=2e-3))
    assert not few


@pytest.mark.parametrize("loads", [(1e-3, 2e-3, 4e-3, 8e-3), (8e-3, 4e-3, 2e-3, 1e-3)])
def test_loads_nearby_share_a_matrix(loads, few):
    contact = model(4)
    for approach in loads:
        contact.press(Control(approach=approach))
    again = [contact.press(Control(approach=each)).force for each in loads]
    assert len(contact.compliance._matrices) == len(set(few))
    assert again == [contact.press(Control(approach=each)).force for each in loads]
