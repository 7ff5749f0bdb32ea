"""Newton's method for patch laws on a condensed compliance, bordered by force and moment."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.control import Control
from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from multiscale.loading import described

if TYPE_CHECKING:
    from multiscale.laws import LawPoint

Array = NDArray[np.float64]

TOLERANCE = 1e-12
"""Residual of a solution: of the closures relative to the largest approach, of the force and the
moment relative to the largest force and that force times half the interface's diagonal."""

_MOST_STEPS = 100
_MOST_HALVINGS = 40
_MEMORY = 4  # residuals that a step is compared with: kinks of the laws let it rise for a while
_DECREASE = 1e-4  # share of the predicted decrease that a step must bring
_UNSUPPORTED = 1e-11  # of the largest stiffness against motions of the plane: no support at all
_FARTHEST = 1e3  # halves of the diagonal up to which a first contact is looked for
_BISECTIONS = 30  # for a start: a few digits will do
_BITE = 0.02  # share of the largest approach by which a plane without support goes past touch


class Laws(Protocol):
    """Laws of N patches over their local rigid approaches."""

    @property
    def touch(self) -> Array:
        """Closures at first touch, infinite for a patch that stays open, shape (N,) [mm]."""

    def along(self, approach: Array, /) -> LawPoint:
        """Return closures, pressures and their derivatives at local approaches, shape (N,)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DenseState:
    """Equilibrium of the patches.

    Attributes:
        local: Local rigid approaches of the laws, shape (N,) [mm].
        plane: Approach at the middle of the interface [mm] and slopes along x and y, shape (3,).
        closure: Closures, shape (N,) [mm].
        pressure: Pressures, shape (N,) [MPa].
        load: Force [N] and its first moments about the middle [N mm], shape (3,).
        iterations: Newton steps.
        residuals: Residual before every step and at the end, relative as in `TOLERANCE`.
    """

    local: Array
    plane: Array
    closure: Array
    pressure: Array
    load: Array
    iterations: int
    residuals: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Iterate:
    local: Array
    plane: Array
    point: LawPoint
    gap: Array  # closures that are missing, shape (N,)
    lack: Array  # force and moments that are missing, shape (3,)
    load: Array


class DenseNewton:
    """Solves closure_i(s_i) = δ_i − Σ_j C_ij p_j(s_j) for the local approaches s of all patches.

    The laws are given over the local approach, so that it does not matter whether their pressure
    is a function of closure. Where the plane's force is prescribed, or its moment is zero, its
    approach and slopes are unknowns beside s, eliminated by Schur's complement. Steps are halved
    until the residual falls; a plane that nothing supports moves on to the next touch.

    Args:
        laws: The laws.
        compliance: C, mean displacement of patch i by unit pressure on patch j, (N, N) [mm/MPa].
        patches: The partition.

    Raises:
        InputError: When the compliance is not a finite matrix of the size of the partition.
    """

    def __init__(self, laws: Laws, compliance: Array, patches: PatchGrid) -> None:
        count = patches.count
        if compliance.shape != (count, count) or not np.all(np.isfinite(compliance)):
            raise InputError(
                "the compliance does not fit the patches",
                value=compliance.shape,
                allowed=f"a finite matrix of shape {(count, count)}",
            )
        self.laws, self._compliance = laws, compliance
        middle = np.add(patches.origin, np.multiply(0.5, patches.lengths))
        self._lever = np.column_stack((np.ones(count), patches.centres - middle))
        self._area = patches.area
        self._half = 0.5 * float(np.hypot(*patches.lengths))

    def solve(self, control: Control, start: DenseState | None = None) -> DenseState:
        """Find the equilibrium of one load step.

        Args:
            control: What the step prescribes.
            start: A solution nearby.

        Raises:
            NotConverged: When neither the start nor an unloaded interface leads to a solution.
        """
        if control.force == 0.0:
            control = self._just_touching(control, start)
        if start is not None:
            try:
                return self._iterate(control, start.local, self._prescribed(control, start.plane))
            except NotConverged:  # a law's kink between the two: try without the earlier solution
                pass
        plane = self._prescribed(control, np.zeros(3) if start is None else start.plane)
        return self._iterate(control, *self._cold_start(control, plane))

    def _iterate(self, control: Control, local: Array, plane: Array) -> DenseState:
        free = np.array([control.force is not None, *(control.tilt is None,) * 2])
        now = self._at(local, plane, control)
        largest = 0.0
        residuals: list[float] = []
        recent: deque[float] = deque(maxlen=_MEMORY)
        for _ in range(_MOST_STEPS):
            largest = max(largest, float(now.load[0]))
            scales = self._scales(control, now.plane, largest)
            residuals.append(self._norm(now, free, scales, np.inf))
            if residuals[-1] <= TOLERANCE:
                return self._state(now, residuals)
            ds, dq, supported = self._direction(now, free, scales)
            if not supported:
                now = self._at(now.local + ds, now.plane + dq, control)
                recent.clear()
                continue
            recent.append(self._norm(now, free, scales, 2))
            now = self._searched(now, ds, dq, control, free, scales, max(recent), residuals)
        raise _failure(control, "DIVERGED_MAX_IT", len(residuals))

    def _direction(self, now: _Iterate, free: Array, scales: Array) -> tuple[Array, Array, bool]:
        """Return the change of s and of the plane, and whether it is Newton's."""
        point, lever = now.point, self._lever[:, free]
        tangent = self._compliance * point.dpressure
        tangent[np.diag_indices_from(tangent)] += point.dclosure
        solved = np.linalg.solve(tangent, np.column_stack((now.gap, lever)))
        step, columns = solved[:, 0], solved[:, 1:]
        change = np.zeros(3)
        if not free.any():
            return step, change, True
        # motions of the plane in units of displacement at the interface's edge
        unit = np.array([1.0, 1.0 / self._half, 1.0 / self._half])[free]
        pull = self._area * (lever * unit).T * point.dpressure
        values, vectors = np.linalg.eigh(_symmetric(pull @ columns * unit))
        wanted = vectors.T @ (now.lack[free] * unit - pull @ step)
        loose = values <= _UNSUPPORTED * max(values[-1], 0.0)
        lacking = loose & (np.abs(wanted) > TOLERANCE * scales[1])
        if lacking.any():
            change[free] = unit * (vectors @ np.where(lacking, wanted, 0.0))
            return *self._to_next_touch(now, change), False
        values[loose], wanted[loose] = 1.0, 0.0
        change[free] = unit * (vectors @ (wanted / values))
        return step + columns @ change[free], change, True

    def _to_next_touch(self, now: _Iterate, motion: Array) -> tuple[Array, Array]:
        """Move a plane that is not supported against a motion until one more patch is touched."""
        rise = self._lever @ motion
        ahead = self.laws.touch - now.point.closure
        coming = (now.point.pressure == 0.0) & (rise > 1e-9 * np.abs(rise).max()) & (ahead < np.inf)
        if not coming.any():
            raise NotConverged(
                "the equilibrium of the plane",
                reason="NO_SUPPORT",
                iterations=0,
                remedy="no further patch can be touched that would hold the plane: prescribe its "
                "tilt (load.tilt) or take more patches (patches.grid)",
            )
        bite = _BITE * max(float(np.abs(self._lever @ now.plane).max()), float(ahead[coming].max()))
        share = float(np.min((np.maximum(ahead[coming], 0.0) + bite) / rise[coming]))
        return share * rise, share * motion

    def _searched(
        self,
        now: _Iterate,
        ds: Array,
        dq: Array,
        control: Control,
        free: Array,
        scales: Array,
        reference: float,
        residuals: list[float],
    ) -> _Iterate:
        """Halve a Newton step until the residual is below those of the last steps."""
        for share in 0.5 ** np.arange(_MOST_HALVINGS):
            trial = self._at(now.local + share * ds, now.plane + share * dq, control)
            if self._norm(trial, free, scales, 2) <= (1.0 - _DECREASE * share) * reference:
                return trial
        raise _failure(control, "DIVERGED_LINE_SEARCH", len(residuals))

    def _at(self, local: Array, plane: Array, control: Control) -> _Iterate:
        point = self.laws.along(local)
        load = self._area * (self._lever.T @ point.pressure)
        gap = self._lever @ plane - point.closure - self._compliance @ point.pressure
        wanted = np.array([control.force or 0.0, 0.0, 0.0])
        return _Iterate(local, plane, point, gap, wanted - load, load)

    def _scales(self, control: Control, plane: Array, largest: float) -> Array:
        """Return what closures, force and moments are measured by."""
        approach = max(float(np.abs(self._lever @ plane).max()), 1e-9 * self._half)
        force = max(control.force or 0.0, largest) or 1.0
        return np.array([approach, force, force * self._half])

    def _norm(self, now: _Iterate, free: Array, scales: Array, order: float) -> float:
        lack = now.lack[free] / scales[[1, 2, 2]][free]
        return float(np.linalg.norm(np.concatenate((now.gap / scales[0], lack)), order))

    def _state(self, now: _Iterate, residuals: list[float]) -> DenseState:
        return DenseState(
            local=now.local,
            plane=now.plane,
            closure=now.point.closure,
            pressure=now.point.pressure,
            load=now.load,
            iterations=len(residuals) - 1,
            residuals=tuple(residuals),
        )

    def _prescribed(self, control: Control, plane: Array) -> Array:
        """Return a plane's approach and slopes with those that are prescribed put in."""
        plane = plane.copy()
        if control.approach is not None:
            plane[0] = control.approach
        if control.tilt is not None:
            plane[1:] = control.tilt
        return plane

    def _just_touching(self, control: Control, start: DenseState | None) -> Control:
        """Return what stands for a force of zero: the plane where its first patch is touched."""
        plane = self._prescribed(control, np.zeros(3) if start is None else start.plane)
        approach = float(np.min(self.laws.touch - self._lever[:, 1:] @ plane[1:]))
        if not np.isfinite(approach):
            raise _failure(control, "NO_CONTACT", 0)
        return Control(approach=approach, tilt=(float(plane[1]), float(plane[2])))

    def _cold_start(self, control: Control, plane: Array) -> tuple[Array, Array]:
        """Return one common approach of all laws, and the plane, that fit the load on average."""
        lean = self._lever[:, 1:] @ plane[1:]

        def mean_approach(point: LawPoint) -> float:
            """Return the plane's approach that the pressures see on their average."""
            gap = point.closure + self._compliance @ point.pressure - lean
            return float(gap @ point.pressure / point.pressure.sum())

        def excess(common: float) -> float:
            point = self.laws.along(common + lean)
            if not point.pressure.any():
                return -1.0
            if control.force is not None:
                return self._area * float(point.pressure.sum()) - control.force
            return mean_approach(point) - plane[0]

        below, above = -self._half, 1e-6 * self._half
        while excess(above) < 0.0:
            below, above = above, 2.0 * above
            if above > _FARTHEST * self._half:
                if control.force is not None:
                    raise _failure(control, "NO_CONTACT", 0)
                return self._lever @ plane, plane  # nothing is touched
        for _ in range(_BISECTIONS):
            middle = 0.5 * (below + above)
            below, above = (middle, above) if excess(middle) < 0.0 else (below, middle)
        if control.force is not None:
            plane[0] = mean_approach(self.laws.along(above + lean))
        return above + lean, plane


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


def _failure(control: Control, reason: str, iterations: int) -> NotConverged:
    return NotConverged(
        f"the condensed block at {described(control)}",
        reason=reason,
        iterations=iterations,
        remedy="take more load steps (load.steps)",
    )
