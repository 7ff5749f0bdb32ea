"""How the force of a solved contact changes with the approach of the rigid body.

As long as the cells in contact stay the same, the contact is linear. An approach by 1 mm displaces
all of them by that, and free motions of the body, whose loads stay as they are, take up their part:

    (C p')_A = 1 + Σ_i q_i ℓ_i,    Σ p' ℓ_i = 0.

The sum of p' over the cells is the interfacial stiffness dF/dδ over the area of a cell. On
cells the force is a piecewise linear function of the approach, and this is its derivative. From
pressures q that leave r = 1 − C q the sum is Σ q + Σ q r to second order in r, as C is symmetric.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.complementarity.cell_problem import CellProblem
from patchlaw.micro.complementarity.conjugate_gradients import ContactCells
from patchlaw.micro.complementarity.solver import on_place, place_of
from patchlaw.support.arrays import Array, Flags

_RESIDUAL = 3e-4
"""Largest error of the displacements relative to the approach. That of the sum is its square."""
_FORCING = 1e-2
"""Part of the present error that a solution of the elastic body leaves."""
_MOST_PASSES, _MOST_ITERATIONS = 12, 100


class ApproachRate(NamedTuple):
    """What a contact changes with the approach of the rigid body.

    Attributes:
        total: Derivative of the sum of pressures [MPa/mm]; NaN where the iteration does not
            converge or a period is in full contact.
        rates: Derivatives of pressures, shape (nx, ny) [MPa/mm].
        products: Products of the compliance.
    """

    total: float
    rates: Array
    products: int

    def mean_displacement(self, problem: CellProblem, pressure: Array) -> float:
        """Return the derivative of the mean displacement of all cells by the approach.

        Single precision errs by 3e-7 of it.

        Args:
            problem: The contact problem.
            pressure: Its solution, pressures, shape (nx, ny) [MPa].
        """
        compliance, rates = problem.compliance, self.rates
        grid = compliance.on_grid(rates.shape, problem.spacing, rough=True)
        moved = float(grid.displacement(rates).mean()) if rates.any() else 0.0
        if compliance.slopes and rates.any():
            moved += float(compliance.slope_rate(pressure, rates).mean())
        return moved


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
        rates.ravel()[few.cells] = few.rate(pressure.ravel()[few.cells])
        return ApproachRate(float(rates.sum()), rates, 1)
    found = _rates(problem, pressure, moving, np.ones(int(moving.sum())), _RESIDUAL)
    rates[moving] = found.rate
    total = float(found.rate.sum() + found.rate @ found.left)
    return ApproachRate(total, rates, found.products)


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
    """Derivatives of pressures, what they leave of displacements, and products; (n,) each."""

    rate: Array
    left: Array
    products: int


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

    def displacement(change: Array) -> Array:
        """Return the displacements of the moving cells by a change of their pressures."""
        everywhere, here = np.zeros(pressure.shape), np.zeros(shape)
        here.ravel()[flat] = change
        moved = part.grid.displacement(here).ravel()[flat]
        if problem.compliance.slopes:
            everywhere[moving] = change
            moved += problem.compliance.slope_rate(pressure, everywhere)[moving]
        return moved

    # conjugate gradients; solutions of the elastic body without finite slopes precondition them
    left = closing
    rate, direction, answer = np.zeros((3, len(flat)))
    before = np.inf
    for _ in range(_MOST_PASSES):
        size = float(np.abs(contact.balanced(left)).max())
        if size <= residual:
            return _Rates(rate, left, part.grid.products - used)
        stop = max(_FORCING * size, 0.25 * residual)
        step = contact.close(-left, stop=stop, limit=_MOST_ITERATIONS)
        direction = step - float(step @ answer) / before * direction
        answer = displacement(direction)
        before = float(direction @ answer)
        length = float(direction @ left) / before
        rate += length * direction
        left = left - length * answer
    return _Rates(np.full(len(flat), np.nan), left, part.grid.products - used)
