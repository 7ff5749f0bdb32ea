"""Contact laws under a rigid plane, which is given or follows from its force and moment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.collective import together
from geometry.rigid_plane import Control
from macro.contact.law_interface import ContactLaw, Interface, Sampling
from macro.contact.plane_equilibrium import LOOSE, Excess, settle, touch

Array = NDArray[np.float64]


class Contact:
    """Laws at the samples of an interface, under a rigid plane.

    Motions of the plane that are not prescribed (its approach where the force is, its slopes where
    they are free) follow from the displacement s of the samples at once: they balance the plane,
    the force is the one wanted and there is no moment about the middle of the patches. So a
    bordered Newton's method needs no unknowns beyond the displacements: the plane is eliminated
    where it is known, at the samples, nonlinearly, and the least energy over its motions is as
    convex in s as the energy under a fixed plane. With D the stiffness of the laws, W the areas of
    the samples and G their levers, closures change by G dq − ds with
    (Gᵀ W D G) dq = Gᵀ W D ds.

    Args:
        interface: The patches.
        sampling: Where the laws are evaluated.
        laws: One law per patch, the same on every rank.

    Attributes:
        half: Half the diagonal of the patches' rectangle: what moments are divided by [mm].
        unit: Motions of the plane that move its edge by one, shape (3,).
        plane: Approach at the middle of the patches [mm] and slopes along x and y, shape (3,).
        free: Which of them follow from the loads, shape (3,).
        force: Force that is wanted, if one is [N].

    Note:
        Every method is collective.
    """

    def __init__(
        self, interface: Interface, sampling: Sampling, laws: Sequence[ContactLaw]
    ) -> None:
        self._comm, self._sampling, self._laws = interface.block.mesh.comm, sampling, laws
        patches = interface.patches
        middle = patches.middle
        x, y = sampling.x - middle[0], sampling.y - middle[1]
        self._lever = np.column_stack((np.ones_like(x), x, y))
        self.half = 0.5 * float(np.hypot(*patches.lengths))
        self.unit = np.array([1.0, 1.0 / self.half, 1.0 / self.half])
        self.plane: Array = np.zeros(3)
        self.free: NDArray[np.bool_] = np.zeros(3, dtype=bool)
        self.force: float | None = None

    def prescribe(self, control: Control, plane: Array) -> None:
        """Set what is given of the plane; without any force the plane just touches the surface.

        Args:
            control: What a load step prescribes.
            plane: Where the plane is now, shape (3,).

        Raises:
            NotConverged: When the plane should touch what cannot be touched.
        """
        force, self.plane = control.force, plane.copy()
        turns = control.tilt is None and force != 0.0
        self.force, self.free = force or None, np.array([bool(force), turns, turns])
        if control.tilt is not None:
            self.plane[1:] = control.tilt
        if control.approach is not None:
            self.plane[0] = control.approach
        elif force == 0.0:
            self.plane[0] = touch(self._touched, self.half)

    def closure(self, sag: Array) -> Array:
        """Balance the plane, and return the closures of this rank's samples, shape (n,) [mm].

        Args:
            sag: Downward displacements of this rank's samples, shape (n,) [mm].

        Raises:
            NotConverged: When nothing can hold the plane.
        """
        free = self.free
        if free.any():
            start = self.plane[free] / self.unit[free]
            rest = self._lever @ np.where(free, 0.0, self.plane) - sag
            self.plane[free] = self.unit[free] * settle(_Motions(self, rest), start)
        return self._lever @ self.plane - sag

    def pressure(self, closure: Array) -> Array:
        """Return the laws' pressures at this rank's samples, shape (n,) [MPa].

        What a law raises on one rank is raised on all.
        """
        return together(self._comm, lambda: self._sampling.pressure(self._laws, closure))

    def stiffness(self, closure: Array) -> Array:
        """Return the laws' stiffnesses dp/dc likewise, shape (n,) [MPa/mm]."""
        return together(self._comm, lambda: self._sampling.stiffness(self._laws, closure))

    def loads(self, pressure: Array) -> Array:
        """Return force and first moments about the middle of pressures, shape (3,) [N, N mm].

        Args:
            pressure: Pressures of this rank's samples, shape (n,) [MPa].
        """
        return self._sum(self._lever.T @ (self._sampling.weight * pressure))

    def border(self, stiffness: Array) -> Array:
        """Return E, shape (n, k'): the plane's motions take E Eᵀ w ds off D ds as they follow s.

        Args:
            stiffness: D of this rank's samples, shape (n,) [MPa/mm].
        """
        columns = self.levers * stiffness[:, None]
        if not self.free.any():
            return columns
        values, vectors = np.linalg.eigh(self.resistance(stiffness))
        held = values > LOOSE * max(values[-1], 0.0)
        return columns @ (vectors[:, held] / np.sqrt(values[held]))

    def resistance(self, stiffness: Array) -> Array:
        """Return the derivative of the loads over the free motions, shape (k, k) [N/mm].

        Args:
            stiffness: D of this rank's samples, shape (n,) [MPa/mm].
        """
        weighted = (self._sampling.weight * stiffness)[:, None] * self.levers
        return self._sum(self.levers.T @ weighted)

    @property
    def levers(self) -> Array:
        """Change of the closures by free motions that move the edge by one, shape (n, k)."""
        return self._lever[:, self.free] * self.unit[self.free]

    def _touched(self, approach: float) -> bool:
        """Tell whether the block at rest is touched at an approach."""
        closure = self._lever @ np.array([approach, *self.plane[1:]])
        return float(self.loads(self.pressure(closure))[0]) > 0.0

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)


class _Motions:
    """Free motions of a plane over samples that stand still."""

    def __init__(self, contact: Contact, rest: Array) -> None:
        self._contact, self._rest, self._levers = contact, rest, contact.levers
        self.half = contact.half

    def excess(self, motion: Array) -> Excess:
        """Return the loads beyond those wanted."""
        contact = self._contact
        loads = contact.loads(contact.pressure(self._rest + self._levers @ motion))
        wanted = np.array([contact.force or 0.0, 0.0, 0.0])
        force = float(loads[0])
        excess = (loads * contact.unit - wanted)[contact.free]
        return Excess(excess, force, contact.force or force)

    def stiffness(self, motion: Array) -> Array:
        """Return the derivative of the loads."""
        contact = self._contact
        return contact.resistance(contact.stiffness(self._rest + self._levers @ motion))

    def reach(self, motion: Array) -> float:
        """Return the displacement of the plane's edge, at most [mm]."""
        fixed = np.where(self._contact.free, 0.0, self._contact.plane / self._contact.unit)
        return float(np.abs(fixed).sum() + np.abs(motion).sum())
