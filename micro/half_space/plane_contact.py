"""A rigid plane on the cells of a surface: what is prescribed of it as a contact problem.

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Control, Surface
from geometry.errors import InputError
from geometry.rigid_plane import RigidPlane
from micro.contact.problem import ContactPressures
from micro.contact.rigid_motions import Motions
from micro.contact.solver import ContactSolver
from micro.half_space.state import HalfSpaceState

Array = NDArray[np.float64]

LEVEL = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneContact:
    """Contacts of rigid planes with one surface.

    Args:
        surface: The surface.
        reference_height: Height z_M that the approach counts from [mm].
        solver: Solves the contact problem on the cells.
    """

    surface: Surface
    reference_height: float
    solver: ContactSolver

    def plane(self, approach: float, tilt: tuple[float, float]) -> RigidPlane:
        """Return a plane over the surface.

        Raises:
            InputError: When a plane is tilted over a periodic surface, or a number is not finite.
        """
        if self.solver.compliance.periodic and any(tilt):
            raise InputError(
                "a tilted plane does not continue periodically", value=tilt, allowed="(0, 0)"
            )
        return RigidPlane.above(self.surface, approach, tilt)

    def interference(self, plane: RigidPlane) -> Array:
        """Return the overlap of plane and undeformed surface, shape (nx, ny) [mm]."""
        surface = self.surface
        below = self.reference_height - surface.heights
        return np.asarray(plane.at(surface.x[:, None], surface.y) - below)

    def at(self, plane: RigidPlane, start: Array | None) -> HalfSpaceState:
        """Solve under a plane that does not move.

        Args:
            plane: The plane.
            start: Pressures nearby, shape (nx, ny) [MPa].

        Raises:
            InputError: When a periodic surface is pressed to full contact.
            NotConverged: When the contact conditions cannot be met.
        """
        interference = self.interference(plane)
        mean = float(interference.mean())
        if self.solver.compliance.periodic and mean >= 0.0:
            raise InputError(
                "a periodic surface has no gap left at this approach",
                value=plane.approach,
                allowed=f"< {plane.approach - mean:.6g} mm; beyond it give the force",
            )
        return self._state(plane, self.solver.solve(interference, start=self._start(start)))

    def equilibrium(
        self, control: Control, start: Array | None, near: RigidPlane | None
    ) -> HalfSpaceState:
        """Solve the contact and the motions of the plane that are free, as one problem.

        Args:
            control: What is prescribed of the plane.
            start: Pressures nearby, shape (nx, ny) [MPa].
            near: The plane that they belong to.

        Raises:
            InputError: When a periodic surface is pressed to full contact or by a tilted plane.
            NotConverged: When the contact conditions cannot be met.
        """
        tilt = control.tilt if control.tilt is not None else near.tilt if near else LEVEL
        if control.force == 0.0:
            touch = -float(self.interference(self.plane(0.0, tilt)).max())
            return self.at(self.plane(touch, tilt), None)
        if control.tilt is None:
            return self._with_free_tilt(control, start)
        if control.approach is not None:
            return self.at(self.plane(control.approach, tilt), start)
        interference = self.interference(self.plane(0.0, tilt))
        motions = Motions.approach(interference.shape, self._total(control))
        first = self._start(start, near)
        found = self.solver.solve(interference, motions, first)
        return self._state(self.plane(float(found.motion[0]), tilt), found)

    def _with_free_tilt(self, control: Control, start: Array | None) -> HalfSpaceState:
        """Solve with a plane that may turn about the middle."""
        if self.solver.compliance.periodic:
            raise InputError("a plane cannot turn on a periodic surface", value="tilt free")
        half = 0.5 * float(np.hypot(*self.surface.lengths))
        middle = tuple(0.5 * length for length in self.surface.lengths)
        x, y = (self.surface.x - middle[0]) / half, (self.surface.y - middle[1]) / half
        interference = self.interference(self.plane(control.approach or 0.0, LEVEL))
        total = None if control.force is None else self._total(control)
        found = self.solver.solve(interference, Motions.turning(x, y, total), self._start(start))
        approach = control.approach if control.approach is not None else float(found.motion[0])
        tilt = float(found.motion[-2]) / half, float(found.motion[-1]) / half
        return self._state(self.plane(approach, tilt), found)

    def _total(self, control: Control) -> float:
        """Return the sum of the pressures / E* of the cells under the force."""
        dx, dy = self.surface.spacing
        return (control.force or 0.0) / (self.solver.compliance.modulus * dx * dy)

    def _start(
        self, pressure: Array | None, near: RigidPlane | None = None
    ) -> ContactPressures | None:
        if pressure is None:
            return None
        if pressure.shape != self.surface.grid:
            raise InputError(
                "the solution to start from is of another grid",
                value=pressure.shape,
                allowed=f"{self.surface.grid}",
            )
        motion = np.zeros(0) if near is None else np.array([near.approach])
        return ContactPressures(np.divide(pressure, self.solver.compliance.modulus), motion)

    def _state(self, plane: RigidPlane, found: ContactPressures) -> HalfSpaceState:
        compliance = self.solver.compliance
        return HalfSpaceState(
            plane=plane,
            interference=self.interference(plane),
            pressure=found.pressure * compliance.modulus,
            spacing=self.surface.spacing,
            residual=found.residual,
            iterations=found.iterations,
            compliance=compliance,
        )
