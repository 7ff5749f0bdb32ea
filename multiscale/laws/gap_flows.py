"""The flow through a map of gaps, by the linear solver that suits its size."""

from __future__ import annotations

import sys

import numpy as np

from patchlaw.micro.transport import GapFlow, gap_flow
from patchlaw.support.arrays import Array
from patchlaw.support.network import Preconditioner, factorised

MOST_FACTORISED, MOST_BY_CHOLESKY = 128**2, 2**19
"""Cells of a map up to which SuperLU's factors are used where PETSc is not loaded, as loading it
takes longer; and up to which CHOLMOD's are, where PETSc has it. A flow took 40 to 70 ms of CPU by
SuperLU, 25 to 48 by CHOLMOD and 66 to 74 by multigrid on 128² cells; 0.32 to 0.45, 0.15 to 0.21 and
0.31 s on 256², and by the last two 0.6 to 0.9 and 1.4 s on 512² cells."""

_CELL, _CELL_FACTORISED = 1100.0, 1500.0
"""Memory of a cell of a flow [B]: 500 to 690 were measured by multigrid on 256² and 512² cells, up
to 1060 by CHOLMOD, and 1360 to 1610 by SuperLU on 192² and 128²."""


def flow_memory(cells: int) -> float:
    """Return the memory that a flow through a map of gaps takes [B].

    Args:
        cells: Number of cells.
    """
    return cells * (_CELL if cells > MOST_FACTORISED else _CELL_FACTORISED)


_QUARTER, _LEAST, _ENDS = 0.75, 0.02, 2.0
"""Parts that the error of a flow is at least: of what a grid a quarter as fine changes against one
half as fine, as either change may vanish by chance; of the flow; and of the flow where one of these
grids is closed, next to the end of all channels, where it falls by orders of magnitude."""


def error_of_grid(flow: Array, half: Array, quarter: Array) -> Array:
    """Return what flows through gaps may be off by as cells are not finer.

    The largest counts of what grids half and a quarter as fine tell; see the constants above for
    how much. They were set on 110 surfaces of 32² to 48² cells, 5 to 16 of them along the shortest
    wave, against four times as many cells a side: the true error was within 1.5 times this on 98 %
    of 650 flows, where the change on half as many cells alone held 88 %, and this was 4.7 times
    the true one in the median. On 28 other surfaces it held 99 % of 168
    (`benchmarks/leak_error.py`).

    Args:
        flow: Flows, or transmissivities, of any shape.
        half: The same on half as many cells a side.
        quarter: The same on a quarter as many.
    """
    error = np.maximum(np.abs(flow - half), _QUARTER * np.abs(half - quarter))
    error = np.maximum(error, _LEAST * flow)
    ends = (half == 0.0) | (quarter == 0.0)
    return np.where(ends, np.maximum(error, _ENDS * np.maximum(flow, half)), error)


def flow_solver(cells: int) -> Preconditioner:
    """Return CHOLMOD's factors, or multigrid for many cells, where PETSc has them; else SuperLU's.

    Args:
        cells: Number of cells.

    Note:
        PETSc starts on all ranks together: call this on all of them before one alone does.
    """
    if cells > MOST_FACTORISED or "petsc4py.PETSc" in sys.modules:
        try:
            from patchlaw.macro.linear_solvers.options import has_cholmod, has_hypre
            from patchlaw.macro.linear_solvers.solvers import scalar_cholesky, scalar_multigrid
        except ImportError:
            return factorised
        if has_cholmod() and cells <= MOST_BY_CHOLESKY:
            return scalar_cholesky
        if has_hypre() and cells > MOST_FACTORISED:
            return scalar_multigrid
    return factorised


def solved_gap_flow(
    gap: Array, lengths: tuple[float, float], direction: str, *, periodic: bool
) -> GapFlow:
    """Solve Reynolds' equation on a map of gaps.

    Args:
        gap: Gaps of the cells, 0 in contact, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
        direction: Axis along which the fluid flows, ``"x"`` or ``"y"``.
        periodic: Whether the map continues over the sides along the flow.

    Raises:
        NotConverged: When what enters and leaves the cells does not balance.
    """
    axis, solver = "xy".index(direction), flow_solver(gap.size)
    return gap_flow(gap, lengths, axis=axis, periodic=periodic, preconditioner=solver)
