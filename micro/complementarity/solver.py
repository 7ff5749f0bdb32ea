"""Contact of a rigid body on the cells of a surface, and how it changes with the approach.

The half-space's displacements by pressures are never negative. Without periodicity a rigid body
therefore touches only cells with a positive interference, and a box around these is all that enters
the solution. A finite body may lift other cells into contact: they are searched for at the end.

Pressures to start from come from the solution on a grid half as fine, and so on down to a small
one. The set of cells in contact is then found on the coarse grids, where that costs little, and
only its edge is left to the fine one (full multigrid: Zhao, Vollebregt & Oosterlee 2014,
doi 10.3846/13926292.2014.909899).

As long as the cells in contact stay the same, the contact is linear. An approach by 1 mm displaces
all of them by that, and free motions of the body, whose loads stay as they are, take up their part:

    (C p')_A = 1 + Σ_i q_i ℓ_i,    Σ p' ℓ_i = 0.

The sum of p' over the cells is the interfacial stiffness dF/dδ over the area of a cell. On cells
the force is a piecewise linear function of the approach, and this is its derivative. From pressures
q that leave r = 1 − C q the sum is Σ q + Σ q r to second order in r, as C is symmetric.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.boundary_elements.inverse import ContactCells
from patchlaw.micro.complementarity.active_set import solve
from patchlaw.micro.complementarity.cell_problem import (
    Box,
    CellProblem,
    ContactPressures,
    box_around,
    refined,
)
from patchlaw.support import Array, Flags, Indices, NotConverged

Place = Any
"""A box of cells, or rows and columns of n cells, shape (n, 1) both: an index of fields."""

_FEW_CELLS = 32
"""Cells per side on which a solution from nothing costs nothing."""
_ROUGH = 2e-2
"""Residual on the coarse grids; their discretisation errs by more."""
_MARGIN = 1.1
"""Factor on an estimated approach, so that the box of cells that it overlaps holds the contact."""
_MATRIX_WORK, _MATRIX_CELLS = 2e5, 2500
"""Cube of the number of cells that are solved by a matrix, over those of the box, and their number,
at most. On 32² to 256² cells between free sides a solution from one nearby takes 2 to 26 ms by the
matrix there and 5 to 53 by transforms; at ten times that work they take equally long. Before that
the matrix is made, which takes as long as a solution from nothing."""
_DEPTHS = 1.5
"""Ratio of the depths below the highest cell that such cells lie within."""
_ESTIMATE = 1e-2
"""Residual of the solution on a coarse grid that the approach is estimated from."""


def solve_on_surface(problem: CellProblem, start: ContactPressures | None) -> ContactPressures:
    """Solve one contact without finite slopes.

    Args:
        problem: The contact problem of all cells of a surface.
        start: A solution nearby, its motion that of the solution where the approach is free.

    Raises:
        NotConverged: When the contact conditions or the loads cannot be met.
    """
    interference, motions = problem.interference, problem.motions
    pressure = None if start is None else start.pressure
    if motions.turns:
        return _solve_on(problem, _whole(interference), pressure)
    if motions.count:
        return _solve_under_force(problem, start)
    if interference.max() <= 0.0:
        return ContactPressures(np.zeros(interference.shape))
    return _solve_growing(problem, place_of(problem, interference > 0.0), pressure)


def _solve_under_force(problem: CellProblem, start: ContactPressures | None) -> ContactPressures:
    """Solve with a free approach; the box follows from an estimate of it."""
    interference = problem.interference
    top = float(interference.max())  # the approach that counts is that from first touch of a cell
    first, most, used = None, np.inf, 0
    if start is not None and start.pressure.any():
        first, most = start.pressure, _MARGIN * (float(start.motion[0]) + top)
    elif not problem.compliance.periodic:
        # summits of a coarse grid are lower: the estimate errs upwards
        bits = _FEW_CELLS.bit_length() - 1
        factors = [1 << max(0, (n - 1).bit_length() - bits) for n in interference.shape]
        solution = _solve_nested(problem.coarsened(factors, _ESTIMATE))
        most = _MARGIN * (float(solution.motion[0]) + top)
    while True:
        least = min(top - most, np.nextafter(top, -np.inf), _bearing(problem))
        place = place_of(problem, interference > least)
        solution = _solve_growing(problem, place, first)
        approach, used = float(solution.motion[0]) + top, used + solution.iterations
        if approach <= most or _is_whole(place, interference):
            return solution._replace(iterations=used)
        first, most = solution.pressure, _MARGIN * approach


def _bearing(problem: CellProblem) -> float:
    """Return an interference that enough cells exceed to bear the force at their hardness [mm]."""
    if not problem.yields:
        return np.inf
    most = problem.interference.size
    needed = int(_MARGIN * float(problem.motions.loads[0]) / problem.hardness) + 1
    last = most - min(needed, most)
    highest = float(np.partition(problem.interference, last, axis=None)[last])
    return float(np.nextafter(highest, -np.inf))


def touches_few_cells(problem: CellProblem) -> bool:
    """Return whether a body that does not move freely is solved for on few cells by a matrix.

    Args:
        problem: The contact problem.
    """
    touchable = problem.interference > 0.0
    return not touchable.any() or _are_few(np.count_nonzero(touchable), touchable)


def place_of(problem: CellProblem, touchable: Flags) -> Place:
    """Return where to solve: the rows and columns of few cells, or a box around many.

    The depths that few cells lie within come in steps: their matrix serves loads nearby, too.

    Args:
        problem: The contact problem.
        touchable: Cells that the body can touch on a half-space, at least one.
    """
    if problem.compliance.periodic:
        return _whole(touchable)
    box = box_around(touchable)
    if not _are_few(np.count_nonzero(touchable), touchable):
        return box
    undeformed = problem.undeformed
    depth = undeformed.max() - undeformed
    if deepest := float(depth[touchable].max()):
        deepest = _DEPTHS ** math.ceil(math.log(deepest, _DEPTHS))
    within = touchable | (depth <= deepest)
    if not _are_few(np.count_nonzero(within), touchable):
        return box
    row, column = np.nonzero(within)
    return row[:, None], column[:, None]


def _are_few(count: int, touchable: Flags) -> bool:
    """Return whether a matrix of so many cells pays where a box holds those that can touch."""
    size = touchable[box_around(touchable)].size
    return count <= _MATRIX_CELLS and count**3 <= _MATRIX_WORK * size


def on_place(problem: CellProblem, place: Place) -> CellProblem:
    """Return the problem of the cells of a place, which carry all loads.

    Args:
        problem: The contact problem of all cells of a surface.
        place: The place, see `place_of`.
    """
    if isinstance(place[0], slice):
        return problem.on(place)
    return problem.among(np.ravel_multi_index(place, problem.interference.shape).ravel())


def _solve_growing(problem: CellProblem, place: Place, start: Array | None) -> ContactPressures:
    """Solve on some cells, and on more while cells outside are lifted into contact."""
    solution = _solve_on(problem, place, start)
    while problem.compliance.lifts and not _is_whole(place, problem.interference):
        nearer = problem.interference + problem.motions.displacement(solution.motion)
        outside = np.ones(problem.interference.shape, bool)
        outside[place] = False
        larger = _lifted(problem, outside, nearer, solution.pressure)
        if not larger.any():
            break
        larger[place] = True  # what touched once may touch again
        place = place_of(problem, larger)
        again = _solve_on(problem, place, solution.pressure)
        solution = again._replace(iterations=solution.iterations + again.iterations)
    return solution


def penetrates_outside(problem: CellProblem, cells: Indices, pressure: Array) -> bool:
    """Return whether other cells than those that were solved for penetrate the rigid body.

    Args:
        problem: The contact problem of all cells of a surface, without free motions.
        cells: Flat indices of the cells that were solved for, shape (n,).
        pressure: Pressures of all cells of the surface, shape (nx, ny) [MPa].
    """
    outside = np.ones(pressure.shape, bool)
    outside.ravel()[cells] = False
    return bool(_lifted(problem, outside, problem.interference, pressure).any())


def _lifted(problem: CellProblem, outside: Flags, interference: Array, pressure: Array) -> Flags:
    """Return which of the cells outside, that have no pressure, penetrate the rigid body.

    The half-space only lowers cells. All displacements are therefore evaluated only where those by
    what may lift cells, such as a finite body, do not clear every cell outside.
    """
    moved = problem.compliance.lifted(pressure, problem.spacing)
    lifted = outside & (moved < interference)
    if not lifted.any():
        return lifted
    return np.asarray(lifted & (problem.grid.displacement(pressure) < interference))


def _solve_on(problem: CellProblem, place: Place, start: Array | None) -> ContactPressures:
    """Solve on some cells; where there is no start and they are many, from coarser grids."""
    shape, few = problem.interference.shape, not isinstance(place[0], slice)
    part = on_place(problem, place)
    known = None if start is None else start[place].copy()  # the search overwrites it
    if known is not None and known.any() and not (few or part.unloaded):
        # under a hardness a far smaller contact may not bear the load: coarser grids find a larger
        known = part.admissible(known)
    if known is None or not known.any():
        known = _even_pressure(part) if few else nested_start(part)
    solution = solve(part, known)
    if _is_whole(place, problem.interference):
        return solution
    pressure = np.zeros(shape)
    pressure[place] = solution.pressure
    return solution._replace(pressure=pressure, gap=None)


def _solve_nested(problem: CellProblem) -> ContactPressures:
    """Solve on the cells of a problem from nothing, by way of coarser grids."""
    return solve(problem, nested_start(problem))


def nested_start(problem: CellProblem) -> Array:
    """Return pressures to start from, shape (nx, ny).

    They come from a grid half as fine. On a small grid they are uniform and meet the loads.

    Args:
        problem: The contact problem.
    """
    shape = problem.interference.shape
    factors = [1 + (n > _FEW_CELLS) for n in shape]
    if max(factors) > 1:
        try:
            coarse = _solve_nested(problem.coarsened(factors, _ROUGH))
            fine = refined(coarse.pressure, factors)[: shape[0], : shape[1]]
            return np.ascontiguousarray(fine)
        except NotConverged:  # a bad start only costs time
            pass
    return _even_pressure(problem)


def _even_pressure(problem: CellProblem) -> Array:
    """Return uniform pressures that meet the loads."""
    total = float(np.abs(problem.motions.loads).max(initial=0.0))
    return np.full(problem.interference.shape, total / problem.interference.size)


def _whole(field: Array | Flags) -> Box:
    """Return the box of all cells."""
    return slice(0, field.shape[0]), slice(0, field.shape[1])


def _is_whole(place: Place, field: Array) -> bool:
    """Return whether a place is the box of all cells."""
    return isinstance(place[0], slice) and place == _whole(field)


_RATE_RESIDUAL = 3e-4
"""Largest error of the displacements relative to the approach. That of the sum is its square."""
_RATE_FORCING = 1e-2
"""Part of the present error that a solution of the elastic body leaves."""
_MOST_PASSES, _MOST_ITERATIONS = 12, 100


class ApproachRate(NamedTuple):
    """What a contact changes with the approach of the rigid body.

    Attributes:
        total: Derivative of the sum of pressures [MPa/mm]; NaN where the iteration does not
            converge or a period is in full contact.
        rates: Derivatives of pressures, shape (nx, ny) [MPa/mm].
        products: Products of the compliance.
        by_slopes: Derivative of what finite slopes add to the mean displacement of all cells.
    """

    total: float
    rates: Array
    products: int
    by_slopes: float = 0.0

    def mean_displacement(self, problem: CellProblem) -> float:
        """Return the derivative of the mean displacement of all cells by the approach.

        Single precision errs by 3e-7 of it.

        Args:
            problem: The contact problem.
        """
        if not self.rates.any():
            return 0.0
        grid = problem.compliance.on_grid(self.rates.shape, problem.spacing, rough=True)
        return float(grid.displacement(self.rates).mean()) + self.by_slopes


def approach_rate(problem: CellProblem, pressure: Array) -> ApproachRate:
    """Return what a contact changes with the approach of the rigid body.

    Args:
        problem: The contact problem; its free motions are those that turn with the approach.
        pressure: Its solution, pressures, shape (nx, ny) [MPa].
    """
    moving, rates = pressure > 0.0, np.zeros(pressure.shape)
    if not moving.any():
        return ApproachRate(0.0, rates, 0)
    if problem.compliance.periodic and moving.all():
        return ApproachRate(np.nan, rates, 0)  # equal pressures on all cells displace none
    few = problem.compliance.few_cells(pressure.shape, problem.spacing)
    if few is not None and not problem.motions.count and few.hold(pressure):
        loaded = pressure.ravel()[few.cells]
        rates.ravel()[few.cells] = rate = few.rate(loaded)
        return ApproachRate(float(rate.sum()), rates, 1, few.mean_slope_rate(loaded, rate))
    found = _rates(problem, pressure, moving, np.ones(int(moving.sum())), _RATE_RESIDUAL)
    rates[moving] = found.rate
    total = float(found.rate.sum() + found.rate @ found.left)
    return ApproachRate(total, rates, found.products, found.by_slopes)


def pressure_rates(
    problem: CellProblem, pressure: Array, closing: Array, residual: float
) -> tuple[Array, int]:
    """Return the derivatives of pressures where cells in contact close in, and what they took.

    Args:
        problem: The contact problem; its free motions, whose loads stay, follow.
        pressure: Its solution, pressures, shape (nx, ny) [MPa].
        closing: What the cells close in by, shape (nx, ny).
        residual: Largest part of it that is left.

    Returns:
        The derivatives of pressures, 0 out of contact, shape (nx, ny) [MPa/mm], NaN where the
        iteration does not converge, and the products of the compliance.
    """
    moving, rates = pressure > 0.0, np.zeros(pressure.shape)
    part = closing[moving]
    if not part.any():
        return rates, 0
    found = _rates(problem, pressure, moving, part, residual * float(np.abs(part).max()))
    rates[moving] = found.rate
    return rates, found.products


class _Rates(NamedTuple):
    """Derivatives of pressures and what they leave of displacements, (n,) both, and products.

    Last is what finite slopes add to the mean displacement of all cells.
    """

    rate: Array
    left: Array
    products: int
    by_slopes: float


def _rates(
    problem: CellProblem, pressure: Array, moving: Flags, closing: Array, residual: float
) -> _Rates:
    """Return the derivatives of the pressures of moving cells that close in.

    Args:
        problem: The contact problem.
        pressure: Its solution, shape (nx, ny).
        moving: The cells, shape (nx, ny).
        closing: What they close in by, shape (n,).
        residual: Largest part of it that is left.
    """
    place = place_of(problem, moving | (problem.interference > 0.0))
    part, flat = on_place(problem, place), np.flatnonzero(moving[place])
    shape, used = part.interference.shape, part.grid.products
    contact = ContactCells(part.grid, Cells.of(flat, shape), part.motions.modes_of(flat))

    def displacement(change: Array) -> tuple[Array, float]:
        """Return displacements of the moving cells, and the mean of all by slopes."""
        everywhere, here = np.zeros(pressure.shape), np.zeros(shape)
        here.ravel()[flat] = change
        moved = part.grid.displacement(here).ravel()[flat]
        if not problem.compliance.slopes:
            return moved, 0.0
        everywhere[moving] = change
        added = problem.compliance.slope_rate(pressure, everywhere)
        return moved + added[moving], float(added.mean())

    # conjugate gradients; solutions of the elastic body without finite slopes precondition them
    left, by_slopes, before = closing, 0.0, np.inf
    rate, direction, answer = np.zeros((3, len(flat)))
    for _ in range(_MOST_PASSES):
        size = float(np.abs(contact.balanced(left)).max())
        if size <= residual:
            return _Rates(rate, left, part.grid.products - used, by_slopes)
        stop = max(_RATE_FORCING * size, 0.25 * residual)
        step = contact.close(-left, stop=stop, limit=_MOST_ITERATIONS)
        direction = step - float(step @ answer) / before * direction
        answer, added = displacement(direction)
        before = float(direction @ answer)
        length = float(direction @ left) / before
        rate += length * direction
        by_slopes += length * added
        left = left - length * answer
    return _Rates(np.full(len(flat), np.nan), left, part.grid.products - used, np.nan)
