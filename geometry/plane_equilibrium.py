"""Equilibrium of a rigid plane: a safeguarded Newton's method in its free motions.

The loads of the plane are the gradient of a convex energy over its approach and slopes, of which
those are free that no load step prescribes. In equilibrium the force is the prescribed one, and
there is no moment about the centre. A step of Newton's method is shortened or lengthened until the
slope of the energy along it has fallen, which always ends. Against a motion that no contact
resists the plane goes on until one does.

Source:
    Nocedal & Wright 2006, ch. 3 (line search) and 6 (BFGS), doi 10.1007/978-0-387-40065-5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from geometry.rigid_plane import Control, motion_units

Array = NDArray[np.float64]
T = TypeVar("T")

TOLERANCE = 1e-10
"""What force and moments may miss, relative to the force and to that times half the diagonal."""

UNSUPPORTED = 1e-11
"""Stiffness against a motion of the plane, relative to the largest, that counts as none."""

_AIM = 1e-13  # what force and moments miss where the rounding of displacements allows it
_DECREASE = 0.9  # share of the energy's slope that may remain after a step
_CLEAR = 1e-6  # of the largest force: the plane may be about to leave the surface
_FIRST = 1e-6  # of half the diagonal: first trial of a motion that nothing resists
_FARTHEST = 1e3  # halves of the diagonal up to which a support is looked for
_MOST_STEPS, _MOST_TRIALS, _MOST_RETREATS = 100, 100, 6
_ROUNDING = 64.0 * float(np.finfo(float).eps)  # of the plane's motions


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneResponse(Generic[T]):
    """What contacts do to a rigid plane at one position.

    Args:
        loads: Force and first moments about the centre, shape (3,) [N, N mm].
        stiffness: Returns the derivative of the loads by approach and slopes, at least nearly,
            symmetric, shape (3, 3).
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
    nearly: bool = False,
    first_touch: float | None = None,
) -> tuple[Array, T]:
    """Find the plane whose loads are those prescribed.

    Args:
        respond: Returns what the contacts do to a plane (3,).
        control: What is prescribed.
        start: Approach and slopes to start from, with those that are prescribed, shape (3,).
        half: Half the diagonal of the interface [mm].
        aim: What force and moments should miss at most, relative to the force and to that times
            ``half``; `TOLERANCE` will do where no step brings them closer.
        nearly: Whether stiffnesses are inexact; the last step corrects them then (BFGS).
        first_touch: Approach of first touch under the slopes of the start [mm], where contacts
            may refuse to be pressed farther than their model can bear: steps are shortened then,
            and the start retreats. None where a refusal is final.

    Returns:
        Approach and slopes, shape (3,), and the state of the contacts there.

    Raises:
        NotConverged: When nothing can hold the plane, no equilibrium is found, or loads are not
            numbers.
    """
    free, scale = control.free, motion_units(half)
    unit = scale[free]

    def trial(plane: Array) -> _Trial[T]:
        response = respond(plane)
        loads = response.loads * scale
        if not np.isfinite(loads).all():
            raise plane_failure(control, "NOT_A_NUMBER")
        return _Trial(plane, (loads - control.loads)[free], float(loads[0]), response)

    now = found = _begun(trial, control, np.array(start, dtype=np.float64), first_touch)
    step, change, largest = np.zeros(len(unit)), np.zeros(len(unit)), 0.0

    def moved(motion: Array) -> Array:
        plane = now.plane.copy()
        plane[free] += unit * motion
        return plane

    def slope_after(share: float) -> float:
        nonlocal found
        plane = moved(share * step)
        if np.abs(plane[free] / unit).max() > _FARTHEST * half:
            raise plane_failure(control, "NO_SUPPORT" if now.force else "NO_CONTACT")
        try:
            found = trial(plane)
        except NotConverged:
            if first_touch is None:
                raise
            return np.inf
        lost = bool(control.force) and now.force > 0.0 and found.force == 0.0
        return np.inf if lost else float(found.residual @ step)

    for _ in range(_MOST_STEPS):
        missed = float(np.abs(now.residual).max(initial=0.0))
        measure = max(now.force, control.force or 0.0)
        if missed <= aim * measure:
            return now.plane, now.response.state
        largest = max(largest, measure)
        stiffness = now.response.stiffness()[np.ix_(free, free)] * np.outer(unit, unit)
        if nearly:
            stiffness = _corrected(stiffness, step, change)
        step, resisted = _direction(stiffness, now.residual, aim * measure, _FIRST * half)
        if resisted and np.abs(step).max() <= _ROUNDING * float(np.abs(now.plane) @ (1.0 / scale)):
            now = trial(moved(step))  # rounding of displacements allows no more
            return now.plane, now.response.state
        if control.force is None and measure <= _CLEAR * largest:
            # Newton's steps alone come ever closer to a plane that is clear, and never there
            clear = trial(moved(3.0 * step))
            if clear.force == 0.0:
                return clear.plane, clear.response.state
        longest = half / float(np.abs(step).max())
        share = slope_search(slope_after, float(now.residual @ step), min(1.0, longest))
        if share is None:
            break
        step, change, now = share * step, found.residual - now.residual, found
    missed = float(np.abs(now.residual).max())
    if missed <= max(aim, TOLERANCE) * max(now.force, control.force or 0.0):
        return now.plane, now.response.state
    raise plane_failure(control, "NO_EQUILIBRIUM")


def slope_search(slope_after: Callable[[float], float], slope: float, share: float) -> float | None:
    """Shorten or lengthen a step until the slope of a convex function along it has fallen.

    Args:
        slope_after: Returns the slope along the step after a share of it; infinite where the
            share is to be shortened anyway. The share that is returned was evaluated last.
        slope: Slope before the step, negative.
        share: Share of the step to try first.

    Returns:
        A share after which the size of the slope is at most 0.9 times that before; None when
        there is none to rounding.
    """
    low, high = 0.0, np.inf
    for _ in range(_MOST_TRIALS):
        left = slope_after(share)
        if abs(left) <= _DECREASE * abs(slope):
            return share
        low, high = (share, high) if left < 0.0 else (low, share)
        share = 3.0 * share if high == np.inf else 0.5 * (low + high)
    return None


def plane_failure(control: Control, reason: str, iterations: int = 0) -> NotConverged:
    """Return the error of a plane that finds no equilibrium."""
    remedies = {
        "NO_CONTACT": "no patch can be touched",
        "NO_SUPPORT": "no further patch can be touched that would hold the plane: prescribe its "
        "tilt (load.tilt) or take more patches (patches.grid)",
    }
    usual = "take more load steps (load.steps) or prescribe the tilt (load.tilt)"
    return NotConverged(
        f"the equilibrium of the plane at {control}",
        reason=reason,
        iterations=iterations,
        remedy=remedies.get(reason, usual),
    )


def _begun(
    trial: Callable[[Array], _Trial[T]],
    control: Control,
    plane: Array,
    first_touch: float | None,
) -> _Trial[T]:
    """Evaluate a start, or nearer to first touch where the contacts cannot bear so much."""
    for _ in range(_MOST_RETREATS):
        try:
            return trial(plane)
        except NotConverged:
            if first_touch is None or not control.force or plane[0] <= first_touch:
                raise
            plane = np.array([0.5 * (plane[0] + first_touch), *plane[1:]])
    return trial(plane)


def _direction(
    stiffness: Array, residual: Array, nothing: float, first: float
) -> tuple[Array, bool]:
    """Return Newton's step, or a first trial where nothing resists, and whether it is Newton's."""
    values, vectors = np.linalg.eigh(stiffness)
    wanted = -vectors.T @ residual
    loose = values <= UNSUPPORTED * max(values[-1], 0.0)
    falling = loose & (np.abs(wanted) > nothing)
    if falling.any():
        step = vectors @ np.where(falling, wanted, 0.0)
        return first * step / np.abs(step).max(), False
    return vectors @ np.divide(wanted, values, out=np.zeros_like(wanted), where=~loose), True


def _corrected(stiffness: Array, step: Array, change: Array) -> Array:
    """Return a stiffness that tells the change of the residual in the last step (BFGS)."""
    curvature, pushed = float(step @ change), stiffness @ step
    told = float(step @ pushed)
    if told <= 0.0 or curvature <= 1e-8 * told:
        return stiffness
    update = np.outer(change, change) / curvature - np.outer(pushed, pushed) / told
    return np.asarray(stiffness + update)
