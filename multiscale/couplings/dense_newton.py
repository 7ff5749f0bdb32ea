"""Newton's method for patch laws on a condensed compliance, bordered by force and moment."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from multiscale.couplings.dense_equations import TOLERANCE, DenseEquations, Iterate, Laws, LoadCase

Array = NDArray[np.float64]

_MOST_STEPS = 100
_MOST_HALVINGS = 40
_MEMORY = 4  # residuals that a step is compared with: kinks of the laws let it rise for a while
_DECREASE = 1e-4  # share of the predicted decrease that a step must bring
_UNSUPPORTED = 1e-11  # of the largest stiffness against motions of the plane: no support at all
_BITE = 0.02  # share of the largest approach by which a plane without support goes past touch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DenseState:
    """Equilibrium of the patches.

    Attributes:
        local: Local rigid approaches of the laws, shape (N,) [mm].
        plane: Approach at the middle of the interface [mm] and slopes along x and y, shape (3,).
        closure: Closures, shape (N,) [mm].
        pressure: Pressures, shape (N,) [MPa].
        load: Force [N] and its first moments about the middle [N mm], shape (3,).
        residuals: Residual before every Newton step and at the end, relative as in `TOLERANCE`.
    """

    local: Array
    plane: Array
    closure: Array
    pressure: Array
    load: Array
    residuals: tuple[float, ...]

    @property
    def iterations(self) -> int:
        """Newton steps."""
        return len(self.residuals) - 1


class DenseNewton:
    """Solves closure_i(s_i) = δ_i − Σ_j C_ij p_j(s_j) for the local approaches s of all patches.

    The laws are given over the local approach, so that it does not matter whether their pressure
    is a function of closure. Where the plane's force is prescribed, or its moment is zero, its
    approach and slopes are unknowns beside s, eliminated by Schur's complement. Steps are halved
    until the residual falls below the largest of the last few (Grippo, Lampariello & Lucidi 1986,
    doi 10.1137/0723046); a plane that nothing supports moves on to the next touch.

    Args:
        laws: The laws.
        compliance: C, mean displacement of patch i of the block by unit pressure on patch j, shape
            (N, N) [mm/MPa].
        patches: The partition.

    Raises:
        InputError: When the compliance is not a finite matrix of the size of the partition.
    """

    def __init__(self, laws: Laws, compliance: Array, patches: PatchGrid) -> None:
        self._equations = DenseEquations(laws, compliance, patches)

    def solve(self, control: Control, start: DenseState | None = None) -> DenseState:
        """Find the equilibrium of one load step.

        Args:
            control: What the step prescribes.
            start: A solution nearby.

        Raises:
            NotConverged: When neither the start nor one common approach of all laws leads to a
                solution.
        """
        case = LoadCase(self._equations, control)
        plane = None if start is None else start.plane
        if control.force == 0.0:
            case = LoadCase(self._equations, case.just_touching(plane))
        if start is not None:
            try:
                return self._iterate(case, start.local, case.prescribed(plane))
            except NotConverged:  # a law's kink between the two: try without the earlier solution
                pass
        return self._iterate(case, *case.cold_start(case.prescribed(plane)))

    def _iterate(self, case: LoadCase, local: Array, plane: Array) -> DenseState:
        now = self._equations.at(local, plane)
        residuals: list[float] = []
        recent: deque[float] = deque(maxlen=_MEMORY)
        for _ in range(_MOST_STEPS):
            case.see(now)
            residuals.append(case.largest(now))
            if residuals[-1] <= TOLERANCE:
                return _state(now, residuals)
            ds, dq, supported = self._direction(case, now)
            if supported:
                recent.append(case.residual(now))
                now = self._searched(case, now, ds, dq, max(recent), len(residuals))
            else:
                recent.clear()
                now = self._equations.at(now.local + ds, now.plane + dq)
        raise case.failure("DIVERGED_MAX_IT", len(residuals))

    def _direction(self, case: LoadCase, now: Iterate) -> tuple[Array, Array, bool]:
        """Return the change of s and of the plane, and whether it is Newton's."""
        equations, unit = self._equations, case.unit[case.free]
        lever = equations.lever[:, case.free] * unit
        right = np.column_stack((now.missing, lever))
        solved = equations.tangent(now).solve(right)
        step, columns = solved[:, 0], solved[:, 1:]
        change = np.zeros(3)
        if not case.free.any():
            return step, change, True
        pull = equations.area * lever.T * now.point.dpressure
        stiffness = pull @ columns
        values, vectors = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
        wanted = vectors.T @ (case.lack(now) - pull @ step)
        loose = values <= _UNSUPPORTED * max(values[-1], 0.0)
        falling = loose & (np.abs(wanted) > TOLERANCE * case.force)
        if falling.any():
            change[case.free] = unit * (vectors @ np.where(falling, wanted, 0.0))
            return *self._to_next_touch(now, change), False
        motion = vectors @ np.divide(wanted, values, out=np.zeros_like(wanted), where=~loose)
        change[case.free] = unit * motion
        return step + columns @ motion, change, True

    def _to_next_touch(self, now: Iterate, motion: Array) -> tuple[Array, Array]:
        """Move a plane that is not supported against a motion until one more patch is touched."""
        equations = self._equations
        rise = equations.lever @ motion
        ahead = equations.laws.touch - now.point.closure
        coming = (now.point.pressure == 0.0) & (rise > 1e-9 * np.abs(rise).max()) & (ahead < np.inf)
        if not coming.any():
            raise NotConverged(
                "the equilibrium of the plane",
                reason="NO_SUPPORT",
                iterations=0,
                remedy="no further patch can be touched that would hold the plane: prescribe its "
                "tilt (load.tilt) or take more patches (patches.grid)",
            )
        reach = max(float(np.abs(equations.lever @ now.plane).max()), float(ahead[coming].max()))
        way = np.maximum(ahead[coming], 0.0) + _BITE * reach
        share = float(np.min(way / rise[coming]))
        return share * rise, share * motion

    def _searched(
        self, case: LoadCase, now: Iterate, ds: Array, dq: Array, reference: float, spent: int
    ) -> Iterate:
        """Bend a Newton step along the laws, or halve it, until the residual falls.

        A straight step is taken where it lowers the residual, else the better one of both where
        that is below those of the last steps.
        """
        before = case.residual(now)
        for share in 0.5 ** np.arange(_MOST_HALVINGS):
            step, plane = share * ds, now.plane + share * dq
            trial, enough = self._equations.at(now.local + step, plane), 1.0 - _DECREASE * share
            if case.residual(trial) <= enough * before:
                return trial
            trial = min(trial, self._equations.bent(now, step, plane), key=case.residual)
            if case.residual(trial) <= enough * reference:
                return trial
        raise case.failure("DIVERGED_LINE_SEARCH", spent)


def _state(now: Iterate, residuals: list[float]) -> DenseState:
    return DenseState(
        local=now.local,
        plane=now.plane,
        closure=now.point.closure,
        pressure=now.point.pressure,
        load=now.load,
        residuals=tuple(residuals),
    )
