"""The complementarity problem of interacting asperities, and how a hard one is approached.

With w_k(t) = t_k + Σ_i U_ki(t_i) the conditions are w_k ≥ d_k, t_k ≥ 0, t_k (w_k − d_k) = 0: the
plane never penetrates a summit, and a summit that it does not touch carries nothing.

Source:
    Waddad et al. 2016, eqs. 10–12 and 23, doi 10.1016/j.triboint.2015.12.023.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""Largest complementarity error, relative to the largest required displacement."""

_SMALLEST_LOAD_STEP = 1.0 / 256.0


class Displacements(Protocol):
    """What n contacts do to each other's summits, however it was computed."""

    @property
    def displacement(self) -> Array:
        """Displacement of every summit by the others, shape (n,) [mm]."""

    @property
    def overlapping_contacts(self) -> int:
        """Number of ordered pairs whose slope has reached c*."""


Lifts = TypeVar("Lifts", bound=Displacements)
Lifts_co = TypeVar("Lifts_co", bound=Displacements, covariant=True)


class Interacting(Protocol[Lifts_co]):
    """Asperities that displace each other's summits."""

    def lift(self, indentation: Array, /) -> Lifts_co:
        """Return the displacements by given own indentations, shape (n,) [mm]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactProblem(Generic[Lifts]):
    """Displacements that a rigid plane requires of the summits it could touch.

    Args:
        interaction: The n asperities.
        required: d_k > 0, shape (n,) [mm].
    """

    interaction: Interacting[Lifts]
    required: Array

    @property
    def scale(self) -> float:
        """Largest required displacement [mm]."""
        return float(self.required.max())

    def residual(self, indentation: Array, lift: Displacements) -> float:
        """Return max |min(t_k, w_k − d_k)| relative to the largest d_k.

        Args:
            indentation: Own indentations t, shape (n,) [mm]; negative ones count as 0.
            lift: The displacements that they cause.
        """
        own = np.maximum(indentation, 0.0)
        gap = own + lift.displacement - self.required
        return float(np.abs(np.minimum(own, gap)).max()) / self.scale


class Solution(NamedTuple):
    """A solved contact problem.

    Attributes:
        indentation: Own indentations t ≥ 0, shape (n,) [mm].
        displacement: Displacements w of the summits, shape (n,) [mm].
        iterations: Linear systems solved on the way.
        residual: Complementarity error relative to the largest required displacement.
        overlapping_contacts: Ordered pairs of asperities beyond the merging slope.
    """

    indentation: Array
    displacement: Array
    iterations: int
    residual: float
    overlapping_contacts: int


Method = Callable[[ContactProblem[Any], Array], Solution]
"""Takes the problem and a start (n,) [mm]; raises NotConverged."""


def solution(
    problem: ContactProblem[Lifts], indentation: Array, lift: Lifts, iterations: int
) -> Solution:
    """Put a solution together from its indentations, negative ones cut to 0, and their lift."""
    own = np.maximum(indentation, 0.0)
    residual = problem.residual(own, lift)
    return Solution(own, own + lift.displacement, iterations, residual, lift.overlapping_contacts)


def solve(problem: ContactProblem[Any], method: Method, start: Array) -> Solution:
    """Solve directly from a start and, where this fails, along growing required displacements.

    Args:
        problem: The contact problem.
        method: The iteration to use.
        start: First guess of the own indentations, shape (n,) [mm].

    Raises:
        NotConverged: When even small load steps fail.
    """
    try:
        return method(problem, start)
    except NotConverged as failure:
        return _continued(problem, method, failure.iterations)


def _continued(problem: ContactProblem[Any], method: Method, spent: int) -> Solution:
    """Scale all d_k from 0 to 1 in steps that are halved on failure and doubled on success."""
    load, step = 0.0, 0.5
    indentation = np.zeros_like(problem.required)
    while True:
        trial = min(load + step, 1.0)
        try:
            found = method(replace(problem, required=trial * problem.required), indentation)
        except NotConverged as failure:
            spent, step = spent + failure.iterations, 0.5 * step
            if step < _SMALLEST_LOAD_STEP:
                raise _lost(problem, spent, load, failure.reason) from failure
            continue
        spent += found.iterations
        if trial == 1.0:
            return found._replace(iterations=spent)
        load, step, indentation = trial, 2.0 * step, found.indentation


def _lost(problem: ContactProblem[Any], spent: int, load: float, reason: str) -> NotConverged:
    return NotConverged(
        f"the contact of {len(problem.required)} interacting asperities"
        f" (largest required displacement {problem.scale:.4g} mm, reached {load:.1%} of it)",
        reason=reason,
        iterations=spent,
        remedy="lower load.approach, or choose a model without interaction in micro.model",
    )
