"""Contact of the few cells that a rigid body can touch, by one matrix with the finite slopes.

The matrix holds what finite slopes do with the pressures that they have been worked out for, all
loads before included. Each solution adds its own pressures where they are new. What is left out
falls to a hundredth with every solution.

Theory: docs/theory.md, section 7.
"""

from __future__ import annotations

import numpy as np

from patchlaw.micro.complementarity.active_set import solve
from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures
from patchlaw.support.errors import NotConverged

_MOST_SOLUTIONS = 30
_CONVERGED = 3e-10
"""Change of these displacements at which the iteration ends, over the largest interference."""


def solved_on_few(problem: CellProblem, start: ContactPressures | None) -> ContactPressures | None:
    """Solve the contact of few cells, finite slopes included.

    Args:
        problem: The contact problem of all cells of a surface.
        start: A solution nearby.

    Returns:
        The solution; None where it is not known which few cells can touch, where others can,
        motions are free, or the iteration does not converge.
    """
    few = problem.compliance.few_cells(problem.interference.shape, problem.spacing)
    touchable = problem.interference.ravel() > 0.0
    if few is None or problem.motions.count or not touchable.any():
        return None
    inside = np.flatnonzero(touchable[few.cells])
    if len(inside) < np.count_nonzero(touchable):
        return None
    some = slice(0, len(inside)) if inside[-1] == len(inside) - 1 else inside
    largest = float(problem.interference.max())
    pressure, used = np.zeros(len(few.cells)), 0
    if start is not None:
        pressure[some] = start.pressure.ravel()[few.cells[some]]
        few.learn(pressure)
    compliance, converged = few.compliance(pressure), max(_CONVERGED, 3.0 * problem.tolerance)
    for _ in range(_MOST_SOLUTIONS):
        part = problem.among(few.cells[some], compliance.among(some))
        try:
            found = solve(part, pressure[some][:, None])
        except NotConverged:  # slopes too steep for the theory; the search for all cells tells
            return None
        used += found.iterations
        pressure = np.zeros(len(few.cells))
        pressure[some] = found.pressure.ravel()
        known = compliance.displacement_by_added(pressure)
        few.learn(pressure)
        compliance = few.compliance(pressure)
        change = compliance.displacement_by_added(pressure) - known
        changes = np.abs(np.broadcast_to(change, pressure.shape)[pressure > 0.0])
        changed = float(changes.max(initial=0.0)) / largest
        if changed <= converged:
            everywhere = np.zeros(problem.interference.shape)
            everywhere.ravel()[few.cells] = pressure
            return found._replace(
                pressure=everywhere,
                iterations=used,
                by_slopes=few.slope_displacement(pressure),
                residual=max(found.residual, changed),
            )
    return None
