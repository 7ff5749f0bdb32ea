"""The equations of patch laws on the compliance of a block, under one load of the plane.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.rigid_plane import PlaneLevers, way_of_approach
from patchlaw.micro.complementarity.cell_problem import Motions, clearance
from patchlaw.micro.model import LEAST_CLOSING, NormalStiffness
from patchlaw.multiscale.laws.interpolation import LawPoint, Tangent
from patchlaw.multiscale.laws.patch_law import PatchLaws
from patchlaw.support import Array, InputError, NotConverged

TOLERANCE = 1e-12
"""Residual of a solution: of the closures relative to the largest approach, of the force and the
moments relative to the largest force and that force times half the interface's diagonal. Near first
touch rounding changes closures by more than that, and the residual is relative to its effect."""

_LEAST_AGREEING = 0.5
"""Ratio of what a patch bears more by its gap and by its pressure within which the first counts."""
_OUT_OF_REACH = 10.0
"""Gap of patches that cannot be touched, over the largest of the others."""
_LEAST_SLOPE = 1e-3  # of a patch's own approach over the local one; laws below count as falling


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DenseState:
    """A state of patches and plane: an iterate, or the equilibrium of a load step.

    Attributes:
        local: Local rigid approaches s of the laws, shape (N,) [mm].
        plane: Approach at the middle of the interface [mm] and slopes along x and y, shape (3,).
        point: The laws at s.
        residual: Closures by plane and displacements less those of the laws, shape (N,) [mm].
        load: Force [N] and its first moments about the middle [N mm], shape (3,).
        iterations: Newton steps that led to it.
    """

    local: Array
    plane: Array
    point: LawPoint
    residual: Array
    load: Array
    iterations: int = 0


def check_compliance(compliance: Array, count: int) -> None:
    """Refuse what is no compliance of patches.

    Args:
        compliance: Mean displacements by unit pressures.
        count: Number of patches.

    Raises:
        InputError: When it is not a finite matrix of their number.
    """
    shape = count, count
    if compliance.shape != shape or not np.all(np.isfinite(compliance)):
        raise InputError(
            "the compliance does not fit the patches",
            value=compliance.shape,
            allowed=f"a finite matrix of shape {shape}",
        )


def whole_stiffness(own: Array, closed: Array, rates: Array) -> float:
    """Return −dF/dū of patches together, per area of one [MPa/mm]; NaN where no gap closes.

    Near full contact the gap of a patch hardly closes, or opens a little as its neighbours take
    over. What it bears more then follows from its pressure, not from its gap. In full contact the
    mean gap does not close, and what it seems to close by is the error of laws.

    Args:
        own: Stiffnesses −dp/dū of the patches, shape (N,) [MPa/mm].
        closed: What their mean gaps close by as the plane comes nearer, shape (N,) [mm/mm].
        rates: What their pressures rise by, shape (N,) [MPa/mm].
    """
    by_gap, mean = own * closed, float(closed.mean())
    if not mean > LEAST_CLOSING:
        return np.nan
    agrees = (by_gap > _LEAST_AGREEING * rates) & (by_gap < rates / _LEAST_AGREEING)
    return float(np.where(agrees, by_gap, rates).sum()) / mean


class LoadedPatches:
    """The equations closure_i(s_i) = δ_i − Σ_j C_ij p_j(s_j), and those of the plane's loads.

    Args:
        laws: The laws.
        compliance: C, mean displacement of patch i of the block by unit pressure on patch j, shape
            (N, N) [mm/MPa].
        patches: The partition.
        control: What is prescribed of the plane.

    Raises:
        InputError: When the compliance is not a finite matrix of the size of the partition.

    Attributes:
        levers: How the plane's motions move the patches.
        area: Area of a patch [mm²].
        force_scale: Largest force so far, which loads are compared with [N].
    """

    def __init__(
        self, laws: PatchLaws, compliance: Array, patches: PatchGrid, control: Control
    ) -> None:
        check_compliance(compliance, patches.count)
        self.laws, self.compliance, self.control = laws, compliance, control
        self.patches = patches
        self.area = patches.area
        x, y = patches.centres.T
        self.levers = PlaneLevers.at(x, y, patches.lengths, centre=patches.middle)
        self.force_scale = control.force or 0.0

    def at(self, local: Array, plane: Array) -> DenseState:
        """Evaluate a state."""
        point = self.laws.along(local)
        residual = self.levers.matrix @ plane - point.closure - self.compliance @ point.pressure
        load = self.levers.loads(self.area * point.pressure)
        return DenseState(local=local, plane=plane, point=point, residual=residual, load=load)

    def along_laws(self, now: DenseState, step: Array, plane: Array) -> DenseState:
        """Evaluate where a step leads that is straight in the approaches of patches taken alone.

        A patch alone on the block, with its own compliance y, is approached by t = c + y p. Across
        a kink or a steep part of a law p may jump over s, but it stays smooth over t, where
        dp/dt ≤ 1/y. Patches whose t does not rise with s take the step straight in s.

        Args:
            now: Where the step starts.
            step: Change of the local approaches, shape (N,) [mm].
            plane: The plane after the step, shape (3,).
        """
        own, direction = np.diagonal(self.compliance), np.sign(step)
        slope = now.point.dclosure + own * now.point.dpressure
        target = now.point.closure + own * now.point.pressure + slope * step
        low, high = now.local, now.local + 2.0 * np.maximum(slope, 1.0) * step
        local = now.local + step
        for _ in range(40):  # Newton steps or bisections
            point = self.laws.along(local)
            ahead = (target - point.closure - own * point.pressure) * direction
            low, high = np.where(ahead > 0.0, local, low), np.where(ahead > 0.0, high, local)
            steepness = np.maximum(point.dclosure + own * point.dpressure, _LEAST_SLOPE)
            newton = local + ahead * direction / steepness
            inside = (newton - low) * (newton - high) < 0.0
            local = np.where(inside, newton, 0.5 * (low + high))
        return self.at(np.where(slope > _LEAST_SLOPE, local, now.local + step), plane)

    def tangent(self, state: DenseState) -> Tangent:
        """Return the derivative of closure + displacement over the local approaches."""
        return Tangent.of(state.point, self.compliance)

    def stiffness(self, state: DenseState) -> NormalStiffness:
        """Return −dF/dū and dF/dδ as the plane comes nearer, in what is prescribed of it."""
        lever = self.levers.matrix
        approaches = self.tangent(state).solve(lever)  # by the plane's motions, (N, 3)
        loads = self.area * (lever.T * state.point.dpressure) @ approaches
        way = way_of_approach(loads, turns=self.control.tilt is None)
        coming = approaches @ way
        own = whole_stiffness(
            self.laws.interface_stiffness(state.point),
            -state.point.dseparation * coming,
            state.point.dpressure * coming,
        )
        return NormalStiffness(self.area * own, float(loads[0] @ way), 1)

    def load_residual(self, state: DenseState) -> Array:
        """Return prescribed less present loads along the plane's free motions [N]."""
        return ((self.control.loads - state.load) * self.levers.unit)[self.control.free]

    def norm(self, state: DenseState) -> float:
        """Return the norm of all residuals, relative to the largest approach and force."""
        approach, force = self._scales(state)
        residuals = state.residual / approach, self.load_residual(state) / force
        return float(np.linalg.norm(np.concatenate(residuals)))

    def relative_residual(self, state: DenseState) -> float:
        """Return the largest residual, relative as in `TOLERANCE`."""
        approach, force = self._scales(state)
        closures = float(np.abs(state.residual).max())
        loads = float(np.abs(self.load_residual(state)).max(initial=0.0))
        plain = max(closures / approach, loads / force)
        if plain <= TOLERANCE:
            return plain
        # rounding of approaches, and its effect on closures and on the force
        rounding = 8.0 * float(np.finfo(float).eps) * max(self._largest_touch(), approach)
        of_closures = self.tangent(state).norm * rounding
        of_force = self.area * float(state.point.dpressure.sum()) * rounding
        return max(
            closures / max(approach, of_closures / TOLERANCE),
            loads / max(force, of_force / TOLERANCE),
        )

    def first_touch(self, plane: Array) -> Control:
        """Return what stands for a force of zero: the plane where its first patch is touched.

        Args:
            plane: A plane, whose slopes hold where the load prescribes none.
        """
        plane = self.control.prescribed(plane)
        approach = self.levers.first_touch(self.laws.first_touch, plane[1:])
        if not np.isfinite(approach):
            raise self.failure("NO_CONTACT", 0)
        closures = approach + self.levers.matrix[:, 1:] @ plane[1:]
        largest = max(self._largest_touch(), float(np.abs(closures).max()))
        approach -= 2.0 * TOLERANCE * largest  # so that a residual is not a contact
        return Control(approach=approach, tilt=(float(plane[1]), float(plane[2])))

    def turned_clear(self) -> DenseState | None:
        """Return the state of a plane that no load turns where it comes clear of all patches.

        Of the slopes at which it touches nothing, those count at which it is farthest from the
        nearest patch, as over cells. None where the slopes are prescribed, or patches hold it.
        """
        control, patches = self.control, self.patches
        if control.tilt is not None or any(control.moment):
            return None
        x, y = np.moveaxis(patches.centres - patches.middle, 1, 0).reshape(2, *patches.grid)
        turns = np.array([False, *(count > 1 for count in patches.grid)])
        motions = Motions.of_plane(x[:, 0], y[0], turns, np.zeros(3), self.levers.half)
        plane = control.prescribed(np.zeros(3))
        above = plane[0] - self.laws.first_touch
        size = float(np.abs(above[np.isfinite(above)]).max(initial=0.0))
        above = np.maximum(above, -_OUT_OF_REACH * size).reshape(patches.grid)
        if not turns.any():
            return None if above.max() > 0.0 else self.at(self.levers.matrix @ plane, plane)
        clear = clearance(above, motions)
        if clear.interference > 0.0:
            return None
        plane[turns] = motions.unit * clear.motion
        return self.at(self.levers.matrix @ plane, plane)

    def initial_guess(self, plane: Array) -> tuple[Array, Array]:
        """Return one common approach of all laws, and the plane, that fit the load on average.

        Args:
            plane: A plane with the prescribed approach and slopes.
        """
        tilted, force = self.levers.matrix[:, 1:] @ plane[1:], self.control.force

        def mean_approach(point: LawPoint) -> float:
            approaches = point.closure + self.compliance @ point.pressure - tilted
            return float(approaches @ point.pressure / point.pressure.sum())

        def excess(common: float) -> float:
            point = self.laws.along(common + tilted)
            if not point.pressure.any():
                return -1.0
            if force is not None:
                return self.area * float(point.pressure.sum()) - force
            return mean_approach(point) - float(plane[0])

        below, above = -self.levers.half, 1e-6 * self.levers.half
        while excess(above) < 0.0:
            below, above = above, 2.0 * above
            if above > 1e3 * self.levers.half:
                if force is not None:
                    raise self.failure("NO_CONTACT", 0)
                return self.levers.matrix @ plane, plane  # nothing is in contact
        accuracy = 1e-9 * (above - below)
        common = min(scipy.optimize.brentq(excess, below, above, xtol=accuracy) + accuracy, above)
        if force is not None:
            plane[0] = mean_approach(self.laws.along(common + tilted))
        return common + tilted, plane

    def failure(self, reason: str, iterations: int) -> NotConverged:
        """Return the error of an iteration that found no equilibrium."""
        return NotConverged(
            f"the condensed block at {self.control}",
            reason=reason,
            iterations=iterations,
            remedy="take more load steps (load.steps)",
        )

    def _scales(self, state: DenseState) -> tuple[float, float]:
        """Return the largest approach of the plane to a patch [mm], and the largest force [N]."""
        approach = float(np.abs(self.levers.matrix @ state.plane).max())
        return max(approach, 1e-9 * self.levers.half), self.force_scale or 1.0

    def _largest_touch(self) -> float:
        """Return the largest closure at first touch [mm]."""
        touch = self.laws.first_touch
        return float(np.abs(touch[np.isfinite(touch)]).max(initial=0.0))
