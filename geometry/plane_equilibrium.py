"""Equilibrium of a rigid plane: a safeguarded Newton's method in its free motions.

The loads of the plane are the gradient of a convex energy over its approach and slopes, of which
those are free that no load step prescribes. In equilibrium the force is the prescribed one, and
there is no moment about the centre. A step of Newton's method is shortened or lengthened until the
slope of the energy along it has fallen, which always ends. Against a motion that no contact
resists the plane goes on until one does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from patchlaw.geometry.rigid_plane import Control, motion_units, plane_failure
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotConverged

T = TypeVar("T")

TOLERANCE = 1e-10
"""Largest residual of force and moments, over the force and over that times half the diagonal."""

UNSUPPORTED = 1e-11
"""Stiffness against a motion of the plane, relative to the largest, that counts as none."""

_AIM = 1e-13
"""The same that is aimed at, as far as the rounding of displacements allows it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneResponse(Generic[T]):
    """What contacts do to a rigid plane at one position.

    Args:
        loads: Force and first moments about the centre, shape (3,) [N, N mm].
        stiffness: Returns the derivative of the loads by approach and slopes, symmetric, shape
            (3, 3).
        state: Whatever else is known of the contacts.
    """

    loads: Array
    stiffness: Callable[[], Array]
    state: T


class _Trial(NamedTuple, Generic[T]):
    """A plane, and its residual loads along the free motions: force, moments over ``half`` [N]."""

    plane: Array
    residual: Array
    force: float
    response: PlaneResponse[T]


def find_equilibrium(
    respond: Callable[[Array], PlaneResponse[T]],
    control: Control,
    start: Array,
    half: float,
    *,
    aim: float = _AIM,
    first_touch: float | None = None,
) -> tuple[Array, T]:
    """Find the plane whose loads are those prescribed.

    Args:
        respond: Returns what the contacts do to a plane (3,).
        control: What is prescribed.
        start: Approach and slopes to start from, with those that are prescribed, shape (3,).
        half: Half the diagonal of the interface [mm].
        aim: Residual of force and moments to aim at, relative to the force and to that times
            ``half``; `TOLERANCE` is accepted where no step brings them closer.
        first_touch: Approach of first touch under the slopes of the start [mm], where contacts
            may refuse to be pressed farther than their model can bear: steps are shortened then,
            and the start retreats. None where a refusal is final.

    Returns:
        Approach and slopes, shape (3,), and the state of the contacts there.

    Raises:
        NotConverged: When nothing can hold the plane, no equilibrium is found, or loads are not
            numbers.
    """
    motions = _FreeMotions(respond, control, half, final=first_touch is None)
    now = motions.begun(np.array(start, dtype=np.float64), first_touch)
    largest = 0.0
    for _ in range(100):
        measure = max(now.force, control.force or 0.0)
        if np.abs(now.residual).max(initial=0.0) <= aim * measure:
            return now.plane, now.response.state
        largest = max(largest, measure)
        stiffness = motions.stiffness(now)
        # where nothing resists, a millionth of half the diagonal is tried first
        step, resisted = _direction(stiffness, now.residual, aim * measure, 1e-6 * half)
        rounding = 64.0 * float(np.finfo(float).eps) * motions.size(now.plane)
        if resisted and np.abs(step).max() <= rounding:
            now = motions.trial(motions.moved(now, step))  # displacements allow no more
            return now.plane, now.response.state
        if control.force is None and measure <= 1e-6 * largest:
            # Newton's steps alone come ever closer to a plane that is clear, and never there
            clear = motions.trial(motions.moved(now, 3.0 * step))
            if clear.force == 0.0:
                return clear.plane, clear.response.state
        reached = motions.searched(now, step)
        if reached is None:
            break
        now = reached
    measure = max(now.force, control.force or 0.0)
    if np.abs(now.residual).max() <= max(aim, TOLERANCE) * measure:
        return now.plane, now.response.state
    raise plane_failure(control, "NO_EQUILIBRIUM")


class _FreeMotions(Generic[T]):
    """The motions of a plane that follow from its loads, each a displacement of its corner [mm].

    Args:
        respond: As in `find_equilibrium`.
        control: As there.
        half: As there.
        final: Whether a refusal of the contacts ends the search.
    """

    def __init__(
        self,
        respond: Callable[[Array], PlaneResponse[T]],
        control: Control,
        half: float,
        *,
        final: bool,
    ) -> None:
        self._respond, self._control, self._half, self._final = respond, control, half, final
        self._free, self._scale = control.free, motion_units(half)
        self.unit = self._scale[self._free]

    def trial(self, plane: Array) -> _Trial[T]:
        """Evaluate the contacts under a plane (3,)."""
        response = self._respond(plane)
        loads = response.loads
        if not np.isfinite(loads).all():
            raise plane_failure(self._control, "NOT_A_NUMBER")
        residual = ((loads - self._control.loads) * self._scale)[self._free]
        return _Trial(plane, residual, float(loads[0]), response)

    def begun(self, plane: Array, first_touch: float | None) -> _Trial[T]:
        """Evaluate a start, or nearer to first touch where the contacts cannot bear so much."""
        for _ in range(6):
            try:
                return self.trial(plane)
            except NotConverged:
                if first_touch is None or not self._control.force or plane[0] <= first_touch:
                    raise
                plane = np.array([0.5 * (plane[0] + first_touch), *plane[1:]])
        return self.trial(plane)

    def stiffness(self, now: _Trial[T]) -> Array:
        """Return the derivative of the residual by the motions, shape (k, k) [N/mm]."""
        stiffness = now.response.stiffness()[np.ix_(self._free, self._free)]
        return stiffness * np.outer(self.unit, self.unit)

    def size(self, plane: Array) -> float:
        """Return the size of the numbers whose differences displacements are [mm]."""
        return float(np.abs(plane) @ (1.0 / self._scale))

    def moved(self, now: _Trial[T], motion: Array) -> Array:
        """Return the plane (3,) after a motion."""
        plane = now.plane.copy()
        plane[self._free] += self.unit * motion
        return plane

    def searched(self, now: _Trial[T], step: Array) -> _Trial[T] | None:
        """Search along a step, and return where it leads; None where it gains nothing."""
        trial = now

        def slope_after(share: float) -> float:
            nonlocal trial
            plane = self.moved(now, share * step)
            if np.abs(plane[self._free] / self.unit).max() > 1e3 * self._half:
                raise plane_failure(self._control, "NO_SUPPORT" if now.force else "NO_CONTACT")
            try:
                trial = self.trial(plane)
            except NotConverged:
                if self._final:
                    raise
                return np.inf
            # less than the tolerance is lost by rounding alone, and is no support to be kept
            held = now.force > TOLERANCE * (self._control.force or np.inf)
            return np.inf if held and trial.force == 0.0 else float(trial.residual @ step)

        longest = self._half / float(np.abs(step).max())
        share = slope_search(slope_after, float(now.residual @ step), min(1.0, longest))
        return None if share is None else trial


def _direction(
    stiffness: Array, residual: Array, nothing: float, first: float
) -> tuple[Array, bool]:
    """Return Newton's step, or a first trial where nothing resists, and whether it is Newton's."""
    values, vectors = np.linalg.eigh(stiffness)
    loads = -vectors.T @ residual
    loose = values <= UNSUPPORTED * max(values[-1], 0.0)
    falling = loose & (np.abs(loads) > nothing)
    if falling.any():
        step = vectors @ np.where(falling, loads, 0.0)
        return first * step / np.abs(step).max(), False
    return vectors @ np.divide(loads, values, out=np.zeros_like(loads), where=~loose), True


def slope_search(slope_after: Callable[[float], float], slope: float, share: float) -> float | None:
    """Shorten or lengthen a step until the slope of a convex function along it has fallen.

    Only slopes are looked at: near a minimum the values of a function differ by less than their
    rounding, and their slopes do not.

    Args:
        slope_after: Returns the slope along the step after a share of it; infinite where the
            share is to be shortened anyway. The share that is returned was evaluated last.
        slope: Slope before the step, negative.
        share: Share of the step to try first.

    Returns:
        A share after which the size of the slope is at most 0.9 times that before; None when
        there is none to rounding.

    Source:
        Nocedal & Wright 2006, ch. 3, doi 10.1007/978-0-387-40065-5.
    """
    low, high = 0.0, np.inf
    for _ in range(100):
        left = slope_after(share)
        if abs(left) <= 0.9 * abs(slope):
            return share
        low, high = (share, high) if left < 0.0 else (low, share)
        share = 3.0 * share if high == np.inf else 0.5 * (low + high)
    return None
