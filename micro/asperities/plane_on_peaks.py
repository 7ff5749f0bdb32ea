"""A rigid plane on few contacts: where its search for equilibrium starts, and their stiffness.

The equilibrium itself is found by `geometry.plane_equilibrium`. Contacts of asperities are few, so
that their stiffness can be formed, and cheap alone, so that contacts that do not see each other
give a start close to the solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, linprog

from geometry import Control
from geometry.plane_equilibrium import PlaneResponse, find_equilibrium
from geometry.rigid_plane import PlaneLevers, RigidPlane, plane_failure

Array = NDArray[np.float64]
T = TypeVar("T")

TOLERANCE = 1e-9
"""What force and moments may miss, relative to the force and to that times half the diagonal; the
contact conditions themselves are met to 1e-10."""

_LEVEL = (0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """Points that a rigid plane can touch, with forces that do not see each other.

    Args:
        levers: Levers of the n points.
        depth: Depths below the height that approaches count from, shape (n,) [mm].
        force: Returns the force of a plane that penetrates the points by (n,) mm [N].
    """

    levers: PlaneLevers
    depth: Array
    force: Callable[[Array], float]

    @property
    def lever(self) -> Array:
        """1 and the distances along x and y from the centre, shape (n, 3) [1, mm, mm]."""
        return self.levers.matrix

    def first_touch(self, tilt: tuple[float, float]) -> float:
        """Return the approach at which a plane of given slopes touches first [mm]."""
        return self.levers.first_touch(self.depth, tilt)

    def first_plane(self, control: Control, near: RigidPlane | None) -> Array:
        """Return a plane to start from: one near, or one that suits contacts that stand alone.

        Args:
            control: What is prescribed.
            near: A plane in equilibrium nearby.

        Returns:
            Approach and slopes, shape (3,).

        Raises:
            NotConverged: When no plane can be in equilibrium.
        """
        tilt = control.tilt
        if tilt is None and near is not None:
            nearer = (control.approach or np.inf) >= near.approach
            tilt = near.tilt if nearer or control.force == 0.0 else None
        if tilt is None:
            tilt = _LEVEL if control.force == 0.0 else self._resting(control)
        if control.approach is not None:
            return np.array([control.approach, *tilt])
        touch = self.first_touch(tilt)
        if not np.isfinite(touch):
            raise plane_failure(control, "NO_CONTACT")
        if near is not None and control.force and near.approach > touch:
            return np.array([near.approach, *tilt])
        return np.array([touch + self._depth(control.force or 0.0, tilt), *tilt])

    def _depth(self, force: float, tilt: tuple[float, float]) -> float:
        """Return how far a plane of given slopes moves from first touch under a force [mm]."""
        if force == 0.0:
            return 0.0
        gap = self.depth - self.lever[:, 1:] @ np.asarray(tilt)
        gap = gap - gap.min()

        def residual(depth: float) -> float:
            return self.force(depth - gap) - force

        most = 1e-6 * self.levers.half
        while residual(most) < 0.0:
            most *= 4.0
        return float(brentq(residual, 0.0, most, rtol=1e-3))

    def _resting(self, control: Control) -> tuple[float, float]:
        """Return the slopes of a plane that rests on the rigid peaks under a force in the centre.

        Of all planes that penetrate no peak it is the one with the largest approach, found by a
        linear programme. Where the approach is prescribed, it need not be much larger than that.
        """
        if not len(self.depth):
            return _LEVEL
        scale = float(np.ptp(self.depth)) or 1.0
        most = None if control.approach is None else control.approach / scale + 1.0
        found = linprog(
            [-1.0, 0.0, 0.0],
            A_ub=self.lever / [1.0, self.levers.half, self.levers.half],
            b_ub=self.depth / scale,
            bounds=[(None, most), (None, None), (None, None)],
            method="highs",
        )
        if found.status != 0:  # the centre lies outside of the peaks' hull
            raise plane_failure(control, "NO_EQUILIBRIUM")
        slopes = found.x[1:] * (scale / self.levers.half)
        return float(slopes[0]), float(slopes[1])

    def equilibrium(
        self, respond: Callable[[Array], PlaneResponse[T]], control: Control, start: Array
    ) -> tuple[Array, T]:
        """Find the plane in equilibrium with contacts on these points.

        Args:
            respond: Returns what the contacts do to a plane (3,), and their state.
            control: What is prescribed.
            start: A plane to start from, with the prescribed approach or slopes, shape (3,).

        Returns:
            The plane, shape (3,), and the state of the contacts.

        Raises:
            NotConverged: When no plane is found, or ``respond`` fails at first touch.
        """
        return find_equilibrium(
            respond,
            control,
            start,
            self.levers.half,
            aim=TOLERANCE,
            nearly=True,
            first_touch=self.first_touch((start[1], start[2])),
        )


def contact_stiffness(lever: Array, rate: Array, coupling: Array) -> Array:
    """Return the derivative of a rigid plane's loads by its motions, shape (k, k).

    Args:
        lever: Displacements of the m contacts by unit motions, shape (m, k).
        rate: Derivatives dP/dt of the forces by the own indentations, shape (m,) [N/mm].
        coupling: Derivatives of the displacements by all contacts' own indentations but a
            contact's own through the half-space, shape (m, m).
    """
    own = np.linalg.solve(np.eye(len(rate)) + coupling, lever)
    found = lever.T @ (rate[:, None] * own)
    return np.asarray(0.5 * (found + found.T))
