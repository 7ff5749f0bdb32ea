"""The contacts of given summits under a rigid plane, how they resist its motions, its equilibrium.

A rigid plane that has approached by δ interferes with every summit by d_k = <δ(x_k) − (z_M − z_k)>.
Without interaction each contact makes this displacement alone, w_k = d_k. With interaction the
displacements by all contacts add up to w_k (`micro.asperities.hertz_pairs`).

The search for the plane's equilibrium is that of `geometry.rigid_plane`. Contacts are few and
cheap alone, so that contacts that do not displace each other give a start close to the solution.

Theory: docs/theory.md, sections 8 and 9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy

from patchlaw.geometry import Control
from patchlaw.geometry.rigid_plane import (
    PlaneLevers,
    PlaneResponse,
    RigidPlane,
    find_equilibrium,
    plane_failure,
)
from patchlaw.micro.asperities.hertz_pairs import (
    HertzPairs,
    Solution,
    SummitProblem,
    check_pairs,
    solve,
)
from patchlaw.support.arrays import Array

T = TypeVar("T")


def solve_summits(pairs: HertzPairs, interference: Array, start: Array) -> Solution:
    """Solve for the summits above the plane.

    These are the undisplaced summits above it, and those that the body raises above it. The
    interaction is summed over all pairs: time and memory grow with the square of their number.

    Args:
        pairs: The n asperities.
        interference: Depth of the plane below each undisplaced summit, negative for summits below
            the plane, shape (n,) [mm].
        start: First guess of the indentations, shape (n,) [mm].

    Raises:
        InputError: When the interaction of so many summits does not fit into the memory.
        NotConverged: When the contact conditions cannot be met to 1e-10.
    """
    if not pairs.interact:
        return Solution(np.maximum(interference, 0.0), 0, 0.0, 0)
    above = np.flatnonzero(interference > 0.0)
    own, spent = np.zeros_like(interference), 0
    if above.size == 0:
        return Solution(own, 0, 0.0, 0)
    while True:
        check_pairs(len(above))
        problem = SummitProblem(
            interaction=pairs.subset(above).evaluate, interference=interference[above]
        )
        solved = solve(problem, start[above])
        own[above] = solved.indentation
        spent += solved.iterations
        if pairs.body is None:
            break
        # Through the half-space contacts only press summits down; a body can raise them.
        raised = interference - pairs.body.displacement(pairs.force(own)) > 0.0
        raised[above] = False
        if not raised.any():
            break
        above, start = np.sort(np.append(above, np.flatnonzero(raised))), own
    return solved._replace(indentation=own, iterations=spent)


def plane_stiffness(pairs: HertzPairs, indentation: Array, modes: Array) -> Array:
    """Return the derivative of the loads on a rigid plane by its motions, shape (k, k).

    Args:
        pairs: The n asperities.
        indentation: Indentations of their contacts, shape (n,) [mm].
        modes: Displacements of the summits by unit motions, shape (n, k).
    """
    active = np.flatnonzero(indentation > 0.0)
    touching, t, moved = pairs.subset(active), indentation[active], modes[active]
    rate, own = 1.5 * touching.force(t) / t, moved
    if pairs.interact:
        own = np.linalg.solve(np.eye(len(active)) + touching.evaluate(t).derivative, moved)
    return np.asarray(moved.T @ (rate[:, None] * own))


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
        # the contact conditions themselves are met to 1e-10
        return find_equilibrium(respond, control, start, half, aim=1e-9, first_touch=touch)

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
        return float(scipy.optimize.brentq(residual, 0.0, most, rtol=1e-3))

    def _resting(self, control: Control) -> tuple[float, float]:
        """Return the slopes of a plane that rests on the rigid peaks under a force in the centre.

        Of all planes that penetrate no peak it is the one with the largest approach, found by a
        linear programme. Where the approach is prescribed, it need not be much larger than that.
        """
        if not len(self.depth):
            return 0.0, 0.0
        scale = float(np.ptp(self.depth)) or 1.0
        most = None if control.approach is None else control.approach / scale + 1.0
        programme = scipy.optimize.linprog(
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
