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
from numpy.typing import NDArray

from micro.compliance.half_space_grid import Cells
from micro.contact.conjugate_gradients import ContactCells
from micro.contact.problem import ContactProblem
from micro.contact.solver import box_around

Array = NDArray[np.float64]

_RESIDUAL = 3e-4
"""Largest error of the displacements relative to the approach. That of the sum is its square."""
_FORCING = 1e-2
"""Part of the present error that a solution leaves; finite slopes change by as much in a pass."""
_MOST_PASSES, _MOST_ITERATIONS = 12, 100


def approach_stiffness(problem: ContactProblem, pressure: Array) -> tuple[float, int]:
    """Return the derivative of the sum of the pressures by the approach, and what it took.

    Args:
        problem: The contact problem; its free motions are those that turn with the approach.
        pressure: Its solution, pressures / E*, shape (nx, ny).

    Returns:
        The derivative of the sum of pressures / E* [1/mm], NaN where the iteration does not
        converge, and the products of the compliance.
    """
    moving = pressure > 0.0
    if not moving.any():
        return 0.0, 0
    whole = problem.compliance.periodic
    box = box_around(moving | (problem.interference > 0.0) | whole)
    part, flat = problem.on(box), np.flatnonzero(moving[box])
    shape = part.interference.shape
    contact = ContactCells(part.grid, Cells.of(flat, shape), part.motions.levers_of(flat))
    rate = np.zeros(pressure.shape)
    left = np.ones(len(flat))
    for _ in range(_MOST_PASSES):
        stop = max(_FORCING * float(np.abs(left).max()), 0.25 * _RESIDUAL)
        change = np.zeros(shape)
        change.ravel()[flat] = contact.close(-left, stop=stop, limit=_MOST_ITERATIONS)
        rate[box] += change
        moved = part.grid.displacement(rate[box])
        if problem.compliance.slopes is not None:
            moved += problem.compliance.slope_rate(pressure, rate)[box]
        left = 1.0 - moved.ravel()[flat]
        if float(np.abs(contact.balanced(left)).max()) <= _RESIDUAL:
            found = rate[box].ravel()[flat]
            return float(found.sum() + found @ left), part.grid.products
    return np.nan, part.grid.products
