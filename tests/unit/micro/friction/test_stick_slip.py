"""The tractions of one step against a slow oracle, and what has none."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.friction.stick_slip import TractionProblem, solve_tractions
from patchlaw.micro.friction.tangential_grid import TangentialGrid
from patchlaw.support import NotConverged

GRID, SPACING = (7, 6), (0.13, 0.21)


def problem(seed, *, force=None, poisson_ratio=0.3, spread=1.0, tolerance=1e-10):
    """Return a random problem of 24 of 42 cells, with its matrix."""
    rng = np.random.default_rng(seed)
    grid = TangentialGrid(GRID, SPACING, poisson_ratio=poisson_ratio, periodic=False)
    cells = Cells.of(np.sort(rng.choice(42, 24, replace=False)), GRID)
    count = len(cells.flat)
    units = np.eye(2 * count).reshape(-1, 2, count)
    matrix = np.stack([grid.displacement_of(cells, unit).ravel() for unit in units])
    bound = 10.0 ** rng.uniform(-2.0, 0.0, count)
    shift = np.array([0.4, -0.3])[:, None] + spread * 0.3 * rng.normal(size=(2, count))
    if force is not None:
        force = np.array(force) * bound.sum()
    made = TractionProblem(
        grid=grid, cells=cells, bound=bound, shift=shift, force=force, tolerance=tolerance
    )
    return made, matrix


def oracle(made, matrix, motion=(0.0, 0.0), steps=20000):
    """Return the tractions by accelerated projected gradients with a fixed step."""
    step = 1.0 / np.linalg.eigvalsh(matrix)[-1]
    shift = made.shift + np.array(motion)[:, None]
    now = ahead = np.zeros_like(shift)
    for number in range(steps):
        left = shift - (matrix @ ahead.ravel()).reshape(2, -1)
        moved = made.within_bounds(ahead + step * left)
        if np.abs(moved - ahead).max() < 1e-14:  # rounding: the steps to come change nothing
            return moved
        restart = float(np.vdot(left, moved - now)) < 0.0
        ahead = moved if restart else moved + number / (number + 3.0) * (moved - now)
        now = moved
    return now


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("spread", [0.0, 1.0, 8.0])
def test_tractions_are_those_of_the_oracle(seed, spread):
    made, matrix = problem(seed, spread=spread)
    solution = solve_tractions(made, np.zeros((2, 24)))
    assert solution.traction == pytest.approx(oracle(made, matrix), abs=1e-7)
    assert solution.residual <= 1e-10
    assert (np.hypot(*solution.traction) <= made.bound * (1.0 + 1e-12)).all()
    # slip points along the traction, where that is at its bound, and is none elsewhere
    slip = made.shift - (matrix @ solution.traction.ravel()).reshape(2, -1)
    assert solution.slip == pytest.approx(slip, abs=1e-9)
    assert (np.vdot(solution.slip, solution.traction)) >= 0.0
    assert not solution.slip[:, ~solution.slipping].any()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("part", [(0.0, 0.0), (0.3, 0.2), (-0.7, 0.69)])
def test_a_prescribed_force_is_met_and_its_shift_gives_it(seed, part):
    made, matrix = problem(seed, force=part)
    solution = solve_tractions(made, np.zeros((2, 24)))
    assert solution.traction.sum(axis=1) == pytest.approx(made.force, abs=1e-11)
    assert solution.traction == pytest.approx(oracle(made, matrix, solution.motion), abs=2e-6)


@pytest.mark.parametrize("force", [None, (0.3, 0.2)])
def test_tractions_do_not_depend_on_the_unit_of_length(force):
    made, _ = problem(1, force=force)
    small = replace(made, bound=1e-4 * made.bound, shift=1e-4 * made.shift)
    if force:
        small = replace(small, force=1e-4 * made.force)
    wide, narrow = (solve_tractions(one, np.zeros((2, 24))) for one in (made, small))
    assert narrow.traction == pytest.approx(1e-4 * wide.traction, abs=1e-13)
    assert np.array_equal(narrow.slipping, wide.slipping)


@pytest.mark.parametrize(
    ("seed", "force", "loaded"),
    [(2, (0.3, 0.2), True), (6, (0.3, 0.2), False), (10, (0.6, -0.5), None)],
    ids=["went round in circles", "just below the bound", "energy within rounding"],
)
def test_a_force_is_found_back_and_forth(seed, force, loaded):
    """Three ways in which the search once ended without convergence."""
    made, matrix = problem(seed, force=force)
    start = solve_tractions(made, np.zeros((2, 24))).traction if loaded else np.zeros((2, 24))
    if loaded is not None:
        made = replace(made, shift=0.2 * made.shift, force=-0.3 * made.force)
    solution = solve_tractions(made, start)
    assert solution.residual <= 1e-10
    assert solution.traction == pytest.approx(oracle(made, matrix, solution.motion), abs=2e-6)


def test_cells_that_slip_back_stick_at_once():
    """Tractions that may only turn as long as slip points along them need few products."""
    made, _ = problem(3)
    loaded = solve_tractions(made, np.zeros((2, 24)))
    back = solve_tractions(replace(made, shift=0.2 * made.shift), loaded.traction)
    assert back.products <= 30  # 17; 131 where cells at the bound stay on it


def test_the_start_does_not_count():
    made, _ = problem(1)
    rng = np.random.default_rng(0)
    some = solve_tractions(made, rng.normal(size=(2, 24))).traction
    assert some == pytest.approx(solve_tractions(made, np.zeros((2, 24))).traction, abs=1e-8)


@pytest.mark.parametrize("count", [1, 2])
def test_tractions_go_where_nothing_shears(count):
    grid = TangentialGrid(GRID, SPACING, poisson_ratio=0.3, periodic=False)
    start = np.linspace(-0.01, 0.02, 2 * count).reshape(2, count)
    made = TractionProblem(
        grid=grid, cells=Cells.of(np.arange(count), GRID), bound=np.full(count, 0.1),
        shift=np.zeros((2, count)), force=None, tolerance=1e-8,
    )  # fmt: skip
    solution = solve_tractions(made, start)
    assert np.abs(solution.traction).max() <= 1e-8 * np.abs(start).max()
    assert not solution.slipping.any()


def test_more_force_than_friction_transmits_slides():
    made, _ = problem(1, force=(0.8, 0.6))
    with pytest.raises(NotConverged, match="exceeds what friction transmits: the contact slides"):
        solve_tractions(made, np.zeros((2, 24)))


def test_the_smallest_contacts():
    grid = TangentialGrid(GRID, SPACING, poisson_ratio=0.3, periodic=False)
    none, one = (Cells.of(np.arange(count), GRID) for count in (0, 1))
    empty = TractionProblem(
        grid=grid, cells=none, bound=np.zeros(0), shift=np.zeros((2, 0)), force=np.zeros(2),
        tolerance=1e-8,
    )  # fmt: skip
    assert solve_tractions(empty, np.zeros((2, 0))).traction.shape == (2, 0)
    single = TractionProblem(
        grid=grid, cells=one, bound=np.ones(1), shift=np.array([[30.0], [40.0]]), force=None,
        tolerance=1e-8,
    )  # fmt: skip
    # its slip turns a little against the shift: displacements are not those of a sphere's cell
    solution = solve_tractions(single, np.zeros((2, 1)))
    assert solution.traction[:, 0] == pytest.approx([0.6, 0.8], abs=1e-2)
    assert np.hypot(*solution.traction[:, 0]) == pytest.approx(1.0, rel=1e-12)
