"""A rigid plane on the cells of a surface: what is prescribed of it as a contact problem.

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Control, Surface
from geometry.errors import InputError
from geometry.rigid_plane import RigidPlane, motion_units
from micro.compliance.grid_compliance import Compliance
from micro.contact.problem import ContactPressures, ContactProblem
from micro.contact.rigid_motions import Motions
from micro.contact.slope_iteration import solve_contact
from micro.half_space.state import HalfSpaceState, plane_interference

Array = NDArray[np.float64]

LEVEL = (0.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneContact:
    """Contacts of rigid planes with one surface.

    Args:
        surface: The surface.
        reference_height: Height z_M that the approach counts from [mm].
        compliance: The elastic body.
        tolerance: Largest residual.
        upper: Upper bound of the pressures [MPa].
    """

    surface: Surface
    reference_height: float
    compliance: Compliance
    tolerance: float
    upper: float

    def equilibrium(
        self, control: Control, start: Array | None = None, near: RigidPlane | None = None
    ) -> HalfSpaceState:
        """Solve the contact and the motions of the plane that are free, as one problem.

        Args:
            control: What is prescribed of the plane.
            start: Pressures nearby, shape (nx, ny) [MPa].
            near: The plane that they belong to; needed where the force is prescribed.

        Raises:
            InputError: When a periodic surface is pressed to full contact or by a tilted plane.
            NotConverged: When the contact conditions cannot be met.
        """
        surface, modulus = self.surface, self.compliance.modulus
        if control.force == 0.0:
            control, start = self._first_touch(control, near), None
        motion = control.prescribed(np.zeros(3))
        interference = self._interference(motion)
        if self.compliance.periodic:
            _check_periodic(control, float(interference.mean()))
        unit = motion_units(0.5 * float(np.hypot(*surface.lengths)))
        x, y = (
            (at - 0.5 * length) * unit[-1]
            for at, length in zip((surface.x, surface.y), surface.lengths, strict=True)
        )
        cell = surface.spacing[0] * surface.spacing[1]
        problem = ContactProblem(
            compliance=self.compliance,
            spacing=surface.spacing,
            interference=interference,
            motions=Motions.of_plane(x, y, control.free, control.loads / (modulus * cell)),
            upper=self.upper / modulus,
        )
        found = solve_contact(problem, self.tolerance, self._start(start, near))
        motion[control.free] = found.motion * unit[control.free]
        return HalfSpaceState(
            plane=RigidPlane.moved(surface, motion),
            surface=surface,
            reference_height=self.reference_height,
            pressure=found.pressure * modulus,
            residual=found.residual,
            iterations=found.iterations,
            compliance=self.compliance,
        )

    def _interference(self, motion: Array) -> Array:
        """Return the overlap of plane and surface by approach and slopes, shape (nx, ny) [mm]."""
        plane = RigidPlane.moved(self.surface, motion)
        return plane_interference(plane, self.surface, self.reference_height)

    def _first_touch(self, control: Control, near: RigidPlane | None) -> Control:
        """Return the approach at which a plane without force, tilted as one near, first touches."""
        tilt = control.tilt if control.tilt is not None else near.tilt if near else LEVEL
        touch = -float(self._interference(np.array([0.0, *tilt])).max())
        return Control(approach=touch, tilt=tilt)

    def _start(self, pressure: Array | None, near: RigidPlane | None) -> ContactPressures | None:
        if pressure is None:
            return None
        if pressure.shape != self.surface.grid:
            raise InputError(
                "the solution to start from is of another grid",
                value=pressure.shape,
                allowed=f"{self.surface.grid}",
            )
        motion = np.zeros(0) if near is None else np.array([near.approach])
        return ContactPressures(np.divide(pressure, self.compliance.modulus), motion)


def _check_periodic(control: Control, overlap: float) -> None:
    """Refuse planes that do not continue periodically, and approaches beyond full contact."""
    if control.tilt is None:
        raise InputError("a plane cannot turn on a periodic surface", value="tilt free")
    if any(control.tilt):
        raise InputError(
            "a tilted plane does not continue periodically", value=control.tilt, allowed="(0, 0)"
        )
    if control.approach is not None and overlap >= 0.0:
        raise InputError(
            "a periodic surface has no gap left at this approach",
            value=control.approach,
            allowed=f"< {control.approach - overlap:.6g} mm; beyond it give the force",
        )
