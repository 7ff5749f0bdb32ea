"""A period near full contact at a prescribed approach, by the force that it has there.

The mean pressure of a period displaces no cell of a half-space. Near full contact the force
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

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures, Motions

_GOLDEN = 0.5 * (5.0**0.5 - 1.0)
_PART = 1e-3
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
    search = _Forces(problem, start, solve, closed)
    low, high = search.bracket(closing_force(problem))
    if search.beyond(high) > 0.0:
        high = float(brentq(search.beyond, low, high, xtol=_RATE * high, rtol=_RATE))
    return search.solution(high)


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


class _Forces:
    """Contacts under forces, and how far their approach is beyond that of a problem."""

    def __init__(
        self,
        problem: CellProblem,
        start: ContactPressures | None,
        solve: UnderForce,
        closed: float,
    ) -> None:
        self._problem, self._solve = problem, solve
        self._scale = float(problem.interference.max())
        self._closed = closed * self._scale
        self._known: dict[float, ContactPressures] = {}
        self._first = None if start is None else start._replace(motion=np.zeros(1), nearby=tuple)
        ones = [np.ones((1, count)) for count in problem.interference.shape]
        self._level = Motions(along_x=ones[0], along_y=ones[1], loads=np.zeros(1))

    def beyond(self, force: float) -> float:
        """Return the approach under a force less that of the problem [mm], 0 where it is that."""
        if not force > 0.0:
            return -self._scale
        if force not in self._known:
            motions = replace(self._level, loads=np.array([force]))
            near = min(self._known, key=lambda each: abs(each - force), default=None)
            first = self._first if near is None else self._known[near]
            self._known[force] = self._solve(replace(self._problem, motions=motions), first)
        beyond = float(self._known[force].motion[0])
        return beyond if abs(beyond) > self._closed else 0.0

    def bracket(self, most: float) -> tuple[float, float]:
        """Return forces whose approaches are less than that of the problem, and no less.

        Args:
            most: A force beyond that of the largest approach.
        """
        low, high, inner = 0.0, most, [(1.0 - _GOLDEN) * most, _GOLDEN * most]
        while high - low > _PART * most:
            beyond: list[float] = []
            for force in inner:
                beyond.append(self.beyond(force))
                if beyond[-1] >= 0.0:
                    return max((f for f in self._known if f < force), default=0.0), force
            if beyond[0] < beyond[1]:
                low, inner = inner[0], [inner[1], inner[0] + _GOLDEN * (high - inner[0])]
            else:
                high, inner = inner[1], [low + (1.0 - _GOLDEN) * (inner[1] - low), inner[0]]
        raise BeyondFullContactError(-max(map(self.beyond, self._known)))

    def solution(self, force: float) -> ContactPressures:
        """Return the solution under a force, as one of the problem."""
        self.beyond(force)
        found = self._known[force]
        off = abs(float(found.motion[0])) / self._scale
        return found._replace(
            motion=np.zeros(0),
            residual=max(found.residual, off),
            iterations=sum(each.iterations for each in self._known.values()),
        )
