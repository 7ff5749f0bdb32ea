"""A load step of a body with contact laws that is pressed on a half-space.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geometry.rigid_plane import Control
from macro.contact.contact_forces import ContactForces
from macro.contact.contact_response import ContactResponse
from macro.contact.face_equilibrium import FaceEquilibrium
from macro.contact.face_sliders import FaceSliders
from macro.contact.frictional_forces import sliders_of
from macro.contact.opposite_half_space import OppositeHalfSpace
from support.arrays import Array


class BesideHalfSpace:
    """A load step of a body beside a half-space, see `opposite_half_space.Contact`.

    Args:
        forces: The forces of the laws.
        response: First order changes of the body with the laws.
        solve_body: Finds the equilibrium of the body alone, in the gap as it is.
        control: What is prescribed of the plane.
        gap: Gap of this rank's samples under a flat half-space, shape (n,) [mm].

    Note:
        Every method is collective.
    """

    def __init__(
        self,
        forces: ContactForces,
        response: ContactResponse,
        solve_body: Callable[[Control], FaceEquilibrium],
        control: Control,
        gap: Array,
    ) -> None:
        self._forces, self._response, self._solve_body = forces, response, solve_body
        self._control, self._gap = control, gap
        self._sliders = sliders_of(forces)
        self._memory = self._sliders.memory if self._sliders else None
        self._found: list[FaceEquilibrium] = []
        self._sunk: Array = np.zeros_like(gap)
        self._iterations = 0
        self._wider: Array | float = 0.0  # gaps of samples, by shear stresses [mm]

    def solve(self, opposite: OppositeHalfSpace, preload: Array) -> FaceEquilibrium:
        """Find the equilibrium of body and half-space.

        Args:
            opposite: The half-space, which shear stresses displace as well.
            preload: Displacements along the axes by other loads of the body, shape (n, 2) [mm].

        Returns:
            The equilibrium, with the iterations of all solutions of the body alone.

        Raises:
            NotConverged: When it is not found.
        """
        what = f"the half-space at {self._control}"
        if self._sliders is None:
            opposite.follow(self, what)
        else:
            self._shear(opposite, preload, self._sliders, what)
        return replace(
            self._found[-1],
            iterations=sum(one.iterations for one in self._found),
            linear_iterations=self._iterations + sum(one.linear_iterations for one in self._found),
        )

    def _shear(
        self, opposite: OppositeHalfSpace, preload: Array, sliders: FaceSliders, what: str
    ) -> None:
        """Find the equilibrium beside a half-space that shear stresses displace as well."""

        def remaining(sheared: Array) -> Array:
            along_x, along_y, self._wider = (opposite.at_samples(part) for part in sheared)
            sliders.preload = preload + np.stack([along_x, along_y], axis=1)
            opposite.follow(self, what)
            state = self._found[-1]
            assert state.shear is not None
            found = opposite.by_shear(state.shear.sample_stress, state.sample_pressure)
            return found - sheared

        opposite.shear(remaining, what)

    def pressed(self, moved: Array) -> Array:
        """Solve the load step anew, from what friction left behind before it."""
        forces = self._forces
        if self._sliders is not None and self._memory is not None:
            self._sliders.memory = self._memory
        forces.gap = self._gap + moved + self._wider
        state = self._solve_body(self._control)
        self._sunk = forces.levers.matrix @ forces.plane - forces.gap - state.sample_closure
        self._found.append(state)
        return state.sample_pressure

    def held(self, moved: Array) -> Array:
        """Return the pressures on the body as it is displaced now."""
        forces = self._forces
        forces.gap = self._gap + moved + self._wider
        closure = forces.closure_of(self._sunk)
        forces.linearise(forces.stiffness(closure))
        return forces.pressure(closure)

    def closed_in(self, way: Array, tolerance: float) -> Array:
        """Return the change of pressures where samples close in."""
        change, iterations = self._response.closed_in(way, tolerance)
        self._iterations += iterations
        return change

    def alone(self, way: Array, softer: float = 0.0) -> Array:
        """Return that on a rigid body, or on a local compliance."""
        forces, weight = self._forces, self._forces.weight
        stiffness = forces.normal_slope * weight
        stiffness = stiffness / (1.0 + softer * stiffness)
        border = forces.border(stiffness)
        change = stiffness * way
        if border.shape[1]:
            change -= border @ forces.levers.summed(border.T @ (weight * way))
        return np.asarray(change)
