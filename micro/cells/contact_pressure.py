"""Pressures of a rigid body on the half-space: p ≥ 0, gap ≥ 0, p · gap = 0 on every cell.

Passes of a primal-dual active set: cells with a pressure or a negative gap are taken as the
contact, its linear system is solved roughly by conjugate gradients, tensile pressures are dropped.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.cells.conjugate_gradients import ContactCells
from micro.cells.elastic_grid import Cells, ElasticGrid

Array = NDArray[np.float64]

_MOST_PASSES = 200
_MOST_ITERATIONS = 100
"""Iterations in a pass; an exact solution of a wrong set is of no use."""
_TRUSTING_PASSES = 20
"""Passes in which a step may raise the energy when it lowers the residual."""
_MOST_HALVINGS = 12
_FORCING = (0.2, 0.01)
"""Parts of the present error that a pass leaves of the gaps in a new set and in a set kept."""


class Pressures(NamedTuple):
    """Solution on the cells of a grid.

    Attributes:
        pressure: Pressures / E*, shape (nx, ny).
        approach: Approach of the body counted from where ``required`` was 0 [mm]; 0 when given.
        residual: Largest violation of the contact conditions over the largest displacement that
            the body asks for.
        iterations: Products of the compliance with pressures.
        passes: Sets of cells tried.
    """

    pressure: Array
    approach: float
    residual: float
    iterations: int
    passes: int


def contact_pressure(
    grid: ElasticGrid,
    required: Array,
    start: Array,
    *,
    total: float | None = None,
    tolerance: float,
) -> Pressures:
    """Find the pressures under a rigid body.

    The residual ε bounds the error of the force: the solution is exact for a body whose heights
    differ by no more than ε δ, so the force lies between those at (1 − ε) δ and (1 + ε) δ. A given
    force is met to round-off.

    Args:
        grid: The elastic half-space.
        required: Displacement d that the body asks for, shape (nx, ny) [mm]; negative where it
            is above the surface. With a given force up to a constant.
        start: Pressures / E* to start from, shape (nx, ny), not negative; positive somewhere when
            the force is given.
        total: Sum of pressures / E* over the cells when the force is given.
        tolerance: Largest residual.

    Raises:
        NotConverged: When the residual stays above the tolerance.

    Source:
        Hintermüller, Ito & Kunisch 2002, doi 10.1137/S1052623401383558; Polonsky & Keer 1999,
        doi 10.1016/S0043-1648(99)00113-1.
    """
    used = grid.products
    search = _Search(grid, required, total)
    search.accept(start if total is None else start * (total / start.sum()))
    for passes in range(_MOST_PASSES):
        if search.residual <= tolerance:
            return Pressures(
                search.pressure,
                search.approach,
                search.residual,
                grid.products - used,
                passes,
            )
        search.step(tolerance, cautious=passes >= _TRUSTING_PASSES)
    raise NotConverged(
        f"the contact pressure (residual {search.residual:.1e}, asked {tolerance:.1e})",
        reason="set of cells in contact not found",
        iterations=grid.products - used,
        remedy="raise the tolerance or take smaller steps of the approach",
    )


class _Search:
    """Pressures, gaps and errors while the set of cells in contact is sought."""

    def __init__(self, grid: ElasticGrid, required: Array, total: float | None) -> None:
        self.grid, self.required, self.total = grid, required, total
        self.highest = float(required.max())
        self.mask: NDArray[np.bool_] = np.zeros(required.shape, bool)

    def accept(self, pressure: Array) -> None:
        """Evaluate pressures, all ≥ 0 and with the total asked for."""
        self.pressure, self.touching = pressure, pressure > 0.0
        gap = self.grid.displacement(pressure)
        work = float(np.vdot(pressure, gap))
        asked = float(np.vdot(pressure, self.required))
        self.energy = work - 2.0 * asked  # twice the elastic less the external one
        self.approach = 0.0 if self.total is None else (work - asked) / self.total
        gap -= self.required
        gap -= self.approach
        self.gap = gap  # within the memory of the displacement
        self.scale = self.highest + self.approach
        worst = max(-float(gap.min()), float(gap[self.touching].max(initial=0.0)))
        self.residual = max(0.0, worst) / self.scale if self.scale > 0.0 else 0.0

    def step(self, tolerance: float, *, cautious: bool) -> None:
        """Solve on the present set and accept what it gives, shortened while that is no gain.

        Steps that lower the energy cannot return to where they were: a cautious search takes no
        others. It is needed where cells of very different sides meet the periodic kernel, whose
        inverse is then far from an M-matrix, for which the sets are known to converge.
        """
        mask = self.touching | (self.gap < 0.0)
        kept = np.array_equal(mask, self.mask)
        if not kept:
            given = self.total is not None
            self.mask = mask
            self.contact = ContactCells.among(self.grid, Cells.where(mask), force_given=given)
        cells = self.contact.cells.flat
        change = self.contact.close(
            self.gap.ravel()[cells],
            stop=max(_FORCING[kept] * self.residual, 0.25 * tolerance) * self.scale,
            limit=_MOST_ITERATIONS,
        )
        old, residual, energy = self.pressure, self.residual, self.energy
        for halving in range(_MOST_HALVINGS):
            self.accept(self._moved(old, cells, 0.5**halving * change))
            gain = self.energy < energy or (self.residual < residual and not cautious)
            if gain or self.residual <= tolerance:
                return

    def _moved(self, old: Array, cells: NDArray[np.intp], change: Array) -> Array:
        new = np.zeros(old.shape)
        new.ravel()[cells] = np.maximum(old.ravel()[cells] + change, 0.0)
        if self.total is not None:
            new *= self.total / new.sum()
        return new
