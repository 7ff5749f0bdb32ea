"""Pressures of a rigid body on an elastic one: p ≥ 0, gap ≥ 0, p · gap = 0 on every cell.

Passes of a primal-dual active set: cells with a pressure or a negative gap are taken as the
contact, its linear system is solved roughly by conjugate gradients, tensile pressures are dropped.
Pressures may be bounded from above: where p = H the gap may be negative, as material yields.
Motions of the body that are free are unknowns of the same problem (`micro.cells.motions`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.cells.clear_plane import clearance
from micro.cells.conjugate_gradients import ContactCells
from micro.cells.elastic_grid import Cells, ElasticGrid
from micro.cells.motions import Motions

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

_MOST_PASSES = 200
_MOST_ITERATIONS = 100
"""Iterations in a pass; an exact solution of a wrong set is of no use."""
_TRUSTING_PASSES = 20
"""Passes in which a step may raise the energy when it lowers the residual."""
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
_LEAST_EVEN, _MOST_EVEN = 1e-3, 1e6
"""Shares of even pressure that are tried with a start which cannot meet the loads."""
_FORCING = (0.2, 0.01)
"""Parts of the present error that a pass leaves of the gaps in a new set and in a set kept."""


class Pressures(NamedTuple):
    """Solution on the cells of a grid.

    Attributes:
        pressure: Pressures / E*, shape (nx, ny).
        motion: Free motions of the body counted from where ``required`` was, shape (k,) [mm].
        residual: Largest violation of the contact conditions over the largest displacement that
            the body asks for.
        iterations: Products of the compliance with pressures.
        passes: Sets of cells tried.
    """

    pressure: Array
    motion: Array
    residual: float
    iterations: int
    passes: int


def contact_pressure(
    grid: ElasticGrid,
    required: Array,
    start: Array,
    *,
    motions: Motions | None = None,
    upper: float = np.inf,
    tolerance: float,
) -> Pressures:
    """Find the pressures under a rigid body.

    The residual ε bounds the error of the force: the solution is exact for a body whose heights
    differ by no more than ε δ, so the force lies between those at (1 − ε) δ and (1 + ε) δ. Given
    loads are met to round-off.

    Args:
        grid: The elastic body.
        required: Displacement d that the body asks for, shape (nx, ny) [mm]; negative where it
            is above the surface. Up to free motions of the body.
        start: Pressures / E* to start from, shape (nx, ny), not negative.
        motions: Motions of the body that are free, with their loads; none when not given.
        upper: Upper bound of the pressures / E*.
        tolerance: Largest residual.

    Raises:
        NotConverged: When the residual stays above the tolerance, or no pressures within their
            bounds meet the loads.

    Source:
        Hintermüller, Ito & Kunisch 2002, doi 10.1137/S1052623401383558; Polonsky & Keer 1999,
        doi 10.1016/S0043-1648(99)00113-1.
    """
    used = grid.products
    search = _Search(grid, required, motions, upper)
    search.begin(start)
    for passes in range(_MOST_PASSES):
        if search.residual <= max(tolerance, search.rounding):
            return Pressures(
                search.pressure,
                search.motion,
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

    def __init__(
        self, grid: ElasticGrid, required: Array, motions: Motions | None, upper: float
    ) -> None:
        self.grid, self.required, self.motions, self.upper = grid, required, motions, upper
        self.motion = np.zeros(0 if motions is None else len(motions.loads))
        self.unloaded = motions is not None and not motions.loads.any()
        self.careful = False
        self.held: Indices = np.zeros(0, np.intp)
        self.mask: Flags = np.zeros(required.shape, bool)
        self.yielding: Flags | None = None

    def begin(self, start: Array) -> None:
        """Evaluate the start; where it cannot meet the loads, with a share of even pressure."""
        if self.unloaded:
            self._begin_unloaded(start)
            return
        share = 0.0
        while True:
            even = share * (float(start.max()) or 1.0)
            pressure = self._admissible(start + even if share else start)
            if pressure is not None:
                self.accept(pressure)
                return
            if share > _MOST_EVEN:
                raise NotConverged(
                    "the pressures to start from",
                    reason="no pressures within their bounds meet the loads on these cells",
                    iterations=0,
                    remedy="give a smaller force",
                )
            share = 10.0 * share or _LEAST_EVEN

    def _begin_unloaded(self, start: Array) -> None:
        """Start a body that turns without load where pressures already lower the energy.

        Without pressure the energy is 0, a point that a body which cannot turn clear must not come
        to: no single contact can carry it from there.
        """
        assert self.motions is not None
        pressure = self._admissible(start)
        if pressure is None or float(np.vdot(pressure, self.required)) <= 0.0:
            found = clearance(self.required, self.motions)
            if found.overlap <= 0.0:
                self.motion = found.motion
                self.accept(np.zeros(start.shape))
                return
            pressure = found.support
        work = float(np.vdot(pressure, self.grid.displacement(pressure)))
        best = float(np.vdot(pressure, self.required)) / work
        pressure = pressure * min(best, self.upper / float(pressure.max()))
        balanced = self._admissible(pressure)
        self.accept(pressure if balanced is None else balanced)

    def accept(self, pressure: Array) -> None:
        """Evaluate pressures within their bounds that meet the loads."""
        self.pressure = pressure
        gap = self.grid.displacement(pressure)
        work = float(np.vdot(pressure, gap))
        asked = float(np.vdot(pressure, self.required))
        self.energy = work - 2.0 * asked  # twice the elastic less the external one
        gap -= self.required
        highest = self.required
        if self.motions is not None:
            if pressure.any():
                self.motion = self.motions.best(self._closing(pressure), gap)
            nearer = self.motions.nearer(self.motion)
            gap -= nearer
            highest = self.required + nearer
        self.gap = gap  # within the memory of the displacement
        self.scale = float(highest.max())
        lowest = gap.min() if self.upper == np.inf else gap[pressure < self.upper].min(initial=0.0)
        worst = max(-float(lowest), float(gap[pressure > 0.0].max(initial=0.0)))
        self.residual = max(0.0, worst) / self.scale if self.scale > 0.0 else 0.0
        self.rounding = 0.0
        if self.motions is not None and self.motions.turns and self.scale > 0.0:
            self.rounding = _ROUNDING * float(np.abs(highest).max()) / self.scale

    def _closing(self, pressure: Array) -> Array:
        """Return weights of the cells whose gaps tell the motions: yielding cells may overlap."""
        weights = pressure
        if self.upper < np.inf and (pressure < self.upper).any(where=pressure > 0.0):
            weights = np.where(pressure < self.upper, pressure, 0.0)
        if self.held.size:
            weights = weights.copy()
            weights.ravel()[self.held] += _HELD * float(pressure.max())
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
        if not self.careful and not self._few():
            old = self.pressure
            if self._step_together(tolerance, cautious=cautious or self.unloaded):
                return
            if self.motions is None or not self.motions.turns:
                return
            self.careful = True
            self.accept(old)
        self._step_singly(tolerance)

    def _few(self) -> bool:
        """Whether so few cells carry a body that may turn that none is to be lost by chance."""
        turns = self.motions is not None and self.motions.turns
        return turns and np.count_nonzero(self.pressure) <= _FEW

    def _step_together(self, tolerance: float, *, cautious: bool) -> bool:
        """Move all cells at once, by less while that is no gain; tell whether it was one."""
        mask = self._touching()
        kept = np.array_equal(mask, self.mask)
        if not kept:
            self.mask, self.contact = mask, self._among(np.flatnonzero(mask))
        cells = self.contact.cells.flat
        change = self.contact.close(
            self.gap.ravel()[cells], stop=self._stop(tolerance, kept), limit=_MOST_ITERATIONS
        )
        old, residual, energy = self.pressure, self.residual, self.energy
        for halving in range(_MOST_HALVINGS):
            moved = self._moved(old, cells, 0.5**halving * change)
            if moved is None:
                continue
            self.accept(moved)
            gain = self.energy < energy or (self.residual < residual and not cautious)
            if gain or self.residual <= max(tolerance, self.rounding):
                return True
        return False

    def _step_singly(self, tolerance: float) -> None:
        """Close the gaps of cells, dropping one at a time that would leave its bounds.

        Each move keeps the loads and lowers the energy, however few cells carry the body: what
        drops many at once may leave it on a single contact, which cannot hold it. As many cells
        come in as carry, those with the worst gaps. Cells that stay at a bound without a gap tell
        how a body turns that lies on two contacts and the middle between.
        """
        touching, old = self._touching(), self.pressure
        carry = touching & (old > 0.0) & (old < self.upper)
        carry.ravel()[self.held] = True
        entering = np.flatnonzero(touching & ~carry)
        worst = np.argsort(-np.abs(self.gap.ravel()[entering]), kind="stable")
        entering = entering[worst[: max(1, np.count_nonzero(carry))]]
        cells = np.union1d(np.flatnonzero(carry), entering)
        new, stop = old.copy(), self._stop(tolerance, kept=True)
        pressure, gap = old.ravel()[cells], self.gap.ravel()[cells]
        for _ in range(len(cells)):
            contact = self._among(cells)
            change = contact.close(gap, stop=stop, limit=_MOST_ITERATIONS)
            bound = (pressure <= 0.0) | (pressure >= self.upper)
            change[bound & (np.abs(change) <= _NOISE * old.max())] = 0.0
            first, part = _first_bounds(pressure, change, self.upper)
            if part > 0.0:
                pressure = np.clip(pressure + part * change, 0.0, self.upper)
                gap = gap + part * self.grid.comply(contact.cells, change)
            if part == 1.0:
                break
            new.ravel()[cells[first]] = np.where(change[first] > 0.0, self.upper, 0.0)
            left = np.ones(len(cells), bool)
            left[first] = False
            cells, pressure, gap = cells[left], pressure[left], gap[left]
        new.ravel()[cells] = pressure
        self.held = cells[(pressure <= 0.0) | (pressure >= self.upper)]
        found = self._admissible(new)
        self.accept(old if found is None else found)

    def _touching(self) -> Flags:
        """Return the cells to find pressures of; those that yield are not among them."""
        mask = (self.pressure > 0.0) | (self.gap < 0.0)
        if self.upper < np.inf:
            self.yielding = (self.pressure >= self.upper) & (self.gap <= 0.0)
            mask &= ~self.yielding
        mask.ravel()[self.held] = True
        return mask

    def _stop(self, tolerance: float, kept: bool) -> float:
        return max(_FORCING[kept] * self.residual, 0.25 * tolerance) * self.scale

    def _among(self, flat: Indices) -> ContactCells:
        cells = Cells.of(flat, self.required.shape)
        levers = np.empty((0, flat.size))
        if self.motions is not None:
            levers = self.motions.among(flat)
        return ContactCells.among(self.grid, cells, levers)

    def _moved(self, old: Array, cells: Indices, change: Array) -> Array | None:
        new = old.copy()
        new.ravel()[cells] = np.clip(old.ravel()[cells] + change, 0.0, self.upper)
        return self._admissible(new)

    def _admissible(self, pressure: Array) -> Array | None:
        """Return pressures within their bounds that meet the loads; None where there are none."""
        if self.motions is None:
            return pressure if self.upper == np.inf else np.minimum(pressure, self.upper)
        if self.yielding is not None:
            found = self.motions.balanced(pressure, self.upper, self.yielding)
            if found is not None:
                return found
        return self.motions.balanced(pressure, self.upper)


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
