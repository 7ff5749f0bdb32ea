"""Settles a rigid plane under its loads: a safeguarded Newton's method in its free motions."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""What force and moment may miss, relative to the force and to that times the plane's half size,
where the rounding of closures lets a plane be placed so well."""

LOOSE = 1e-11
"""Stiffness against motions of the plane, relative to the largest, that is no support at all."""

_AIM = 1e-13  # what they miss where rounding allows it
_ENOUGH = 0.9  # share of the energy's slope that a step may leave
_CLEAR = 1e-6  # of the largest force: a plane that may be about to leave the surface
_FIRST = 1e-6  # of the half size: first trial of a motion that nothing resists
_FARTHEST = 1e3  # half sizes up to which a support is looked for
_MOST_STEPS, _MOST_TRIALS = 100, 100
_ULP = 4.0 * float(np.finfo(float).eps)


class Excess(NamedTuple):
    """Loads that a plane has too much.

    Attributes:
        load: Force, and moments over the half size, beyond those wanted; shape (k,) [N].
        force: Force of the contacts [N].
        measure: The force wanted, or the contacts' where none is [N].
    """

    load: Array
    force: float
    measure: float

    @property
    def missed(self) -> float:
        """The loads relative to their measure; 0 where there is nothing to balance."""
        worst = float(np.abs(self.load).max())
        return worst / self.measure if worst else 0.0


class Motions(Protocol):
    """What resists the k free motions of a plane, each the displacement of its edge [mm]."""

    half: float

    def excess(self, motion: Array, /) -> Excess:
        """Return the loads beyond those wanted, the gradient of a convex energy."""
        ...

    def stiffness(self, motion: Array, /) -> Array:
        """Return the derivative of the loads, symmetric, shape (k, k) [N/mm]."""
        ...

    def reach(self, motion: Array, /) -> float:
        """Return the size of the numbers that closures are the differences of [mm]."""
        ...


def settle(motions: Motions, start: Array) -> Array:
    """Find the motion at which a plane's loads are those wanted.

    The loads are the gradient of a convex energy, so that a line search on its slope always ends
    (Nocedal & Wright 2006, ch. 3, doi 10.1007/978-0-387-40065-5). Against a motion that no contact
    resists the plane goes on until one does.

    Args:
        motions: What resists the plane.
        start: Where it is, shape (k,) [mm].

    Raises:
        NotConverged: When nothing can hold the plane, or loads are not numbers.
    """
    now, largest = start, 0.0
    found = motions.excess(now)
    for _ in range(_MOST_STEPS):
        if found.missed <= _AIM:
            return now
        if not np.all(np.isfinite(found.load)):
            raise _failure("NOT_A_NUMBER")
        largest = max(largest, found.measure)
        step, held = _direction(motions, now, found)
        if held and np.abs(step).max() <= _ULP * motions.reach(now):
            return now + step  # the rounding of closures allows no more
        if found.measure <= _CLEAR * largest:
            # Newton's steps alone come ever closer to a plane that is clear, and never there
            clear = now + 3.0 * step
            if motions.excess(clear).force == 0.0:
                return clear
        trial = _searched(motions, now, found, step)
        if trial is None:
            break
        now, found = trial
    if found.missed <= TOLERANCE:
        return now
    raise _failure("NO_BALANCE")


def touch(touched: Callable[[float], bool], half: float) -> float:
    """Find the largest approach at which a plane is not in contact yet [mm].

    Args:
        touched: Tells whether it is at an approach.
        half: Half size of the plane [mm].

    Raises:
        NotConverged: When it never is.
    """
    below, above, width = -_FIRST * half, _FIRST * half, np.inf
    while touched(below):
        below, above = 3.0 * below, below
    while not touched(above):
        below, above = above, 3.0 * above
        if above > _FARTHEST * half:
            raise _failure("NO_CONTACT")
    while 0.0 < above - below < width:
        width, middle = above - below, 0.5 * (below + above)
        below, above = (below, middle) if touched(middle) else (middle, above)
    return below


def _direction(motions: Motions, now: Array, found: Excess) -> tuple[Array, bool]:
    """Return Newton's step, or a first trial where nothing resists, and whether it is Newton's."""
    values, vectors = np.linalg.eigh(motions.stiffness(now))
    wanted = -vectors.T @ found.load
    loose = values <= LOOSE * max(values[-1], 0.0)
    falling = loose & (np.abs(wanted) > _AIM * found.measure)
    if falling.any():
        step = vectors @ np.where(falling, wanted, 0.0)
        return _FIRST * motions.half * step / np.abs(step).max(), False
    return vectors @ np.divide(wanted, values, out=np.zeros_like(wanted), where=~loose), True


def _searched(
    motions: Motions, now: Array, found: Excess, step: Array
) -> tuple[Array, Excess] | None:
    """Lengthen or shorten a step until the slope of the energy along it has fallen."""
    slope, low, high = float(found.load @ step), 0.0, np.inf
    share = min(1.0, motions.half / float(np.abs(step).max()))
    for _ in range(_MOST_TRIALS):
        at = now + share * step
        if np.abs(at).max() > _FARTHEST * motions.half:
            raise _failure("NO_SUPPORT" if found.force else "NO_CONTACT")
        trial = motions.excess(at)
        left = float(trial.load @ step)
        if abs(left) <= _ENOUGH * abs(slope):
            return at, trial
        low, high = (share, high) if left < 0.0 else (low, share)
        share = 3.0 * share if high == np.inf else 0.5 * (low + high)
    return None


def _failure(reason: str) -> NotConverged:
    remedies = {
        "NO_CONTACT": "no patch can be touched",
        "NO_SUPPORT": "no further patch can be touched that would hold the plane: prescribe its "
        "tilt (load.tilt) or take more patches (patches.grid)",
    }
    return NotConverged(
        "the balance of the plane",
        reason=reason,
        iterations=0,
        remedy=remedies.get(reason, "take more load steps (load.steps)"),
    )
