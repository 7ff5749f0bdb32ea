"""Pressures that a search starts from: within their bounds, and meeting their loads.

Where the approach is prescribed and the tilt is free, no load presses the body. Either it turns
until it is clear of the surface, or some cells hold it: a linear programme tells which.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from patchlaw.micro.complementarity.cell_problem import CellProblem, Motions
from patchlaw.support import Array, NotConverged

_EVEN_SHARES = 0.0, *np.logspace(-3.0, 6.0, 10)
"""Shares of uniform pressure that are added, one after the other, until a start meets the loads."""
_MOST_CONDITIONS = 500
_MOST_MOTION = 100.0
"""Bound of the motions, relative to the largest interference. It keeps the programme finite while
it has the conditions of few cells only."""
_CLEARANCE_ROUNDING = 1e-13


def admissible_start(problem: CellProblem, pressure: Array) -> tuple[Array, Array]:
    """Return admissible pressures near given ones, and the free motions if nothing touches.

    Args:
        problem: The contact problem.
        pressure: Pressures ≥ 0, shape (nx, ny) [MPa]; may be overwritten.

    Raises:
        NotConverged: When no pressures within the bounds meet the loads.
    """
    if problem.unloaded:
        return _unloaded_start(problem, pressure)
    for share in _EVEN_SHARES:
        even = share * (float(pressure.max()) or 1.0)
        admissible = problem.admissible(pressure + even if share else pressure)
        if admissible is not None:
            return admissible, np.zeros(problem.motions.count)
    turns = problem.motions.turns and np.any(problem.motions.loads[1:])
    raise NotConverged(
        "the pressures to start from",
        reason="no pressures within their bounds meet the loads on these cells",
        iterations=0,
        remedy="let the force act within the face, by smaller moments"
        if turns
        else "give a smaller force",
    )


def _unloaded_start(problem: CellProblem, pressure: Array) -> tuple[Array, Array]:
    """Start a body that turns without load from pressures of negative energy.

    The energy without pressure is zero. A body that cannot turn clear must not come to that point,
    for no single contact can carry it from there. Steps that lower the energy never do.
    """
    admissible = problem.admissible(pressure)
    if admissible is None or float(np.vdot(admissible, problem.interference)) <= 0.0:
        clear = clearance(problem.interference, problem.motions)
        if clear.interference <= 0.0:
            return np.zeros(pressure.shape), clear.motion
        admissible = clear.support
    twice_elastic = float(np.vdot(admissible, problem.grid.displacement(admissible)))
    factor = float(np.vdot(admissible, problem.interference)) / twice_elastic  # of the least energy
    admissible = admissible * min(factor, problem.hardness / float(admissible.max()))
    balanced = problem.admissible(admissible)
    return admissible if balanced is None else balanced, np.zeros(problem.motions.count)


class Clearance(NamedTuple):
    """The free motions that make the largest interference as small as possible.

    Attributes:
        motion: The motions, shape (k,) [mm].
        interference: Largest interference then [mm]; the body is clear where it is not positive.
        support: Shares of the force of the cells that hold the body there, which have no load along
            any motion, shape (nx, ny).
    """

    motion: Array
    interference: float
    support: Array


def clearance(interference: Array, motions: Motions) -> Clearance:
    """Find how far a body can come clear of a surface by its free motions.

    It is a linear programme in the motions and the largest interference, with one condition for
    every cell. Cells that violate the motions found so far most are added one by one. The start of
    a plane on few peaks (`Peaks`) is the same programme with all conditions at once.

    Args:
        interference: Interference where the motions are 0, shape (nx, ny) [mm].
        motions: Free motions; the approach is not among them.
    """
    size = float(np.abs(interference).max()) or 1.0
    scaled = interference / size  # the programme's tolerances are absolute
    cells: list[int] = []
    motion, shares, bound = np.zeros(motions.count), np.zeros(0), -np.inf
    limits = [(-_MOST_MOTION, _MOST_MOTION)] * motions.count + [(None, None)]
    for _ in range(_MOST_CONDITIONS):
        now = scaled + motions.displacement(motion)
        worst = int(np.argmax(now))
        if worst in cells or now.ravel()[worst] <= bound + _CLEARANCE_ROUNDING:
            break
        cells.append(worst)
        modes = motions.modes_of(np.array(cells)).T
        programme = scipy.optimize.linprog(
            np.append(np.zeros(motions.count), 1.0),
            A_ub=np.column_stack((modes, -np.ones(len(cells)))),
            b_ub=-scaled.ravel()[cells],
            bounds=limits,
            method="highs-ds",
        )
        motion, bound = np.asarray(programme.x[:-1]), float(programme.x[-1])
        shares = np.maximum(-np.asarray(programme.ineqlin.marginals), 0.0)
    support = np.zeros(interference.shape)
    support.ravel()[cells[: len(shares)]] = shares
    motion = size * motion
    largest = float((interference + motions.displacement(motion)).max())
    return Clearance(motion, largest, support)
