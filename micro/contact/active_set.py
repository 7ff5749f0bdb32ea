"""Search for the cells in contact: pressures, gaps and what is wrong with them, step by step.

A step takes cells with a pressure or a negative gap as the contact, solves its linear system
roughly by conjugate gradients and drops tensile pressures (primal-dual active set). A body that may
turn on few cells is held by each of them: there cells are dropped one at a time (primal active
set), so that no step leaves it without support.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from micro.compliance.elastic_grid import Cells, ElasticGrid
from micro.contact.conjugate_gradients import ContactCells
from micro.contact.constraints import Limits

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

_MOST_ITERATIONS = 100
"""Iterations in a pass; an exact solution of a wrong set is of no use."""
_MOST_HALVINGS = 12
_FEW = 6
"""Cells that carry a body free to turn below which they are dropped one at a time: of 300 planes
that hardly touch (1e-5 … 1e-3 of the largest force) the slowest took 9 times the products of the
level plane, 74 times when that waits until a step fails; with 12 the median doubles."""
_HELD = 1e-8
"""Weight of cells that touch without pressure, of the largest pressure, in the body's motions."""
_NOISE = 1e-12
"""Changes of a pressure at a bound that are rounding, of the largest pressure: loads that must stay
as they are may leave a cell none."""
_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Part of the largest distance of a plane free to turn that its gaps are known to."""
_FORCING = (0.2, 0.01)
"""Parts of the present error that a pass leaves of the gaps in a new set and in a set kept."""


class ContactSearch:
    """Pressures on cells and how far they are from a solution.

    Args:
        grid: The elastic body.
        required: Displacement that the body asks for, up to its free motions, (nx, ny) [mm].
        limits: Bounds and loads of the pressures.
        pressure: Pressures / E* to begin with, within these limits, shape (nx, ny).
        motion: Free motions while nothing touches, shape (k,) [mm].

    Attributes:
        pressure: Present pressures / E*, which are within their limits, shape (nx, ny).
        motion: Free motions of the body that close the gaps best, shape (k,) [mm].
        gap: Gaps, shape (nx, ny) [mm].
        scale: Largest displacement that the body asks for [mm].
        residual: Largest violation of the contact conditions, over the scale.
        rounding: Residual by the rounding of distances.
    """

    def __init__(
        self, grid: ElasticGrid, required: Array, limits: Limits, pressure: Array, motion: Array
    ) -> None:
        self.grid, self.required, self.limits = grid, required, limits
        self.motion = motion
        self._singly = False  # from where a step of all cells at once gained nothing
        self._held: Indices = np.zeros(0, np.intp)  # at a bound without a gap
        self._mask: Flags = np.zeros(required.shape, bool)
        self._yielding: Flags | None = None
        self._accept(pressure)

    def _accept(self, pressure: Array) -> None:
        """Evaluate pressures within their bounds that meet the loads."""
        self.pressure = pressure
        gap = self.grid.displacement(pressure)
        work = float(np.vdot(pressure, gap))
        asked = float(np.vdot(pressure, self.required))
        self._energy = work - 2.0 * asked  # twice the elastic less the external one
        gap -= self.required
        highest = self.required
        if self.limits.motions is not None:
            if pressure.any():
                self.motion = self.limits.motions.closing(self._closing(pressure), gap)
            nearer = self.limits.motions.displacement(self.motion)
            gap -= nearer
            highest = self.required + nearer
        self.gap = gap  # within the memory of the displacement
        self.scale = float(highest.max())
        elastic = gap if self.limits.upper == np.inf else gap[pressure < self.limits.upper]
        worst = max(-float(elastic.min(initial=0.0)), float(gap[pressure > 0.0].max(initial=0.0)))
        self.residual = max(0.0, worst) / self.scale if self.scale > 0.0 else 0.0
        self.rounding = 0.0
        if self.limits.turns and self.scale > 0.0:
            self.rounding = _ROUNDING * float(np.abs(highest).max()) / self.scale

    def _closing(self, pressure: Array) -> Array:
        """Return weights of the cells whose gaps tell the motions: yielding cells may overlap."""
        weights = pressure
        if self.limits.upper < np.inf and (pressure < self.limits.upper).any(where=pressure > 0.0):
            weights = np.where(pressure < self.limits.upper, pressure, 0.0)
        if self._held.size:
            weights = weights.copy()
            weights.ravel()[self._held] += _HELD * float(pressure.max())
        return weights

    def step(self, tolerance: float, *, cautious: bool) -> None:
        """Solve on the cells that seem to touch and accept what that gives.

        Args:
            tolerance: Largest residual asked for.
            cautious: Whether no step may raise the energy. Steps that lower it cannot return to
                where they were: that is needed where cells of very different sides meet the
                periodic kernel, whose inverse is then far from an M-matrix, for which the sets are
                known to converge.
        """
        if not self._singly and not self._few():
            old = self.pressure
            if self._step_together(tolerance, cautious=cautious or self.limits.unloaded):
                return
            if not self.limits.turns:
                return
            self._singly = True
            self._accept(old)
        self._step_singly(tolerance)

    def _few(self) -> bool:
        """Whether so few cells carry a body that may turn that none is to be lost by chance."""
        return self.limits.turns and np.count_nonzero(self.pressure) <= _FEW

    def _step_together(self, tolerance: float, *, cautious: bool) -> bool:
        """Move all cells at once, by less while that is no gain; tell whether it was one."""
        mask = self._touching()
        kept = np.array_equal(mask, self._mask)
        if not kept:
            self._mask, self._contact = mask, self._among(np.flatnonzero(mask))
        cells = self._contact.cells.flat
        change = self._contact.close(
            self.gap.ravel()[cells], stop=self._stop(tolerance, kept), limit=_MOST_ITERATIONS
        )
        old, residual, energy = self.pressure, self.residual, self._energy
        for halving in range(_MOST_HALVINGS):
            moved = self._moved(old, cells, 0.5**halving * change)
            if moved is None:
                continue
            self._accept(moved)
            gain = self._energy < energy or (self.residual < residual and not cautious)
            if gain or self.residual <= max(tolerance, self.rounding):
                return True
        return False

    def _step_singly(self, tolerance: float) -> None:
        """Close the gaps of cells, dropping one at a time that would leave its bounds.

        Each move keeps the loads and lowers the energy, however few cells carry the body: what
        drops many at once may leave it on a single contact, which cannot hold it. Cells that stay
        at a bound without a gap tell how a body turns that lies on two contacts and the middle
        between.
        """
        cells, old = self._carrying(), self.pressure
        new, stop = old.copy(), self._stop(tolerance, kept=True)
        pressure, gap = old.ravel()[cells], self.gap.ravel()[cells]
        for _ in range(len(cells)):
            contact = self._among(cells)
            change = contact.close(gap, stop=stop, limit=_MOST_ITERATIONS)
            bound = (pressure <= 0.0) | (pressure >= self.limits.upper)
            change[bound & (np.abs(change) <= _NOISE * old.max())] = 0.0
            first, part = _first_bounds(pressure, change, self.limits.upper)
            if part > 0.0:
                pressure = np.clip(pressure + part * change, 0.0, self.limits.upper)
                gap = gap + part * self.grid.comply(contact.cells, change)
            if part == 1.0:
                break
            new.ravel()[cells[first]] = np.where(change[first] > 0.0, self.limits.upper, 0.0)
            left = np.ones(len(cells), bool)
            left[first] = False
            cells, pressure, gap = cells[left], pressure[left], gap[left]
        new.ravel()[cells] = pressure
        self._held = cells[(pressure <= 0.0) | (pressure >= self.limits.upper)]
        found = self.limits.met(new, self._yielding)
        self._accept(old if found is None else found)

    def _carrying(self) -> Indices:
        """Return the cells that carry between the bounds, and as many with the worst gaps."""
        touching = self._touching()
        carry = touching & (self.pressure > 0.0) & (self.pressure < self.limits.upper)
        carry.ravel()[self._held] = True
        entering = np.flatnonzero(touching & ~carry)
        worst = np.argsort(-np.abs(self.gap.ravel()[entering]), kind="stable")
        entering = entering[worst[: max(1, np.count_nonzero(carry))]]
        return np.union1d(np.flatnonzero(carry), entering)

    def _touching(self) -> Flags:
        """Return the cells to find pressures of; those that yield are not among them."""
        mask = (self.pressure > 0.0) | (self.gap < 0.0)
        if self.limits.upper < np.inf:
            self._yielding = (self.pressure >= self.limits.upper) & (self.gap <= 0.0)
            mask &= ~self._yielding
        mask.ravel()[self._held] = True
        return mask

    def _stop(self, tolerance: float, kept: bool) -> float:
        """Return the largest gap that a linear solution leaves [mm]."""
        return max(_FORCING[kept] * self.residual, 0.25 * tolerance) * self.scale

    def _among(self, flat: Indices) -> ContactCells:
        """Return the linear problem of some cells by their flat indices."""
        cells = Cells.of(flat, self.required.shape)
        levers = np.empty((0, flat.size))
        if self.limits.motions is not None:
            levers = self.limits.motions.levers_of(flat)
        return ContactCells.among(self.grid, cells, levers)

    def _moved(self, old: Array, cells: Indices, change: Array) -> Array | None:
        """Return pressures after a change of some, within their limits; None where none are."""
        new = old.copy()
        new.ravel()[cells] = np.clip(old.ravel()[cells] + change, 0.0, self.limits.upper)
        return self.limits.met(new, self._yielding)


def _first_bounds(pressure: Array, change: Array, upper: float) -> tuple[Indices, float]:
    """Return which cells a change drives out of their bounds first, and the part that it may do.

    Of those that are at their bound already, it is the half that is driven most.
    """
    room = np.where(change < 0.0, pressure, upper - pressure)
    size = np.abs(change)
    stuck = np.flatnonzero((room <= 0.0) & (size > 0.0))
    if stuck.size:
        most = np.argsort(-size[stuck], kind="stable")[: (stuck.size + 1) // 2]
        return stuck[most], 0.0
    ways = np.divide(room, size, out=np.full_like(change, np.inf), where=size > 0.0)
    first = int(np.argmin(ways))
    return np.array([first]), min(1.0, float(ways[first]))
