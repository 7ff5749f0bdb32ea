"""How the force of a solved contact changes with the approach of the rigid body.

As long as the cells in contact stay the same, the contact is linear. An approach by 1 mm displaces
all of them by that, and free motions of the body, whose loads stay as they are, take up their part:

    (C p')_A = 1 + Σ_i q_i ℓ_i,    Σ p' ℓ_i = 0.

The sum of p' over the cells is the interfacial stiffness dF/dδ over E* and the area of a cell. On
cells the force is a piecewise linear function of the approach, and this is its derivative. From
pressures q that leave r = 1 − C q the sum is Σ q + Σ q r to second order in r, as C is symmetric.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

import numpy as np

from micro.boundary_elements.half_space_grid import Cells
from micro.complementarity.cell_problem import CellProblem
from micro.complementarity.conjugate_gradients import ContactCells
from micro.complementarity.solver import on_place, place_of
from support.arrays import Array

_RESIDUAL = 3e-4
"""Largest error of the displacements relative to the approach. That of the sum is its square."""
_FORCING = 1e-2
"""Part of the present error that a solution of the elastic body leaves."""
_MOST_PASSES, _MOST_ITERATIONS = 12, 100


def approach_stiffness(problem: CellProblem, pressure: Array) -> tuple[float, int]:
    """Return the derivative of the sum of the pressures by the approach, and what it took.

    Args:
        problem: The contact problem; its free motions are those that turn with the approach.
        pressure: Its solution, pressures / E*, shape (nx, ny).

    Returns:
        The derivative of the sum of pressures / E* [1/mm], NaN where the iteration does not
        converge or a period is in full contact, and the products of the compliance.
    """
    moving = pressure > 0.0
    if not moving.any():
        return 0.0, 0
    if problem.compliance.periodic and moving.all():
        return np.nan, 0  # equal pressures on all cells displace none
    few = problem.compliance.few_cells(pressure.shape, problem.spacing)
    if few is not None and not problem.motions.count and few.hold(pressure):
        return float(few.rate(pressure.ravel()[few.cells]).sum()), 1
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
    left = np.ones(len(flat))
    rate, direction, answer = np.zeros((3, len(flat)))
    before = np.inf
    for _ in range(_MOST_PASSES):
        size = float(np.abs(contact.balanced(left)).max())
        if size <= _RESIDUAL:
            return float(rate.sum() + rate @ left), part.grid.products - used
        stop = max(_FORCING * size, 0.25 * _RESIDUAL)
        step = contact.close(-left, stop=stop, limit=_MOST_ITERATIONS)
        direction = step - float(step @ answer) / before * direction
        answer = displacement(direction)
        before = float(direction @ answer)
        length = float(direction @ left) / before
        rate += length * direction
        left = left - length * answer
    return np.nan, part.grid.products - used
