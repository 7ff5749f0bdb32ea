"""The equations of patch laws on a condensed compliance, under one load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from multiscale.laws.tangent import Tangent

if TYPE_CHECKING:
    from multiscale.laws.patch_law import LawPoint

Array = NDArray[np.float64]

TOLERANCE = 1e-12
"""Residual of a solution: of the closures relative to the largest approach, of the force and the
moment relative to the largest force and that force times half the interface's diagonal. Near first
touch, where closures are not known that well, it is relative to what they are known to."""

_FARTHEST = 1e3  # halves of the diagonal up to which a first contact is looked for
_ROUNDING = 8.0 * float(np.finfo(float).eps)  # of approaches, and of the closures laws start at
_BISECTIONS = 30  # for a start: a few digits will do
_BENDS = 40  # Newton steps, or bisections, to a place on all laws
_FLATTEST = 1e-3  # rise of t over s that is one


class Laws(Protocol):
    """Laws of N patches over their local rigid approaches."""

    @property
    def touch(self) -> Array:
        """Closures at first touch, infinite for a patch that stays open, shape (N,) [mm]."""

    def along(self, approach: Array, /) -> LawPoint:
        """Return closures, pressures and their derivatives at local approaches, shape (N,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Iterate:
    """A trial state of patches and plane.

    Attributes:
        local: Local rigid approaches s of the laws, shape (N,) [mm].
        plane: Approach at the middle of the interface [mm] and slopes along x and y, shape (3,).
        point: The laws at s.
        missing: Closures that the laws lack, shape (N,) [mm].
        load: Force [N] and its first moments about the middle [N mm], shape (3,).
    """

    local: Array
    plane: Array
    point: LawPoint
    missing: Array
    load: Array


class DenseEquations:
    """Patches with laws on a block that is known by its compliance.

    Args:
        laws: The laws.
        compliance: Mean displacement of patch i of the block by unit pressure on patch j, shape
            (N, N) [mm/MPa].
        patches: The partition.

    Attributes:
        lever: What the plane's approach and slopes move the patches by, shape (N, 3).
        area: Area of a patch [mm²].
        half: Half the interface's diagonal [mm].
        reach: Size of the closures that the laws start at [mm].

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
        self.laws, self.compliance = laws, compliance
        self._own = np.diagonal(compliance)
        middle = patches.middle
        self.lever: Array = np.column_stack((np.ones(count), patches.centres - middle))
        self.area = patches.area
        self.half = 0.5 * float(np.hypot(*patches.lengths))
        touch = laws.touch[np.isfinite(laws.touch)]
        self.reach = float(np.abs(touch).max(initial=0.0))

    def at(self, local: Array, plane: Array) -> Iterate:
        """Evaluate a trial state."""
        point = self.laws.along(local)
        missing = self.lever @ plane - point.closure - self.compliance @ point.pressure
        load = self.area * (self.lever.T @ point.pressure)
        return Iterate(local, plane, point, missing, load)

    def bent(self, now: Iterate, step: Array, plane: Array) -> Iterate:
        """Evaluate where a step leads that is straight in the patches' approaches if alone.

        Alone on the block a patch is approached by t = c + y p, y its own compliance. Across a kink
        or a wall of a law p jumps over s, but goes on evenly over t, where dp/dt ≤ 1/y. Patches
        whose t does not rise with s go straight.

        Args:
            now: Where the step starts.
            step: Change of the local approaches, shape (N,) [mm].
            plane: The plane after the step, shape (3,).
        """
        rise = now.point.dclosure + self._own * now.point.dpressure
        wanted = now.point.closure + self._own * now.point.pressure + rise * step
        low, high = now.local, now.local + 2.0 * np.maximum(rise, 1.0) * step
        local = now.local + step
        for _ in range(_BENDS):
            point = self.laws.along(local)
            ahead = (wanted - point.closure - self._own * point.pressure) * np.sign(step)
            low, high = np.where(ahead > 0.0, local, low), np.where(ahead > 0.0, high, local)
            slope = np.maximum(point.dclosure + self._own * point.dpressure, _FLATTEST)
            newton = local + ahead * np.sign(step) / slope
            inside = (newton - low) * (newton - high) < 0.0
            local = np.where(inside, newton, 0.5 * (low + high))
        return self.at(np.where(rise > _FLATTEST, local, now.local + step), plane)

    def tangent(self, now: Iterate) -> Tangent:
        """Return the derivative of closure + displacement over the local approaches."""
        return Tangent.of(now.point, lambda of: self.compliance[:, of] * now.point.dpressure[of])


class LoadCase:
    """What one load step asks of the equations.

    Args:
        equations: The equations.
        control: What is prescribed of the plane.

    Attributes:
        free: Which of approach and slopes are unknown, shape (3,).
        unit: Motions of the plane that move the interface's edge by one, shape (3,).
    """

    def __init__(self, equations: DenseEquations, control: Control) -> None:
        self._equations, self.control = equations, control
        turning = control.tilt is None
        self.free = np.array([control.force is not None, turning, turning])
        self.unit = np.array([1.0, 1.0 / equations.half, 1.0 / equations.half])
        self._wanted = np.array([control.force or 0.0, 0.0, 0.0])
        self._largest = control.force or 0.0

    def see(self, iterate: Iterate) -> None:
        """Measure loads by the largest force that was ever met on the way."""
        self._largest = max(self._largest, float(iterate.load[0]))

    @property
    def force(self) -> float:
        """What loads are measured by [N]."""
        return self._largest or 1.0

    def lack(self, iterate: Iterate) -> Array:
        """Return force and moments that are missing, over the plane's free motions [N]."""
        return ((self._wanted - iterate.load) * self.unit)[self.free]

    def residual(self, iterate: Iterate) -> float:
        """Return the norm of what is missing, relative to the largest approach and force."""
        parts = iterate.missing / self._approach(iterate), self.lack(iterate) / self.force
        return float(np.linalg.norm(np.concatenate(parts)))

    def largest(self, iterate: Iterate) -> float:
        """Return the largest of what is missing, where relative to less than rounding to that."""
        closure, load, approach = iterate.missing, self.lack(iterate), self._approach(iterate)
        plain = np.append(np.abs(closure) / approach, np.abs(load) / self.force)
        if plain.max() <= TOLERANCE:
            return float(plain.max())
        equations = self._equations
        rounding = _ROUNDING * max(equations.reach, approach)  # of approaches: what it makes of
        steepest = equations.tangent(iterate).steepest  # closures, and of
        blur = equations.area * float(iterate.point.dpressure.sum())  # the force
        known = max(approach, steepest * rounding / TOLERANCE)
        measure = max(self.force, blur * rounding / TOLERANCE)
        return float(np.append(np.abs(closure) / known, np.abs(load) / measure).max())

    def _approach(self, iterate: Iterate) -> float:
        """Return the largest approach of the plane to a patch [mm]."""
        equations = self._equations
        return max(float(np.abs(equations.lever @ iterate.plane).max()), 1e-9 * equations.half)

    def prescribed(self, plane: Array | None) -> Array:
        """Return a plane's approach and slopes with those that are prescribed put in."""
        found = np.zeros(3) if plane is None else plane.copy()
        if self.control.approach is not None:
            found[0] = self.control.approach
        if self.control.tilt is not None:
            found[1:] = self.control.tilt
        return found

    def just_touching(self, plane: Array | None) -> Control:
        """Return what stands for a force of zero: the plane where its first patch is touched."""
        found = self.prescribed(plane)
        lean = self._equations.lever[:, 1:] @ found[1:]
        approach = float(np.min(self._equations.laws.touch - lean))
        largest = max(self._equations.reach, float(np.abs(approach + lean).max()))
        approach -= 2.0 * TOLERANCE * largest  # so that what the solution misses is not contact
        if not np.isfinite(approach):
            raise self.failure("NO_CONTACT", 0)
        return Control(approach=approach, tilt=(float(found[1]), float(found[2])))

    def cold_start(self, plane: Array) -> tuple[Array, Array]:
        """Return one common approach of all laws, and the plane, that fit the load on average."""
        lean = self._equations.lever[:, 1:] @ plane[1:]

        def excess(common: float) -> float:
            point = self._equations.laws.along(common + lean)
            if not point.pressure.any():
                return -1.0
            if self.control.force is not None:
                return self._equations.area * float(point.pressure.sum()) - self.control.force
            return self._mean_approach(point, lean) - plane[0]

        below, above = -self._equations.half, 1e-6 * self._equations.half
        while excess(above) < 0.0:
            below, above = above, 2.0 * above
            if above > _FARTHEST * self._equations.half:
                if self.control.force is not None:
                    raise self.failure("NO_CONTACT", 0)
                return self._equations.lever @ plane, plane  # nothing is touched
        for _ in range(_BISECTIONS):
            middle = 0.5 * (below + above)
            below, above = (middle, above) if excess(middle) < 0.0 else (below, middle)
        if self.control.force is not None:
            local = above + lean
            plane[0] = self._mean_approach(self._equations.laws.along(local), lean)
        return above + lean, plane

    def failure(self, reason: str, iterations: int) -> NotConverged:
        """Return the error of an iteration that found no equilibrium."""
        return NotConverged(
            f"the condensed block at {self.control}",
            reason=reason,
            iterations=iterations,
            remedy="take more load steps (load.steps)",
        )

    def _mean_approach(self, point: LawPoint, lean: Array) -> float:
        """Return the plane's approach that the pressures see on their average [mm]."""
        sink = point.closure + self._equations.compliance @ point.pressure - lean
        return float(sink @ point.pressure / point.pressure.sum())
