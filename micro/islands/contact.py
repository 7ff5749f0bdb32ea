"""What islands of given shapes do: to each other, to the body under them and to the plane.

Held at its shape, an island of depth w carries F = c w^(3/2). Where neither a body nor a free
motion of the plane couples the islands, their forces at the depths at which they were found tell
the displacements at once; else depths, displacements and plane follow from one contact problem
(`micro.complementarity.contact_problem`) of point forces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Control
from geometry.plane_equilibrium import PlaneResponse
from micro.complementarity.active_set import active_set
from micro.complementarity.contact_problem import ContactProblem, solve
from micro.complementarity.newton_krylov import newton_krylov
from micro.islands.passes import Answer
from micro.islands.shapes import Islands
from micro.islands.volumes import Relief
from micro.pairs.body_points import BodyPoints
from micro.pairs.interaction import Lift
from micro.plane_on_peaks import Peaks, contact_stiffness

Array = NDArray[np.float64]

_FEW = 200
"""Islands up to which Newton's linear systems are factorised."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointForces:
    """Hertz contacts that are point forces to each other.

    Args:
        law: Forces over E* at an indentation of 1 mm, shape (m,) [mm²].
        matrix: Displacements of the contacts by forces over E* on them, shape (m, m) [1/mm].
    """

    law: Array
    matrix: Array

    def lift(self, indentation: Array) -> Lift:
        """Return the displacements of the contacts but those by their own half-spaces.

        Args:
            indentation: Own indentations, shape (m,) [mm]; only positive ones act.
        """
        active = np.flatnonzero(indentation > 0.0)
        t, among = indentation[active], self.matrix[:, active]
        force = self.law[active] * t**1.5
        return Lift(active, among @ force, among * (1.5 * force / t))

    def solve(self, required: Array, start: Array) -> Array:
        """Return the own indentations under required displacements, shape (m,) [mm].

        Args:
            required: Displacements d_k, negative where the plane is above, shape (m,) [mm].
            start: First guess of the own indentations, shape (m,) [mm].

        Raises:
            NotConverged: When even small load steps fail.
        """
        if required.max(initial=0.0) <= 0.0:
            return np.zeros(len(required))
        problem = ContactProblem(interaction=self, required=required)
        method = active_set if len(required) <= _FEW else newton_krylov
        return solve(problem, method, start).indentation

    def stiffness(self, indentation: Array, lever: Array) -> Array:
        """Return the derivative of a plane's loads over E* by its motions, shape (k, k).

        Args:
            indentation: Own indentations, shape (m,) [mm].
            lever: Displacements of the contacts by unit motions, shape (m, k).
        """
        on = np.flatnonzero(indentation > 0.0)
        rate = 1.5 * self.law[on] * np.sqrt(indentation[on])
        return contact_stiffness(lever[on], rate, self.matrix[np.ix_(on, on)] * rate)


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandContact:
    """Islands of a surface under a plane of which not all motions need be given.

    Args:
        relief: The n catchments.
        peaks: Their peaks.
        control: What is prescribed of the plane.
        level: Heights of the first plane over the peaks, shape (n,) [mm].
        motion: Approach and slopes of the first plane, shape (3,).
        contact_modulus: E* [MPa].
        body: Compliance of a finite body, modes at the peaks; None on a half-space.
    """

    relief: Relief
    peaks: Peaks
    control: Control
    level: Array
    motion: Array
    contact_modulus: float
    body: BodyPoints | None

    def answer(self, found: Islands, motion: Array) -> Answer:
        """Return what islands do that were found under a plane.

        Args:
            found: The m islands.
            motion: Approach and slopes of the plane, shape (3,).

        Raises:
            NotConverged: When the contact conditions cannot be met, or no plane is in balance.
        """
        kernel = found.kernel(self.relief.x, self.relief.y)
        touches = self.control.force == 0.0 or not len(found)
        given = self.control.force is None and self.control.tilt is not None
        if touches or (given and self.body is None):
            return Answer(kernel @ found.force, self.motion, found)
        if self.body is not None:
            kernel = kernel + self.body.by(self.body.elsewhere(found.x, found.y)) / np.pi
        top, depth, lever = found.top, found.depth, self.peaks.lever
        forces = PointForces(law=found.force / depth**1.5, matrix=kernel[top])
        over, moved = self.relief.z[top] - self.level[top], lever[top]
        x, y = self.relief.x[top], self.relief.y[top]
        arms = moved + np.stack([np.zeros(len(x)), found.x - x, found.y - y], axis=1)

        def evaluate(trial: Array) -> PlaneResponse[Array]:
            nonlocal depth
            required = over + moved @ (trial - self.motion)
            depth = forces.solve(np.asarray(required, float), depth)
            loads = self.contact_modulus * (arms.T @ (forces.law * depth**1.5))
            now = depth
            return PlaneResponse(
                loads=loads,
                stiffness=lambda: self.contact_modulus * forces.stiffness(now, arms),
                state=now,
            )

        goal, depth = self.peaks.equilibrium(evaluate, self.control, motion)
        # other peaks than those of these islands hold a plane that moves far
        most = float(found.depth.max())
        part = min(1.0, most / max(float(np.abs(lever @ (goal - motion)).max()), most))
        motion = goal if part == 1.0 else motion + part * (goal - motion)
        if part < 1.0:
            depth = evaluate(motion).state
        lift = kernel @ (forces.law * depth**1.5) - lever @ (motion - self.motion)
        return Answer(lift, motion, found.under(depth))
