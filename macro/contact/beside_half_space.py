"""A load step of a body with contact laws that is pressed on a half-space.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from patchlaw.geometry.materials import Material
from patchlaw.geometry.rigid_plane import Control
from patchlaw.geometry.sliders import SliderResponse
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces
from patchlaw.macro.contact.equations import Equilibrium
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium
from patchlaw.macro.contact.loaded_face import ContactFace
from patchlaw.macro.contact.opposite_half_space import OppositeHalfSpace
from patchlaw.macro.contact.sampling import Sampling
from patchlaw.macro.linear_solvers.solvers import solve_linear
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotConverged

_ROUGHLY = 1e-4
"""Residual of a solution of the body over that before it: as pressures converge, so does it."""


class BesideHalfSpace:
    """A body with laws beside a half-space.

    The body is solved for under stresses that are known, with its own stiffness alone.

    Args:
        face: The contact face of the body.
        sampling: The samples that laws are evaluated at.
        equilibrium: The equations of the body with the laws.
        opposite: Elastic constants of the half-space.

    Note:
        Construction and every method are collective.
    """

    def __init__(
        self, face: ContactFace, sampling: Sampling, equilibrium: Equilibrium, opposite: Material
    ) -> None:
        self._equilibrium, self._sampling = equilibrium, sampling
        materials = face.body.materials
        all_of_them = [materials] if isinstance(materials, Material) else materials.values()
        softest = max(one.surface_compliance for one in all_of_them)
        self._half_space = OppositeHalfSpace(sampling, face.patches.lengths, opposite, softest)
        self._body = _UnderStresses(equilibrium, sampling)

    def solve(self, control: Control, gap: Array) -> tuple[FaceEquilibrium, PETSc.Vec]:
        """Find the equilibrium of body and half-space, and let sliders follow it.

        Args:
            control: What is prescribed of the plane.
            gap: Gap of this rank's samples under a flat half-space, shape (n,) [mm].

        Returns:
            The equilibrium, whose iterations are solutions of the body; and the displacements by
            the contact [mm].

        Raises:
            NotConverged: When it is not found.
        """
        forces, body = self._equilibrium.forces, self._body
        compat.collect_garbage(body.displacement.comm)  # every step and response leaves fields
        body.count()
        contact = _LoadStep(forces, gap, body)
        found = self._half_space.follow(contact, f"the half-space at {control}")
        closure, shear = contact.closure, None
        if forces.sliders is not None:
            moved = self._half_space.at_both(found.along) + found.deviation[:, 1:]
            at = closure, moved, forces.pressure(closure), forces.stiffness(closure)
            shear = forces.sliders.accept(forces.sliders.respond(*at))
        state = forces.state(
            closure,
            iterations=body.solutions,
            linear_iterations=body.iterations,
            residuals=np.array(body.residuals),
            reason="CONVERGED_FNORM_RELATIVE",
            shear=shear,
        )
        return state, body.displacement.copy()

    def closed_in(self, way: Array) -> Array:
        """Return the change of pressures where samples close in, to first order, (n,) [MPa].

        Stiffnesses are those that the forces of the laws were linearised with last.

        Args:
            way: What they close in by, shape (n,) [mm].

        Raises:
            NotConverged: When it is not found.
        """
        return self._linear(_Linearised(self._equilibrium, self._sampling, way)).pressure

    def sheared(self, ahead: Array, found: SliderResponse) -> tuple[Array, Array, int]:
        """Return what a shift of the plane changes, to first order.

        Args:
            ahead: The shift, shape (2,).
            found: The shear stresses that the forces of the laws were linearised with last.

        Returns:
            The changes of pressures and shear stresses, shape (n, 3), and of slips, shape (n, 2);
            and the linear iterations that it took.

        Raises:
            NotConverged: When it is not found.
        """
        closing = np.zeros(len(found.closure))
        contact = _Linearised(self._equilibrium, self._sampling, closing, ahead, found)
        self._linear(contact)
        change = np.column_stack([contact.pressure, contact.stress])
        return change, contact.slip, contact.body.iterations

    def _linear(self, contact: _Linearised) -> _Linearised:
        self._half_space.equilibrium(contact, "the response beside the half-space")
        return contact


class _UnderStresses:
    """Displacements of the body under stresses, each solution a correction of the one before.

    Args:
        equilibrium: The equations of the body.
        sampling: The samples of the stresses.

    Attributes:
        displacement: The latest displacements [mm].
        solutions: Solutions since `count`.
        iterations: Their linear iterations.
        residuals: Norms of their residuals before them, relative to that of the load.
    """

    def __init__(self, equilibrium: Equilibrium, sampling: Sampling) -> None:
        self._body, self._forces = equilibrium.body, equilibrium.forces
        self._sampling, matrix = sampling, self._body.stiffness
        self.displacement = matrix.createVecRight()
        self._load, self._product = matrix.createVecLeft(), matrix.createVecLeft()
        self._correction = matrix.createVecRight()
        self.count()

    def count(self) -> None:
        """Begin to count."""
        self.solutions, self.iterations = 0, 0
        self.residuals: list[float] = []

    def displacements(self, pressure: Array, stress: Array | None) -> Array:
        """Return the displacements of the samples under stresses; see `Contact.displacements`."""
        forces, load = self._forces, self._load
        if stress is None:
            self._sampling.values.array[:] = pressure
            self._sampling.operator.mult(self._sampling.values, load)
        else:
            forces.write_stresses(pressure, stress, load)
        self._body.stiffness.mult(self.displacement, self._product)
        size = load.norm()
        load.axpy(-1.0, self._product)
        self.residuals.append(load.norm() / size if size else 0.0)
        self.iterations += solve_linear(
            self._body.solver, load, self._correction, tolerance=_ROUGHLY
        )
        self.solutions += 1
        self.displacement.axpy(1.0, self._correction)
        into = self._sampling.displacements(self.displacement)[:, None]
        return into if stress is None else np.hstack([into, forces.along(self.displacement)])


class _LoadStep:
    """The contact of a load step, see `opposite_half_space.Contact`.

    Args:
        forces: The forces of the laws, with what is prescribed of the plane.
        gap: Gap of this rank's samples under a flat half-space, shape (n,) [mm].
        body: Displacements of the body.

    Attributes:
        closure: Closures at the latest pressures, shape (n,) [mm].
    """

    def __init__(self, forces: ContactForces, gap: Array, body: _UnderStresses) -> None:
        self._forces, self._gap, self.displacements = forces, gap, body.displacements
        self.directions = forces.directions
        self.closure: Array = np.zeros_like(gap)
        self._by_slip: Array = np.zeros((len(gap), 2, 2))

    def pressures(self, moved: Array) -> Array:
        """Return the pressures in gaps that are wider by so much."""
        forces = self._forces
        forces.gap = self._gap + moved
        self.closure = forces.closure_of(np.zeros_like(moved))
        self._stiffness = forces.stiffness(self.closure)
        forces.linearise(self._stiffness)
        self._pressure = forces.pressure(self.closure)
        return self._pressure

    def changes(self, way: Array) -> Array:
        """Return the change of pressures where samples close in, to first order."""
        return self._forces.pressure_change(self._forces.weight * way)

    def stresses(self, moved: Array) -> Array:
        """Return the shear stresses; all stick where no shift makes the prescribed force yet."""
        sliders = self._forces.sliders
        assert sliders is not None
        at = self.closure, moved, self._pressure, self._stiffness
        try:
            found = sliders.respond(*at)
        except NotConverged:
            found = sliders.respond(*at, sticks=True)
        self._by_slip = found.by_slip
        return found.stress

    def stress_changes(self, way: Array) -> Array:
        """Return the change of stresses where samples slip on, the plane shifting where free."""
        assert self._forces.sliders is not None
        change = np.einsum("nij,nj->ni", self._by_slip, way)
        return self._forces.sliders.with_shift(self._by_slip, change)


class _Linearised:
    """The change of a contact to first order, as a contact of its own.

    Args:
        equilibrium: The equations of the body with the laws, whose forces are linearised.
        sampling: The samples.
        way: What samples close in by, shape (n,) [mm].
        ahead: Shift of the plane, shape (2,); None: shear stresses stay.
        found: The shear stresses, with their derivatives.

    Attributes:
        body: Displacements of the body.
        pressure: The latest changes of pressures, shape (n,) [MPa].
        stress: The latest changes of shear stresses, shape (n, 2) [MPa].
        slip: The latest changes of slips, shape (n, 2).
    """

    def __init__(
        self,
        equilibrium: Equilibrium,
        sampling: Sampling,
        way: Array,
        ahead: Array | None = None,
        found: SliderResponse | None = None,
    ) -> None:
        self._forces, self._way, self._found = equilibrium.forces, way, found
        self._ahead = np.zeros(2) if ahead is None else ahead
        self.directions = 1 if found is None else 3
        self.body = _UnderStresses(equilibrium, sampling)
        self.pressure: Array = np.zeros_like(way)
        self.stress: Array = np.zeros((len(way), 2))
        self.slip: Array = np.zeros((len(way), 2))

    def pressures(self, moved: Array) -> Array:
        """Return the changes of pressures in gaps that are wider by so much."""
        self.pressure = self.changes(self._way - moved)
        return self.pressure

    def changes(self, way: Array) -> Array:
        """Return the change of these where samples close in."""
        return self._forces.pressure_change(self._forces.weight * way)

    def stresses(self, moved: Array) -> Array:
        """Return the changes of shear stresses where slip is less by so much."""
        assert self._found is not None
        rise = self._forces.normal_slope * self._forces.weight
        closing = np.divide(self.pressure, rise, out=np.zeros_like(rise), where=rise > 0.0)
        self.slip = self._ahead - moved
        self.stress = self.stress_changes(self.slip) + self._found.by_closure * closing[:, None]
        return self.stress

    def stress_changes(self, way: Array) -> Array:
        """Return the change of these where samples slip on."""
        assert self._found is not None
        return np.einsum("nij,nj->ni", self._found.by_slip, way)

    def displacements(self, pressure: Array, stress: Array | None) -> Array:
        """Return the displacements of the body."""
        return self.body.displacements(pressure, stress)
