"""A rigid plane on few contacts: where its search for equilibrium starts.

The equilibrium itself is found by `geometry.plane_equilibrium`. Contacts of asperities are few and
cheap alone, so that contacts that do not displace each other give a start close to the solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.optimize import brentq, linprog

from geometry import Control
from geometry.plane_equilibrium import PlaneResponse, find_equilibrium
from geometry.rigid_plane import PlaneLevers, RigidPlane, plane_failure
from support.arrays import Array

T = TypeVar("T")

_TOLERANCE = 1e-9
"""What force and moments may miss, relative to the force and to that times half the diagonal; the
contact conditions themselves are met to 1e-10."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """Points that a rigid plane can touch, each by Hertz's law, without displacing the others.

    Args:
        modes: Rigid-body modes of the plane at the n points.
        depth: Depths below the height that approaches count from, shape (n,) [mm].
        force: Forces of the points alone, indented by 1 mm, shape (n,) [N].
    """

    modes: PlaneLevers
    depth: Array
    force: Array

    def equilibrium(
        self,
        respond: Callable[[Array], PlaneResponse[T]],
        control: Control,
        near: RigidPlane | None = None,
    ) -> tuple[Array, T]:
        """Find the plane in equilibrium with contacts on these points.

        Args:
            respond: Returns what the contacts do to a plane (3,), and their state.
            control: What is prescribed.
            near: A plane in equilibrium nearby.

        Returns:
            The plane, shape (3,), and the state of the contacts.

        Raises:
            NotConverged: When no plane is in equilibrium, or ``respond`` fails at first touch.
        """
        start = self._first_plane(control, near)
        touch = self.modes.first_touch(self.depth, start[1:])
        half = self.modes.half
        return find_equilibrium(respond, control, start, half, aim=_TOLERANCE, first_touch=touch)

    def _first_plane(self, control: Control, near: RigidPlane | None) -> Array:
        """Return a plane to start from: one near, or one that suits contacts that stand alone.

        It is approach and slopes, shape (3,).
        """
        tilt = control.tilt
        if tilt is None and near is not None:
            nearer = (control.approach or np.inf) >= near.approach
            tilt = near.tilt if nearer or control.force == 0.0 else None
        if tilt is None:
            tilt = (0.0, 0.0) if control.force == 0.0 else self._resting(control)
        if control.approach is not None:
            return np.array([control.approach, *tilt])
        touch = self.modes.first_touch(self.depth, tilt)
        if not np.isfinite(touch):
            raise plane_failure(control, "NO_CONTACT")
        if near is not None and control.force and near.approach > touch:
            return np.array([near.approach, *tilt])
        return np.array([touch + self._depth(control.force or 0.0, tilt), *tilt])

    def _depth(self, force: float, tilt: tuple[float, float]) -> float:
        """Return how far a plane of given slopes moves from first touch under a force [mm]."""
        if force == 0.0:
            return 0.0
        gap = self.depth - self.modes.matrix[:, 1:] @ np.asarray(tilt)
        gap = gap - gap.min()

        def residual(depth: float) -> float:
            return float(self.force @ np.maximum(depth - gap, 0.0) ** 1.5) - force

        most = 1e-6 * self.modes.half
        while residual(most) < 0.0:
            most *= 4.0
        return float(brentq(residual, 0.0, most, rtol=1e-3))

    def _resting(self, control: Control) -> tuple[float, float]:
        """Return the slopes of a plane that rests on the rigid peaks under a force in the centre.

        Of all planes that penetrate no peak it is the one with the largest approach, found by a
        linear programme. Where the approach is prescribed, it need not be much larger than that.
        """
        if not len(self.depth):
            return 0.0, 0.0
        scale = float(np.ptp(self.depth)) or 1.0
        most = None if control.approach is None else control.approach / scale + 1.0
        programme = linprog(
            [-1.0, 0.0, 0.0],
            A_ub=self.modes.matrix / [1.0, self.modes.half, self.modes.half],
            b_ub=self.depth / scale,
            bounds=[(None, most), (None, None), (None, None)],
            method="highs",
        )
        if programme.status != 0:  # the centre lies outside of the peaks' hull
            raise plane_failure(control, "NO_EQUILIBRIUM")
        slopes = programme.x[1:] * (scale / self.modes.half)
        return float(slopes[0]), float(slopes[1])
