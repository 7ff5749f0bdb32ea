"""Finite slopes in a contact problem, by fixed-point iteration.

The displacements that finite slopes add depend on the pressures and are evaluated on the whole
surface. Each solution takes them from the solution before it. They are a few per cent of all
displacements, and change by a hundredth of that in the second solution. Solutions need not be more
accurate than the next change, so the first ones stop early.

Where a rigid body can touch few cells alone, one matrix of these has the finite slopes. It holds
what finite slopes do with the pressures that they have been worked out for, all loads before
included. Each solution adds its own pressures where they are new. What is left out falls to a
hundredth with every solution.

The contact of a period near full contact is found by the force that it has at an approach. The mean
pressure of a period displaces no cell of a half-space. Near full contact the force
therefore rises steeply with the approach, and in full contact no approach determines it. Finite
slopes turn the curve over: the mean pressure compresses the heights as it does the body, so that
less of them remains to be flattened. From an approach shortly before full contact on, the largest
of all, the plane goes back as the force rises: a surface in full contact is stiffer than a smooth
body of its volume, from whose surface the approach counts.

Displacements by finite slopes that are those of the solution before would make an approach one
beyond full contact, where no pressures hold the plane. Under a force there always is a solution.
The approach is a concave function of the force up to full contact, so that the smaller of two
forces of one approach, which is that of a plane that comes nearer, lies before the largest.

Theory: docs/theory.md, section 7.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from patchlaw.micro.complementarity.active_set import solve
from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures, Motions
from patchlaw.micro.complementarity.solver import (
    approach_rate,
    penetrates_outside,
    solve_on_surface,
)
from patchlaw.support import Array, Flags, NotConverged

_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
_PART_OF_FORCE = 1e-3
"""Part of the largest force to which that of the largest approach is found. The approach is up to
1e-6 of it less there."""
_RATE = 1e-10
"""Error of a force, relative to it, at which the search ends where the approach does not end it."""

UnderForce = Callable[[CellProblem, ContactPressures | None], ContactPressures]
"""Solves a problem whose approach is free, from a solution nearby."""


class BeyondFullContactError(Exception):
    """A period has no gap left at an approach.

    Attributes:
        beyond: How far it is beyond the largest approach [mm].
    """

    def __init__(self, beyond: float) -> None:
        self.beyond = beyond
        super().__init__(f"{beyond:.6g} mm beyond full contact")


def solved_by_force(
    problem: CellProblem, start: ContactPressures | None, solve: UnderForce, closed: float
) -> ContactPressures:
    """Solve the contact of a period at the approach of a problem under forces.

    Args:
        problem: The contact problem, without free motions.
        start: A solution nearby.
        solve: Solves the problem under a force, finite slopes included.
        closed: Largest change of the approach that counts as none, over the interference.

    Raises:
        BeyondFullContactError: When the approach is larger than the largest one.
        NotConverged: When the contact under a force is not found.
    """
    scale, known = float(problem.interference.max()), dict[float, ContactPressures]()
    first = None if start is None else start._replace(motion=np.zeros(1), nearby=tuple)
    ones = [np.ones((1, count)) for count in problem.interference.shape]

    def beyond(force: float) -> float:
        """Return the approach under a force less that of the problem [mm], 0 where it is that."""
        if not force > 0.0:
            return -scale
        if force not in known:
            level = Motions(along_x=ones[0], along_y=ones[1], loads=np.array([force]))
            near = min(known, key=lambda each: abs(each - force), default=None)
            nearby = first if near is None else known[near]
            known[force] = solve(replace(problem, motions=level), nearby)
        found = float(known[force].motion[0])
        return found if abs(found) > closed * scale else 0.0

    low, high = _bracket(beyond, closing_force(problem))
    if beyond(high) > 0.0:
        high = float(scipy.optimize.brentq(beyond, low, high, xtol=_RATE * high, rtol=_RATE))
    beyond(high)
    found = known[high]
    return found._replace(
        motion=np.zeros(0),
        residual=max(found.residual, abs(float(found.motion[0])) / scale),
        iterations=sum(each.iterations for each in known.values()),
    )


def _bracket(beyond: Callable[[float], float], most: float) -> tuple[float, float]:
    """Return forces whose approaches are less than that of a problem, and no less.

    Args:
        beyond: Returns the approach under a force less that of the problem; concave.
        most: A force beyond that of the largest approach.
    """
    low, high, inner = 0.0, most, [(1.0 - _GOLDEN) * most, _GOLDEN * most]
    known = {0.0: -np.inf}
    while high - low > _PART_OF_FORCE * most:
        for force in inner:
            known[force] = beyond(force)
            if known[force] >= 0.0:
                return max(one for one in known if one < force), force
        if known[inner[0]] < known[inner[1]]:
            low, inner = inner[0], [inner[1], inner[0] + _GOLDEN * (high - inner[0])]
        else:
            high, inner = inner[1], [low + (1.0 - _GOLDEN) * (inner[1] - low), inner[0]]
    raise BeyondFullContactError(-max(known.values()))


def closing_force(problem: CellProblem) -> float:
    """Return the sum of pressures that just closes a period of small slopes.

    Pressures that flatten it differ from their mean by what the waves of its heights tell.

    Args:
        problem: The contact problem.
    """
    interference = problem.interference
    rows, columns = interference.shape
    half_space = problem.compliance.half_space((rows, columns), problem.spacing)
    heights = (interference - interference.mean()).astype(np.float32)
    return -float(half_space.inverse(heights).min()) * interference.size


_MOST_ON_FEW = 30
_CONVERGED_ON_FEW = 3e-10
"""Change of these displacements at which the iteration ends, over the largest interference."""
_NEXT = 1.1
"""Cells that are solved for over those that the rigid body overlaps. Of 72 rows of laws 12 then
need no displacements of all cells, and one no solution on them; with 2 the same ones."""


def solved_on_few(
    problem: CellProblem, start: ContactPressures | None
) -> tuple[ContactPressures, bool] | None:
    """Solve the contact of few cells, finite slopes included.

    Among them are those that touch next, which pressures may lift into contact.

    Args:
        problem: The contact problem of all cells of a surface.
        start: A solution nearby.

    Returns:
        The solution, and whether other cells penetrate the rigid body; None where it is not known
        which few cells can touch, where others can, motions are free, or the iteration does not
        converge.
    """
    few = problem.compliance.few_cells(problem.interference.shape, problem.spacing)
    touchable = problem.interference.ravel() > 0.0
    if few is None or problem.motions.count or not touchable.any():
        return None
    inside = np.flatnonzero(touchable[few.cells])
    if len(inside) < np.count_nonzero(touchable):
        return None
    some = slice(0, math.ceil(_NEXT * (inside[-1] + 1)))
    largest = float(problem.interference.max())
    pressure, used = np.zeros(len(few.cells)), 0
    if start is not None:
        pressure[some] = start.pressure.ravel()[few.cells[some]]
    compliance = few.compliance(pressure)
    converged = max(_CONVERGED_ON_FEW, 3.0 * problem.tolerance)
    for _ in range(_MOST_ON_FEW):
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
            by_slopes, worst = few.slope_displacement(pressure), max(found.residual, changed)
            found = found._replace(  # gaps are those of the few cells alone
                pressure=everywhere, iterations=used, by_slopes=by_slopes, residual=worst, gap=None
            )
            lowered = problem if by_slopes is None else problem.lowered_by(by_slopes)
            return found, penetrates_outside(lowered, few.cells[some], everywhere)
    return None


_MOST_SOLUTIONS, _PATIENCE, _PROGRESS = 200, 20, 0.5
"""Solutions at most; and how many in a row may come without the smallest change so far falling to
this part. Changes that fall by 4 % with every solution then still converge, where a fixed number
of 30 once ended at 7e-10, and those that wander about end as early."""
_FIRST = 1e-2
"""Residual of the first solution, before finite slopes are known."""
_AHEAD = 2e-2
"""Residual of a solution over the last change by finite slopes: about what the next change is."""
_CAUTION = 4.0
"""Factor on the rate at which changes by finite slopes fell last, for the next one."""
_BY_SLOPES = 0.1
"""Largest part of the displacements that finite slopes add."""
_CONVERGED, _EXPECTED = 3e-9, 1e-9
"""Change by finite slopes at which the iteration ends, over the largest interference: one that was
evaluated, and one that is expected of the next evaluation, which is then left out. With 3e-9 for
both a force under a hardness erred by 1e-8 after unloading, with 1e-9 by 7e-11."""
_HALF = 0.5
"""Part of a change that is taken on once changes do not fall: where slopes soften a sharp edge by
more than its displacement, they swing."""
_PART = 0.1
"""Residual of a solution over the last change, at most: the mixing takes differences of changes.
Without it a plane 800 µm into heights of 10 µm took 2070 iterations, with it 216."""
_AGAIN = 0.2
"""Residual of a solution over the change expected next, at most: it adds to the one after that. On
eight surfaces of 128² to 256² cells, two of which yield and two of which are periodic, it took 159
evaluations of finite slopes where 1 took 177, and as many products."""
_MEMORY = 2
"""Steps that the mixing remembers."""
_NOISE = 2.0
"""Change of a residual over the step above which the step was not its cause."""
_DEPENDENT = 1e-2
"""Changes that differ less in direction, times their length, are taken for one."""
_NEARLY_FULL = 0.8
"""Share of the cells that touch above which the approach of a period may have turned back. It did
from 0.89 on, in the median from 0.97, on 145 periods of rms gradients of 0.05 to 0.5."""


class AndersonMixing:
    """Fixed-point iteration x ← u(d − x), extrapolated along the last few changes of u.

    u is what finite slopes add where bodies of an interference y = d − x touch: a function of y
    alone, whatever the load. Solutions of other loads therefore tell how it changes, too.

    Args:
        known: Interferences y of solutions nearby and u there, shape (nx, ny) both [mm].
        memory: Steps that it remembers.
        noise: Change of a residual over the step above which the step was not its cause.
        dependent: Changes that differ less in direction, times their length, are taken for one.

    Attributes:
        part: Part of the residual that is taken on, which makes changes converge that would swing:
            0.5 up to three times the displacement that they are by.

    Source:
        Walker & Ni 2011, doi 10.1137/10078356X, eq. 2.1 in the form of differences, which are
        those of u(y) + y here.
    """

    def __init__(
        self,
        known: Sequence[tuple[Array, Array]] = (),
        *,
        memory: int = _MEMORY,
        noise: float = _NOISE,
        dependent: float = _DEPENDENT,
    ) -> None:
        self._memory, self._noise, self._dependent = memory, noise, dependent
        self.part = 1.0
        self._last: tuple[Array, Array] | None = None
        self._changes: list[tuple[Array, Array]] = []
        for pair in known:
            self._add(*pair)

    def next(self, point: Array, interference: Array, moved: Array, where: Flags) -> Array:
        """Return the next point.

        Args:
            point: Where the iteration is, x.
            interference: y there, with the free motions of the body.
            moved: u there.
            where: The cells that touch, whose interferences count.
        """
        self._add(interference, moved)
        left, moves, columns = moved - point, [], []
        moved, residual = moved - (1.0 - self.part) * left, left[where]
        for change, move in self._changes:
            column = change[where] + move[where]
            size = float(np.linalg.norm(column))
            if 0.0 < size <= self._noise * float(np.linalg.norm(change[where])):
                moves.append((move - (1.0 - self.part) * (change + move)) / size)
                columns.append(column / size)  # they differ by orders of magnitude
        if not columns:
            return moved
        # least squares by the normal equations: the changes are few, and their lengths are 1
        matrix = np.stack(columns)
        products = np.linalg.pinv(matrix @ matrix.T, self._dependent**2, hermitian=True)
        for share, move in zip(products @ (matrix @ residual), moves, strict=True):
            moved = moved - share * move
        return moved

    def _add(self, interference: Array, moved: Array) -> None:
        """Add a solution."""
        if self._last is not None:
            change = interference - self._last[0], moved - self._last[1]
            self._changes = [*self._changes, change][-self._memory :]
        self._last = interference, moved


def solve_contact(problem: CellProblem, start: ContactPressures | None) -> ContactPressures:
    """Solve a contact on all cells of a surface, with the displacements by its finite slopes.

    Args:
        problem: The contact problem; with the finite slopes of its compliance, if there are any.
        start: A solution nearby, its motion that of the solution where the approach is free; None
            starts from coarser grids.

    Raises:
        NotConverged: When the contact conditions or the loads cannot be met, or displacements by
            finite slopes do not agree with the pressures.
        BeyondFullContactError: When a period has no gap left at the approach.
    """
    compliance = problem.compliance
    few = solved_on_few(problem, start)
    if few is not None:
        start, penetrates = few
        if not penetrates:
            return start
    if not compliance.slopes:
        return solve_on_surface(problem, start)
    if compliance.periodic and not problem.motions.count:
        return _solved_on_period(problem, start)
    return _solved(_SlopeIteration(problem, start))


def _solved_on_period(problem: CellProblem, start: ContactPressures | None) -> ContactPressures:
    """Solve the contact of a period at a prescribed approach."""
    try:
        found = _solved(_SlopeIteration(problem, start))
    except NotConverged:
        if problem.yields:  # then no approach closes all gaps
            raise
    else:
        if problem.yields or _rises(problem, found):
            return found
    tolerance = max(_CONVERGED, 10.0 * problem.tolerance)
    return solved_by_force(
        problem, start, lambda under, near: _solved(_SlopeIteration(under, near)), tolerance
    )


def _rises(problem: CellProblem, solution: ContactPressures) -> bool:
    """Return whether the force of a period at an approach rises with it."""
    if np.count_nonzero(solution.pressure) <= _NEARLY_FULL * solution.pressure.size:
        return True
    assert solution.by_slopes is not None
    lowered = problem.lowered_by(solution.by_slopes)
    return approach_rate(lowered, solution.pressure).total > 0.0


def _solved(iteration: _SlopeIteration) -> ContactPressures:
    """Return the solution that an iteration comes to."""
    used = waited = 0
    least = np.inf
    for _ in range(_MOST_SOLUTIONS):
        solution = iteration.next_solution()
        used += solution.iterations
        residual = iteration.judged(solution)
        if residual is not None:
            by_slopes = iteration.displaced
            return solution._replace(iterations=used, by_slopes=by_slopes, residual=residual)
        waited += 1
        if iteration.change <= _PROGRESS * least:
            least, waited = iteration.change, 0
        elif waited == _PATIENCE:
            if iteration.damped:
                break
            iteration.damp()
            least, waited = np.inf, 0
    raise iteration.not_converged(used)


class _SlopeIteration:
    """Contacts that are solved in turn with the displacements that finite slopes add.

    Args:
        problem: The contact problem.
        start: What the first solution starts from.

    Attributes:
        displaced: What finite slopes add at the next solution, shape (nx, ny) [mm].
        change: Last change of it over the largest interference; infinite where it is not known.
    """

    def __init__(self, problem: CellProblem, start: ContactPressures | None) -> None:
        self._problem, self._start = problem, start
        self._by_slopes = problem.compliance.slope_displacement
        self._begin_without()
        self.change, first = np.inf, _FIRST
        if start is not None and not problem.motions.count:
            self._mixing = AndersonMixing(start.nearby())
        if start is not None and start.pressure.any():
            known, first = start.by_slopes, _FIRST**2
            self.displaced = self._by_slopes(start.pressure) if known is None else known
        self._accuracy = max(problem.tolerance, first)

    def _begin_without(self) -> None:
        """Begin without the displacements by slopes."""
        self._mixing, self._ahead = AndersonMixing(), np.inf
        self.displaced = np.zeros(self._problem.interference.shape)

    @property
    def damped(self) -> bool:
        """Whether parts of the changes are taken on."""
        return self._mixing.part < 1.0

    def damp(self) -> None:
        """Take on half of the changes, of which large ones swing, from here on."""
        self._mixing = AndersonMixing()
        self._mixing.part = _HALF

    def next_solution(self) -> ContactPressures:
        """Solve the contact with the displacements by slopes as they are, from the last one."""
        problem = replace(self._problem, tolerance=self._accuracy).lowered_by(self.displaced)
        if problem.has_no_gap:
            raise self.not_converged(0)
        self._start = solve_on_surface(problem, self._start)
        return self._start

    def not_converged(self, iterations: int) -> NotConverged:
        """Return the error that tells the last change, after so many iterations."""
        return NotConverged(
            "the displacements by finite slopes",
            reason=f"they still change by {self.change:.1e} of the displacement",
            iterations=iterations,
            remedy="set micro.finite_slopes = false, or smooth the surface",
        )

    def judged(self, solution: ContactPressures) -> float | None:
        """Return the residual of a solution that has converged; otherwise prepare the next one.

        Args:
            solution: The last solution.
        """
        problem, tolerance = self._problem, self._problem.tolerance
        last, least = (max(size, 10.0 * tolerance) for size in (_CONVERGED, _EXPECTED))
        touching = solution.pressure > 0.0
        if not touching.any():
            if not self.displaced.any():
                return solution.residual
            self._begin_without()  # slopes of a far larger load part the bodies
            return None
        nearer = problem.interference + problem.motions.displacement(solution.motion)
        largest = float(nearer[touching].max())
        # bodies without interference do not touch, and their pressures have an energy
        sound = largest > 0.0 and np.vdot(solution.pressure, nearer) > 0.0
        exact = sound and self._accuracy <= tolerance
        if exact and self._ahead <= least:
            return max(solution.residual, self._ahead)
        change = self._by_slopes(solution.pressure) - self.displaced
        before, self.change = self.change, np.inf
        if sound:
            self.change = float(np.abs(change[touching]).max()) / largest
        if exact and self.change <= last:
            return max(solution.residual, self.change)
        self._ahead = self._expected_change(before) + _BY_SLOPES * solution.residual
        displaced = self.displaced
        self.displaced = self._mixing.next(
            displaced, nearer - displaced, displaced + change, touching
        )
        self._accuracy = tolerance
        if self._ahead > least:
            enough = min(_AGAIN * self._ahead, _PART * self.change)
            self._accuracy = max(tolerance, min(_FIRST, enough))
        return None

    def _expected_change(self, before: float) -> float:
        """Return the change that is expected next, by the last one and that before it."""
        known = 0.0 < before < np.inf
        rate = min(1.0, _CAUTION * self.change / before) if known else _AHEAD
        return rate * self.change
