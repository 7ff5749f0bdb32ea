"""The flow through a map of gaps, by the linear solver that suits its size."""

from __future__ import annotations

from micro.flow.gap_flow import GapFlow, gap_flow
from support.arrays import Array
from support.network import Preconditioner, factorised

MOST_FACTORISED = 512**2
"""Cells of a map up to which a factorisation is used. On 512² cells a flow took 0.9 to 2.6 s with
it and 0.7 to 0.9 s with multigrid; on 1024² cells 5 to 15 s and 1.5 GB, and 4 to 7 s."""


def flow_solver(cells: int) -> Preconditioner:
    """Return multigrid for many cells where PETSc has hypre, and a factorisation otherwise.

    Args:
        cells: Number of cells.

    Note:
        PETSc starts on all ranks together: call this on all of them before one alone does.
    """
    if cells > MOST_FACTORISED:
        try:
            from macro.linear_solvers.options import has_hypre
            from macro.linear_solvers.scalar_multigrid import scalar_multigrid
        except ImportError:
            return factorised
        if has_hypre():
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
