"""Equilibrium of the islands of a surface, of the displacements that they cause and of the plane.

An island that keeps its shape carries F = c w^(3/2) at the depth w. Islands displace each other's
peaks as point forces do. Regions and displacements are found in turn until they agree: cut the
surface, let the islands displace each other, cut it again at the new levels.

On a half-space with a prescribed plane the forces at the depths of the cut give the displacements
at once. A finite body or a free motion of the plane couples the islands; then depths,
displacements and plane follow from a contact problem (`micro.interaction.contact_problem`).

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Control
from geometry.errors import NotConverged
from geometry.plane_equilibrium import PlaneResponse
from micro.interaction.contact_problem import (
    ContactProblem,
    InteractionDisplacement,
    active_set,
    checked_pairs,
    solve,
)
from micro.interaction.hertz_pairs import BodyPoints
from micro.interaction.plane_on_peaks import Peaks, contact_stiffness
from micro.islands.shapes import Islands, islands
from micro.islands.watersheds import Watersheds

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Largest change of a displacement in an iteration, relative to the largest interference."""

_MERGING_ITERATIONS = 10
"""Iterations in which regions may still grow together."""

_MOST_ITERATIONS = 200
_FIRST_SHARE = 0.6
_SHARES = (0.2, 1.0)
"""Bounds of the share of a change that a damped iteration goes."""


class Relaxation:
    """A damped fixed-point iteration x ← x + share · change, the share by the secant method.

    The secant goes through the last two changes (Irons and Tuck).

    Source:
        Irons & Tuck, Int. J. Numer. Meth. Eng. 1 (1969) 275, doi 10.1002/nme.1620010306.
    """

    def __init__(self) -> None:
        self._share = _FIRST_SHARE
        self._last: Array = np.empty(0)

    def next(self, point: Array, change: Array) -> Array:
        """Return the next point.

        Args:
            point: Where the iteration is, shape (n,).
            change: What a full step would change, shape (n,).
        """
        if self._last.size == change.size:
            difference = change - self._last
            scale = float(difference @ difference)
            share = _FIRST_SHARE
            if scale > 0.0:
                share = -self._share * float(self._last @ difference) / scale
            self._share = float(np.clip(share, *_SHARES))
        self._last = change
        return point + self._share * change


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointForces:
    """Hertz contacts that displace each other as point forces.

    Args:
        law: Forces over E* at an indentation of 1 mm, shape (m,) [mm²].
        matrix: Displacements of the contacts by forces over E* on them, shape (m, m) [1/mm].
    """

    law: Array
    matrix: Array

    def evaluate(self, indentation: Array) -> InteractionDisplacement:
        """Return the displacements of the contacts by the forces on all of them.

        Args:
            indentation: Indentations, shape (m,) [mm]; only positive ones act.
        """
        active = np.flatnonzero(indentation > 0.0)
        t, among = indentation[active], self.matrix[:, active]
        force = self.law[active] * t**1.5
        return InteractionDisplacement(active, among @ force, among * (1.5 * force / t))

    def solve(self, interference: Array, start: Array) -> Array:
        """Return the indentations under a plane, shape (m,) [mm].

        Args:
            interference: Depth of the plane below each undisplaced peak, negative for peaks below
                the plane, shape (m,) [mm].
            start: First guess of the indentations, shape (m,) [mm].

        Raises:
            NotConverged: When even small load steps fail.
        """
        if interference.max(initial=0.0) <= 0.0:
            return np.zeros(len(interference))
        problem = ContactProblem(interaction=self.evaluate, interference=interference)
        return solve(problem, active_set, start).indentation

    def stiffness(self, indentation: Array, lever: Array) -> Array:
        """Return the derivative of a plane's loads over E* by its motions, shape (k, k).

        Args:
            indentation: Indentations, shape (m,) [mm].
            lever: Displacements of the contacts by unit motions, shape (m, k).
        """
        on = np.flatnonzero(indentation > 0.0)
        rate = 1.5 * self.law[on] * np.sqrt(indentation[on])
        return contact_stiffness(lever[on], rate, self.matrix[np.ix_(on, on)] * rate)


class IslandEquilibrium(NamedTuple):
    """Islands that agree with the displacements that they cause.

    Attributes:
        islands: The islands.
        motion: Approach and slopes of the plane, shape (3,).
        height: Heights of the n peaks above their own levels, negative below, shape (n,) [mm].
        iterations: Iterations made.
        residual: Last change of a displacement relative to the largest interference.
    """

    islands: Islands
    motion: Array
    height: Array
    iterations: int
    residual: float


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandContact:
    """Islands of a surface under a plane whose motions may be free.

    Args:
        watersheds: The n watersheds.
        peaks: Their peaks.
        control: What is prescribed of the plane.
        level: Heights of the first plane over the peaks, shape (n,) [mm].
        motion: Approach and slopes of the first plane, shape (3,).
        contact_modulus: E* [MPa].
        body: Compliance of a finite body, modes at the peaks; None on a half-space.
    """

    watersheds: Watersheds
    peaks: Peaks
    control: Control
    level: Array
    motion: Array
    contact_modulus: float
    body: BodyPoints | None

    def equilibrium(self, most_iterations: int = _MOST_ITERATIONS) -> IslandEquilibrium:
        """Find islands, displacements and plane that agree with each other.

        Every iteration goes a share of the way to the displacements by the islands it found
        (`Relaxation`). From the tenth iteration on, regions can fall apart but not grow together
        again: a pair of regions that does both in turn would never converge.

        Args:
            most_iterations: Iterations that may be made.

        Raises:
            InputError: When the interaction of the islands does not fit into the memory.
            NotConverged: When the displacements do not converge.
        """
        sheds, level, motion = self.watersheds, self.level, self.motion
        above = sheds.z - level
        linked = sheds.open_saddles(level)
        region, relaxed = sheds.regions(linked), Relaxation()
        displacement: Array = np.zeros(len(sheds))
        for number in range(most_iterations):
            now = sheds.open_saddles(level + displacement)
            now &= linked | (number < _MERGING_ITERATIONS)
            if np.any(now != linked):
                linked, region, relaxed = now, sheds.regions(now), Relaxation()
            height = above - displacement
            found = islands(sheds, height, region)
            goal, motion, exact = self._effect(found, motion)
            # Peaks that are below the plane before and after an iteration have no effect.
            matters = (above > 0.0) | (height > 0.0) | (above > goal)
            change = np.where(matters, goal - displacement, 0.0)
            deepest = float(above.max(initial=0.0)) or float(height.max(initial=0.0)) or 1.0
            residual = float(np.abs(change).max(initial=0.0)) / deepest
            if residual <= TOLERANCE:
                return IslandEquilibrium(exact, motion, height, number + 1, residual)
            displacement = relaxed.next(displacement, change)
        raise NotConverged(
            "the iteration between islands and their displacements at an approach of"
            f" {motion[0]:.6g} mm",
            reason="MAX_ITERATIONS",
            iterations=most_iterations,
            remedy='lower load.approach, or choose micro.model = "half-space"',
        )

    def _effect(self, found: Islands, motion: Array) -> tuple[Array, Array, Islands]:
        """Return displacements of the n peaks, the plane (3,), and the islands under it.

        Args:
            found: The islands under a plane.
            motion: Approach and slopes of that plane, shape (3,).
        """
        sheds, peaks, control = self.watersheds, self.peaks, self.control
        checked_pairs(len(sheds), len(found), "islands")
        kernel = found.kernel(sheds.x, sheds.y)
        without_force = control.force == 0.0 or not len(found)
        prescribed = control.force is None and control.tilt is not None
        if without_force or (prescribed and self.body is None):
            return kernel @ found.force, self.motion, found
        if self.body is not None:
            centres = BodyPoints.at(self.body.body, found.x, found.y)
            kernel = kernel + self.contact_modulus * self.body.by(centres)
        top, depth, lever = found.top, found.depth, peaks.lever
        forces = PointForces(law=found.force / depth**1.5, matrix=kernel[top])
        over, moved = sheds.z[top] - self.level[top], lever[top]
        x, y = sheds.x[top], sheds.y[top]
        arms = moved + np.stack([np.zeros(len(x)), found.x - x, found.y - y], axis=1)

        def respond(trial: Array) -> PlaneResponse[Array]:
            nonlocal depth
            interference = over + moved @ (trial - self.motion)
            now = depth = forces.solve(np.asarray(interference, float), depth)
            return PlaneResponse(
                loads=self.contact_modulus * (arms.T @ (forces.law * now**1.5)),
                stiffness=lambda: self.contact_modulus * forces.stiffness(now, arms),
                state=now,
            )

        goal, depth = peaks.equilibrium(respond, control, motion)
        # A plane that moves by more than the islands are deep would meet other islands.
        most = float(found.depth.max())
        share = min(1.0, most / max(float(np.abs(lever @ (goal - motion)).max()), most))
        motion = goal if share == 1.0 else motion + share * (goal - motion)
        if share < 1.0:
            depth = respond(motion).state
        displacement = kernel @ (forces.law * depth**1.5) - lever @ (motion - self.motion)
        return displacement, motion, found.under(depth)
