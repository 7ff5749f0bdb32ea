"""Equilibrium of a rigid plane on contacts that are few: its loads and stiffness are at hand.

Force and moments are the gradient of a convex energy over the plane's motions (approach, two
slopes). Newton's method, its stiffness corrected by the last step (BFGS) and its steps by a search
for a smaller slope of the energy, brings those that are free into balance.

Source:
    Nocedal & Wright 2006, ch. 3 and 6, doi 10.1007/978-0-387-40065-5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, linprog

from geometry import Control
from geometry.errors import NotConverged
from geometry.rigid_plane import RigidPlane

Array = NDArray[np.float64]
T = TypeVar("T")

TOLERANCE = 1e-9
"""What force and moments may miss, relative to the force and to that times half the diagonal."""

_LEVEL = (0.0, 0.0)
_MOST_EVALUATIONS = 100
_MOST_SHARES = 60
_MOST_RETREATS = 6
_ENOUGH = 0.9  # share of a slope that a step may leave, or it is lengthened or shortened
_SOFT = 1e-9  # of the mean stiffness: what holds motions that no contact resists
_ROUNDING = 64.0 * np.finfo(float).eps


class Held(NamedTuple):
    """What contacts do to a rigid plane.

    Attributes:
        loads: Force and first moments about the middle, shape (3,) [N, N mm].
        stiffness: Their derivative by approach and slopes, at least nearly, shape (3, 3).
    """

    loads: Array
    stiffness: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """Points that a rigid plane can touch, with forces that do not see each other.

    Args:
        lever: 1 and the distances along x and y from the middle, shape (n, 3) [1, mm, mm].
        below: Depths below the height that approaches count from, shape (n,) [mm].
        force: Returns the force of a plane that penetrates the points by (n,) mm [N].
        half: Half the diagonal of the rectangle [mm].
    """

    lever: Array
    below: Array
    force: Callable[[Array], float]
    half: float

    def first_touch(self, tilt: tuple[float, float]) -> float:
        """Return the approach at which a plane of given slopes touches first [mm]."""
        return float((self.below - self.lever[:, 1:] @ np.asarray(tilt)).min(initial=np.inf))

    def first_plane(self, control: Control, near: RigidPlane | None) -> Array:
        """Return a plane to start from: one near, or one in balance with contacts that stand alone.

        Args:
            control: What is prescribed.
            near: A plane in equilibrium nearby.

        Returns:
            Approach and slopes, shape (3,).

        Raises:
            NotConverged: When no plane can be in balance.
        """
        tilt = control.tilt
        if tilt is None:
            kept = near is not None and (control.approach or np.inf) >= near.approach
            # without force nothing turns the plane
            tilt = near.tilt if near and (kept or control.force == 0.0) else None
        if tilt is None:
            tilt = _LEVEL if control.force == 0.0 else self._resting(control)
        if control.approach is not None:
            return np.array([control.approach, *tilt])
        touch = self.first_touch(tilt)
        if not np.isfinite(touch):
            raise failure(control, "NO_CONTACT", 0)
        if near is not None and control.force and near.approach > touch:
            return np.array([near.approach, *tilt])
        return np.array([touch + self._depth(control.force or 0.0, tilt), *tilt])

    def _depth(self, force: float, tilt: tuple[float, float]) -> float:
        """Return how far a plane moves from first touch under a force [mm]."""
        if force == 0.0:
            return 0.0
        gap = self.below - self.lever[:, 1:] @ np.asarray(tilt)
        gap = gap - gap.min()

        def lacking(depth: float) -> float:
            return self.force(depth - gap) - force

        most = 1e-6 * self.half
        while lacking(most) < 0.0:
            most *= 4.0
        return float(brentq(lacking, 0.0, most, rtol=1e-3))

    def _resting(self, control: Control) -> tuple[float, float]:
        """Return the slopes of a plane that rests on the peaks under a force in the middle.

        Of all planes that penetrate none it has come nearest, by a linear programme; under a given
        approach it need not come much nearer than that.
        """
        if not len(self.below):
            return _LEVEL
        scale = float(np.ptp(self.below)) or 1.0
        most = None if control.approach is None else control.approach / scale + 1.0
        found = linprog(
            [-1.0, 0.0, 0.0],
            A_ub=self.lever / [1.0, self.half, self.half],
            b_ub=self.below / scale,
            bounds=[(None, most), (None, None), (None, None)],
            method="highs",
        )
        if found.status != 0:  # the middle lies outside of the peaks' hull
            raise failure(control, "NO_BALANCE", 0)
        slopes = found.x[1:] * (scale / self.half)
        return float(slopes[0]), float(slopes[1])


def balanced(
    evaluate: Callable[[Array], tuple[Held, T]], control: Control, first: Array, peaks: Peaks
) -> tuple[Array, T]:
    """Find the plane in balance with what is prescribed.

    Args:
        evaluate: Returns what the contacts do to a plane (3,), and whatever else is known of them.
        control: What is prescribed.
        first: A plane to start from, with the prescribed approach or slopes, shape (3,).
        peaks: The points that the plane can touch.

    Returns:
        The plane, and what ``evaluate`` told about it.

    Raises:
        NotConverged: When no plane is found, or ``evaluate`` fails.
    """
    half, turns = peaks.half, control.tilt is None and control.force != 0.0
    free = np.array([bool(control.force), turns, turns])
    unit = np.array([1.0, 1.0 / half, 1.0 / half])[free]
    wanted = np.array([control.force or 0.0, 0.0, 0.0])[free]

    def lacking(plane: Array) -> tuple[Array, Array, float, T]:
        held, known = evaluate(plane)
        stiffness = held.stiffness[np.ix_(free, free)] * np.outer(unit, unit)
        return (held.loads[free] - wanted) * unit, stiffness, float(held.loads[0]), known

    plane, at = _begun(lacking, control, np.array(first, float), peaks)
    step, change = np.zeros(len(unit)), np.zeros(len(unit))
    for count in range(_MOST_EVALUATIONS):
        residual, stiffness, force, known = at
        if np.abs(residual).max(initial=0.0) <= TOLERANCE * max(force, control.force or 0.0):
            return plane, known
        step = -np.linalg.solve(_corrected(stiffness, step, change), residual)
        if np.abs(step).max() <= _ROUNDING * (np.abs(plane) @ [1.0, half, half]):
            return plane, known
        share, found = _searched(lacking, plane, residual, free, unit, step)
        if found is None:
            raise failure(control, "NO_BALANCE", count)
        step, change, at = share * step, found[0] - residual, found
        plane[free] += unit * step
    raise failure(control, "NO_BALANCE", _MOST_EVALUATIONS)


def _begun(
    lacking: Callable[[Array], tuple[Array, Array, float, T]],
    control: Control,
    plane: Array,
    peaks: Peaks,
) -> tuple[Array, tuple[Array, Array, float, T]]:
    """Start from a plane, or nearer to first touch where the contacts do not bear so much."""
    touch = peaks.first_touch((plane[1], plane[2]))
    for _ in range(_MOST_RETREATS):
        try:
            return plane, lacking(plane)
        except NotConverged:
            if not control.force or plane[0] <= touch:
                raise
            plane[0] = 0.5 * (plane[0] + touch)
    return plane, lacking(plane)


def _searched(
    lacking: Callable[[Array], tuple[Array, Array, float, T]],
    plane: Array,
    residual: Array,
    free: NDArray[np.bool_],
    unit: Array,
    step: Array,
) -> tuple[float, tuple[Array, Array, float, T] | None]:
    """Shorten or lengthen a step until the slope of the energy along it has fallen."""
    slope, share, low, high = float(residual @ step), 1.0, 0.0, np.inf
    for _ in range(_MOST_SHARES):
        trial = plane.copy()
        trial[free] += unit * share * step
        try:
            found = lacking(trial)
        except NotConverged:  # contacts pressed beyond what their model can bear
            high = share
            share = 0.5 * (low + high)
            continue
        left = float(found[0] @ step)
        lost = free[0] and found[2] == 0.0  # a force that nothing bears
        if abs(left) <= _ENOUGH * abs(slope) and not lost:
            return share, found
        low, high = (share, high) if left < 0.0 and not lost else (low, share)
        share = 3.0 * share if high == np.inf else 0.5 * (low + high)
    return share, None


def _corrected(stiffness: Array, step: Array, change: Array) -> Array:
    """Return a stiffness that tells the change of the last step (BFGS), and is never singular."""
    size = float(np.trace(stiffness))
    held = stiffness + _SOFT * (size or 1.0) * np.eye(len(stiffness))
    curve, pushed = float(step @ change), held @ step
    if curve <= 1e-8 * float(step @ pushed):
        return held
    update = np.outer(change, change) / curve - np.outer(pushed, pushed) / float(step @ pushed)
    return np.asarray(held + update)


def contact_stiffness(lever: Array, rate: Array, coupling: Array | None = None) -> Array:
    """Return the derivative of a rigid plane's loads by its motions, shape (k, k).

    Args:
        lever: Displacements of the m contacts by unit motions, shape (m, k).
        rate: Derivatives dP/dt of the forces by the own indentations, shape (m,) [N/mm].
        coupling: Derivatives of the displacements by all contacts' own indentations but a
            contact's own through the half-space, shape (m, m); none when not given.
    """
    own = lever
    if coupling is not None and len(rate):
        own = np.linalg.solve(np.eye(len(rate)) + coupling, lever)
    found = lever.T @ (rate[:, None] * own)
    return np.asarray(0.5 * (found + found.T))


def failure(control: Control, reason: str, iterations: int) -> NotConverged:
    """Return the error of a plane that finds no balance."""
    given = f"approach {control.approach} mm"
    if control.force is not None:
        given = f"force {control.force:.6g} N"
    return NotConverged(
        f"the balance of the plane at {given}",
        reason=reason,
        iterations=iterations,
        remedy="take more load steps (load.steps) or prescribe the tilt (load.tilt)",
    )
