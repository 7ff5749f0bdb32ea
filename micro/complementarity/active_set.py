"""Search for the cells in contact, step by step.

A step takes the cells with a pressure or a negative gap as the contact, changes their pressures as
its linear system asks and drops tensile ones (primal-dual active set). On many cells the change is
one iteration of conjugate gradients, whose inverse is accurate: one product, in single precision
and with the change alone, then tells all gaps. They are evaluated in double precision once, when
the residual has come near what these changes err by. On few cells, and where such steps fail, the
change is that of several iterations.

Dropping cells changes all gaps, and elsewhere gaps become negative for a moment, of cells that
would only be dropped again. Cells therefore enter only when the largest gap left in the contact is
less than a multiple of the most negative one outside. Where the approach is prescribed, the
pressures also grow together: no condition holds their sum, which the inverse errs by most.

Where a plane that may turn rests on few cells, each of them is needed to hold it. There, cells are
dropped one at a time (primal active set), so that no step leaves the plane without support.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

import numpy as np

from patchlaw.micro.boundary_elements.half_space_grid import Cells, Displaced
from patchlaw.micro.boundary_elements.inverse import ContactCells
from patchlaw.micro.complementarity.cell_problem import (
    CellProblem,
    ContactPressures,
    admissible_start,
)
from patchlaw.support import Array, Flags, Indices, NotConverged, largest, on_rows

_TRUSTING_STEPS = 20
"""Steps that may raise the energy when they lower the residual; later ones must lower the energy.
Where cells of very different sides meet the periodic kernel, whose inverse is then far from an
M-matrix, sets may otherwise return to where they were."""
_MOST_ITERATIONS = 100
"""Iterations in a step; an exact solution of a wrong set is of no use."""
_MOST_HALVINGS = 12
_FEW = 6
"""Cells under a plane free to turn below which they are dropped one at a time. Of 300 planes that
hardly touch (1e-5 … 1e-3 of the largest force) the slowest took 9 times the products of the level
plane; it took 74 times when this waited until a step failed. With 12 the median doubles."""
_CONSTRAINED_WEIGHT = 1e-8
"""Weight of a cell that touches without pressure, where free motions are found from the gaps,
relative to the largest pressure."""
_NOISE = 1e-12
"""Change of a pressure at a bound, relative to the largest pressure, that counts as rounding: where
the prescribed loads allow a cell no change, rounding remains."""
_ROUNDING = 4.0 * float(np.finfo(float).eps)
"""Rounding of the gaps under a plane that is free to turn, relative to its largest distance."""
_CLOSED = (0.5, 3.0)
"""Largest gap of the cells that carry, over the most negative gap of the others, at which these
enter: where steps solve the linear system of a set, and where they are single iterations with the
accurate inverse. Of the latter, on 32 contacts of 256² and 512² cells, 2 to 97 % of which touch,
2 to 5 took 10.7 to 10.3 products on the finest grid, 0.5 two more; the slowest one 13, where they
always enter 28."""
_LENGTH = 0.88
"""Length of the first step along a direction of the accurate inverse; the best ones were 0.74 to
0.98. With 1 those contacts took a product more."""
_BOTH_CHANGE = 0.25
"""Largest gap of cells that yield, over the range of approaches that it overlaps with the most
negative gap of the others by: these enter then, see `_CLOSED`."""
_FORCING = (0.2, 0.01)
"""Gaps at which the conjugate gradients of a step end, relative to the present residual: in a set
of cells that has changed, and in the same set as before."""
_ERROR, _ERRORS = 0.02, 30.0
"""Error of the gaps by changes in single precision, over the largest one allowed, from which on it
counts, and the largest gap left, over that error, at which gaps are evaluated anew."""


class ActiveSet:
    """Pressures on cells and how far they are from a solution.

    Args:
        problem: The contact problem.
        start: Pressures ≥ 0 to begin with, shape (nx, ny); overwritten.

    Attributes:
        pressure: Present pressures, which are admissible, shape (nx, ny).
        motion: Free motions of the body that close the gaps best, shape (k,) [mm].
        gap: Gaps, shape (nx, ny) [mm].
        scale: Largest interference, free motions included [mm]; more where a period is so flat
            that its gaps are rounding.
        residual: Largest violation of the contact conditions, over the scale.
        rounding: Residual that rounding of distances alone can make.

    Raises:
        NotConverged: When no pressures within the bounds meet the loads.
    """

    def __init__(self, problem: CellProblem, start: Array) -> None:
        self.problem = problem
        self._one_by_one = False  # since a step of all cells at once gained nothing
        self._constrained: Indices = np.zeros(0, np.intp)  # cells at a bound that have no gap
        self._contact: ContactCells | None = None
        self._direction: tuple[Array, float] | None = None  # of the last step, and its size
        self._length, self._quick = _LENGTH, False
        self._yielding: Flags | None = None
        self._ends = float(problem.interference.min()), float(problem.interference.max())
        self.gap = np.empty_like(start)
        pressure, self.motion = admissible_start(problem, start)
        self._accept(np.ascontiguousarray(pressure), rough=True)
        self._evaluate_anew()

    def _accept(self, pressure: Array, *, rough: bool = False) -> None:
        """Evaluate admissible pressures anew.

        Args:
            pressure: The pressures, shape (nx, ny) [MPa].
            rough: Whether displacements in single precision will do.
        """
        problem, self.pressure = self.problem, pressure
        gap = self.gap = problem.grid.displacement(pressure, out=self.gap, rough=rough)
        self._error = problem.grid.rounding * largest(gap) if rough else 0.0
        self._loaded, self._direction = np.flatnonzero(pressure > 0.0), None
        near = float(self.motion.sum())
        if problem.motions.turns:
            gap -= problem.motions.displacement(self.motion)
            near = 0.0
        elif problem.motions.count and self._loaded.size:
            # gaps differ by less than heights, which round
            top = int(np.argmax(pressure))
            near = float(gap.flat[top] - problem.interference.flat[top])
            self.motion = np.array([near])

        def work(rows: slice) -> None:
            gap[rows] -= problem.interference[rows]
            gap[rows] -= near

        on_rows(work, gap.shape)
        self._assess()

    def _assess(
        self, here: Array | None = None, displaced: Displaced | None = None, more: float = 0.0
    ) -> None:
        """Let free motions close the gaps, and find the residual.

        Args:
            here: Gaps of the loaded cells, shape (n,) [mm]; those that are stored if not given.
            displaced: What is to be added to the stored gaps of all others.
            more: Share of displacements that is added to theirs then.
        """
        problem, motions, gap, loaded = self.problem, self.problem.motions, self.gap, self._loaded
        own, here = self.pressure.take(loaded), gap.take(loaded) if here is None else here
        closed = np.zeros(motions.count)
        if motions.count and loaded.size:
            closed = np.array([float(own @ here) / float(own.sum())])
            if not self._plain:
                closed = self._closing(self.pressure)
        self.motion = self.motion + closed
        nearer = motions.displacement(closed) if motions.turns else None
        here -= float(closed.sum()) if nearer is None else nearer.take(loaded)
        gap.ravel()[loaded] = np.inf
        outside = self._overlap(float(closed.sum()) if nearer is None else nearer, displaced, more)
        gap.ravel()[loaded] = here
        if nearer is None:
            least, most = (end + float(self.motion.sum()) for end in self._ends)
        else:
            nearer = motions.displacement(self.motion)
            nearer += problem.interference
            least, most = float(nearer.min()), float(nearer.max())
        inside = float(here.max(initial=0.0))
        if problem.yields:
            here = here[own < problem.hardness]  # yielding cells may have negative gaps
        inside = max(inside, -float(here.min(initial=0.0)))
        # clear of all cells, and yet loaded: the largest absolute value counts
        self.scale = most if most > 0.0 or not loaded.size else max(most, -least)
        noise = self.problem.noise * float(own.max(initial=0.0))
        self.scale = max(self.scale, noise / self.problem.tolerance)
        self.residual = self.rounding = 0.0
        self._apart = inside, outside
        if self.scale > 0.0:
            self.residual = max(inside, outside) / self.scale
            if motions.turns:
                self.rounding = _ROUNDING * max(most, -least) / self.scale

    def _overlap(self, near: float | Array, displaced: Displaced | None, more: float) -> float:
        """Move the surface from the gaps of all cells; return the largest overlap of open ones.

        Args:
            near: What free motions come nearer by, of all cells or of each [mm].
            displaced: As for `_assess`.
            more: As for `_assess`.
        """
        gap, interference = self.gap, self.problem.interference

        def work(rows: slice) -> float:
            some = gap[rows]
            if displaced is not None:
                some += displaced.factor * displaced.field[rows]
            if more:
                some *= 1.0 + more
                some += more * interference[rows]
            some -= near if isinstance(near, float) else near[rows]
            return float(some.min())

        return max(0.0, -min(on_rows(work, gap.shape)))

    def _closing(self, pressure: Array) -> Array:
        """Return the free motions that close the gaps of cells that carry between the bounds.

        Where there are none, the approach is one at which cells that yield overlap and the others
        are apart. If no approach parts them, cells of both kinds are to change places.
        """
        carrying = pressure > 0.0
        fixed = not self.problem.motions.turns and self.problem.yields
        if not fixed or not np.array_equal(carrying, pressure >= self.problem.hardness):
            return self.problem.motions.closing(self._weights(pressure), self.gap)
        least = float(self.gap[carrying].max())
        most = float(self.gap[~carrying].min(initial=np.inf))
        return np.array([least if least <= most else least - _BOTH_CHANGE * (least - most)])

    def _weights(self, pressure: Array) -> Array:
        """Return weights of the cells whose gaps give the motions; those that yield have none."""
        weights = pressure
        if self.problem.yields:
            elastic = np.where(pressure >= self.problem.hardness, 0.0, pressure)
            weights = elastic if elastic.any() else pressure
        if self._constrained.size:
            weights = weights.copy()
            weights.ravel()[self._constrained] += _CONSTRAINED_WEIGHT * float(pressure.max())
        return weights

    @property
    def enough(self) -> float:
        """Residual at which the search may end."""
        return max(self.problem.tolerance, self.rounding)

    def step(self, *, cautious: bool) -> None:
        """Solve on the cells that seem to touch and accept the pressures.

        Args:
            cautious: Whether no step may raise the energy.
        """
        few = self.problem.motions.turns and np.count_nonzero(self.pressure > 0.0) <= _FEW
        if not self._one_by_one and not few:
            if self._step_together(cautious=cautious or self.problem.unloaded):
                return
            if not self.problem.motions.turns:
                return
            self._one_by_one = True
        self._step_one_by_one()

    def _step_together(self, *, cautious: bool) -> bool:
        """Move all cells at once, by less while that gains nothing; return whether it gained.

        A step that meets no bound has the length of the least energy. The others have that of the
        step before, so that a single product tells the gaps after it.
        """
        contact, gap, wanted, direction = self._wanted(cautious=cautious)
        flat, residual, energy = contact.cells.flat, self.residual, 0.0
        old = self.pressure.take(flat) if self._plain else self.pressure.copy()
        for halving in range(_MOST_HALVINGS):
            moved = self._moved(old, 0.5**halving * wanted)
            if moved is None:
                continue
            cells, after, free = moved
            now = self.pressure.take(cells.flat)
            change = after - now
            displaced = self.problem.grid.displaced_by(cells, change)
            before = gap if cells is contact.cells and not halving else self.gap.take(cells.flat)
            slope = 2.0 * float(change @ before)
            curvature, part = float(change @ displaced.own), 1.0
            if free and not halving and slope < 0.0 < curvature:
                best = -0.5 * slope / curvature
                further = now + best * change
                if further.min() >= 0.0 and further.max() <= self.problem.hardness:
                    part, after = best, further
            self._advance(cells, after, before, displaced.times(part))
            energy += part * (slope + part * curvature)
            if energy < 0.0 or (self.residual < residual and not cautious):
                break
            if self.residual <= self.enough:
                break
        else:
            # a body that does not turn goes on from the shortest step, which changes the cells
            self._accept(old if self.problem.motions.turns else self.pressure)
            return False
        self._direction = direction if free else None
        if direction is not None:
            self._length *= part
        self._evaluate_anew()
        return True

    def _wanted(
        self, *, cautious: bool
    ) -> tuple[ContactCells, Array, Array, tuple[Array, float] | None]:
        """Return the cells to move, their gaps and the change of their pressures that is wanted.

        With an accurate inverse of all terms it is one step of conjugate gradients, whose direction
        and size follow; several of them, which need products, where there is none or steps fail.
        """
        quick = not cautious and self.problem.grid.inverted
        quick = quick and (self._plain or bool(self.problem.motions.count))
        quick = quick and (self._contact is None or self._contact.accurate)
        inside, outside = self._apart
        flat = self._touching(entering=not inside > _CLOSED[quick] * outside)
        same = self._contact is not None and np.array_equal(flat, self._contact.cells.flat)
        if self._contact is None or not same:
            self._contact, self._direction = self._among(flat), None
        contact, gap = self._contact, self.gap.take(flat)
        if self.problem.yields and self.problem.mean_is_free and flat.size == self.gap.size:
            return contact, gap, self._rise(contact, gap, stop=self._stop(same)), None
        self._quick = quick and contact.accurate
        if not self._quick:
            change = contact.close(gap, stop=self._stop(same), limit=_MOST_ITERATIONS)
            return contact, gap, change, None
        left = contact.balanced(gap)
        direction = contact.preconditioned(left)
        size = float(left @ direction)
        if self._direction is not None:
            direction += (size / self._direction[1]) * self._direction[0]
        return contact, gap, -self._length * direction, (direction, size)

    def _rise(self, contact: ContactCells, gap: Array, *, stop: float) -> Array:
        """Return the change of pressures on all cells of a period whose mean nothing resists.

        It evens out the gaps. What is left of them, their mean, then ends where a cell meets its
        bound.

        Args:
            contact: The linear problem of all cells.
            gap: Their gaps, shape (n,) [mm].
            stop: Largest deviation from the mean that may be left [mm].
        """
        mean, old = float(gap.mean()), self.pressure.ravel()
        change = contact.close(gap - mean, stop=stop, limit=_MOST_ITERATIONS)
        if abs(mean) <= self.problem.tolerance * self.scale:
            return change
        room = self.problem.hardness - old - change if mean < 0.0 else old + change
        return change - np.copysign(max(0.0, float(room.min())), mean)

    def _advance(self, cells: Cells, after: Array, gap: Array, displaced: Displaced) -> None:
        """Go to other pressures of some cells.

        Args:
            cells: The cells.
            after: Their pressures, shape (n,) [MPa].
            gap: Their gaps before, shape (n,) [mm].
            displaced: Displacements by the change of the pressures.
        """
        self.pressure.ravel()[cells.flat] = after
        self._error += displaced.error
        if self._plain:
            carry = after > 0.0
            self._loaded = cells.flat[carry]
            here, more = (gap + displaced.own)[carry], 0.0
            if self._quick and not self.problem.motions.count:
                more = self._growth(after[carry], here)
            self._assess(here, displaced, more)
            return

        def work(rows: slice) -> None:
            self.gap[rows] += displaced.factor * displaced.field[rows]

        on_rows(work, self.gap.shape)
        self._loaded = np.flatnonzero(self.pressure > 0.0)
        self._assess()

    def _growth(self, own: Array, here: Array) -> float:
        """Let all pressures of a body that does not move grow by one share to the least energy.

        What the inverse errs by most is the load of all cells together, which no condition holds
        where the approach is prescribed. Displacements by the pressures themselves are known.

        Args:
            own: Pressures of the loaded cells, shape (n,) [MPa].
            here: Their gaps, shape (n,) [mm]; overwritten.

        Returns:
            The share, by which displacements grow, too.
        """
        interference = self.problem.interference.take(self._loaded)
        moved, pressed = here + interference, float(own @ interference)
        elastic = float(own @ moved)
        if not (elastic > 0.0 and pressed > 0.0):
            return 0.0
        more = pressed / elastic - 1.0
        self.pressure.ravel()[self._loaded] = (1.0 + more) * own
        here += more * moved
        return more

    @property
    def _plain(self) -> bool:
        """Whether all cells in contact carry without yielding, under a body that does not turn."""
        return not (self.problem.motions.turns or self.problem.yields or self._constrained.size)

    def _evaluate_anew(self) -> None:
        """Evaluate gaps in double precision before what changes of them err by counts."""
        most, left = self.enough * self.scale, self.residual * self.scale
        if self._error > _ERROR * most and left <= max(_ERRORS * self._error, most):
            direction = self._direction
            self._accept(self.pressure)
            self._direction = direction

    def _moved(self, old: Array, change: Array) -> tuple[Cells, Array, bool] | None:
        """Return admissible pressures near old ones and a change; None if there are none.

        Args:
            old: Pressures of the cells in contact before, shape (n,), or those of all cells where
                others may change, too, shape (nx, ny).
            change: Change of the pressures in contact, shape (n,).

        Returns:
            Cells that hold all whose pressures differ from the present ones, their pressures, and
            whether no bound was met.
        """
        problem, motions, contact = self.problem, self.problem.motions, self._contact
        assert contact is not None
        flat, upper = contact.cells.flat, problem.hardness
        wanted = change + (old if self._plain else old.take(flat))
        free = bool(wanted.min() >= 0.0 and wanted.max() <= upper)
        within = wanted if free else np.clip(wanted, 0.0, upper)
        if self._plain:
            if motions.count:
                total = float(within.sum())
                if not total > 0.0:
                    return None
                within *= float(motions.loads[0]) / total
            return contact.cells, within, free
        moved = old.copy()
        moved.ravel()[flat] = within
        admissible = problem.admissible(moved.copy(), self._yielding)
        if admissible is None and problem.yields and motions.count:
            # so many cells leave that the others cannot bear the load: those nearest to it stay
            moved.ravel()[flat] = 0.0
            shifted = motions.shifted_to_load(wanted, upper, float(moved.sum()))
            if shifted is not None:
                moved.ravel()[flat] = shifted
                admissible = problem.admissible(moved, self._yielding)
        if admissible is None:
            return None
        cells = Cells.of(np.flatnonzero(admissible != self.pressure), admissible.shape)
        return cells, admissible.take(cells.flat), free

    def _step_one_by_one(self) -> None:
        """Close the gaps of cells, dropping one at a time that would leave its bounds.

        Each move keeps the loads and lowers the energy, however few cells carry the body. A step
        that drops many at once may leave it on a single contact, which cannot hold it. Cells that
        stay at a bound without a gap determine the tilt of a body that lies on two contacts in line
        with its middle.
        """
        # what rounding has left on cells would be the first to leave, and come back as rounding
        self.pressure[self.pressure <= _NOISE * self.pressure.max()] = 0.0
        cells, old, upper = self._carrying(), self.pressure, self.problem.hardness
        new, stop = old.copy(), self._stop(same=True)
        pressure, gap = old.ravel()[cells], self.gap.ravel()[cells]
        for _ in range(len(cells)):
            contact = self._among(cells)
            change = contact.close(gap, stop=stop, limit=_MOST_ITERATIONS)
            bound = (pressure <= 0.0) | (pressure >= upper)
            change[bound & (np.abs(change) <= _NOISE * old.max())] = 0.0
            first, part = self.problem.first_at_bounds(pressure, change)
            if part > 0.0:
                pressure = np.clip(pressure + part * change, 0.0, upper)
                displaced = self.problem.grid.apply_compliance(contact.cells, change)
                gap = gap + part * displaced
            if part == 1.0:
                break
            left_at = np.where(change[first] > 0.0, upper, 0.0)
            new.ravel()[cells[first]] = left_at
            left = np.ones(len(cells), bool)
            left[first] = False
            cells, pressure, gap = cells[left], pressure[left], gap[left]
        new.ravel()[cells] = pressure
        self._constrained = cells[(pressure <= 0.0) | (pressure >= upper)]
        admissible = self.problem.admissible(new, self._yielding)
        self._accept(old if admissible is None else admissible)

    def _carrying(self) -> Indices:
        """Return the cells that carry between the bounds, and as many with the worst gaps."""
        pressure = self.pressure.ravel()
        carry = (pressure > 0.0) & ~(pressure >= self.problem.hardness)
        carry[self._constrained] = True
        touching = self._touching()
        entering = touching[~carry[touching]]
        worst = np.argsort(-np.abs(self.gap.ravel()[entering]), kind="stable")
        entering = entering[worst[: max(1, np.count_nonzero(carry))]]
        return np.union1d(np.flatnonzero(carry), entering)

    def _touching(self, *, entering: bool = True) -> Indices:
        """Return the cells to find pressures of; those that yield are not among them.

        Args:
            entering: Whether cells with negative gaps are among them that have no pressure.

        Returns:
            Their flat indices, ascending.
        """
        pressure, gap, hardness = self.pressure, self.gap, self.problem.hardness
        if not (entering or self.problem.yields or self._constrained.size):
            return self._loaded
        touching = np.zeros(gap.shape, bool)
        if entering:
            on_rows(lambda rows: np.less(gap[rows], 0.0, out=touching[rows]), gap.shape)
        touching.ravel()[self._loaded] = True
        if self.problem.yields:
            self._yielding = (pressure >= hardness) & (gap <= 0.0)
            touching &= ~self._yielding
        touching.ravel()[self._constrained] = True
        return np.flatnonzero(touching)

    def _stop(self, same: bool) -> float:
        """Return the largest gap that a linear solution leaves [mm]."""
        return max(_FORCING[same] * self.residual, 0.25 * self.problem.tolerance) * self.scale

    def _among(self, flat: Indices) -> ContactCells:
        """Return the linear problem of some cells by their flat indices."""
        cells, modes = Cells.of(flat, self.gap.shape), self.problem.motions.modes_of(flat)
        grid = self.problem.grid
        # few cells of many in contact may bear less than the hardness
        return ContactCells(grid.solved_on(cells) if self.problem.yields else grid, cells, modes)


def solve(problem: CellProblem, start: Array, *, most_steps: int = 200) -> ContactPressures:
    """Solve the contact problem on one grid.

    The residual ε bounds the error of the force: the solution is exact for a body whose heights
    differ by no more than ε δ, so the force lies between those at (1 − ε) δ and (1 + ε) δ. Loads of
    free motions are met to rounding.

    Args:
        problem: The contact problem.
        start: Pressures ≥ 0 to start from, shape (nx, ny); overwritten.
        most_steps: Sets of cells that are tried at most.

    Raises:
        NotConverged: When the residual stays above the tolerance, or no pressures within their
            bounds meet the loads.

    Source:
        Hintermüller, Ito & Kunisch 2002, doi 10.1137/S1052623401383558; Polonsky & Keer 1999,
        doi 10.1016/S0043-1648(99)00113-1.
    """
    used = problem.grid.products
    search = ActiveSet(problem, start)
    for steps in range(most_steps):
        if search.residual <= search.enough:
            products = problem.grid.products - used
            found = ContactPressures(search.pressure, search.motion, search.residual, products)
            return found._replace(gap=search.gap)
        search.step(cautious=steps >= _TRUSTING_STEPS)
    raise NotConverged(
        f"the contact pressure (residual {search.residual:.1e}, asked {problem.tolerance:.1e})",
        reason="set of cells in contact not found",
        iterations=problem.grid.products - used,
        remedy="raise the tolerance or take smaller steps of the approach",
    )
