"""Forces of contact laws with friction on a face: pressures, and shear stresses by sliders.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from petsc4py import PETSc

from geometry.rigid_plane import Control
from geometry.sliders import SliderResponse
from geometry.spring_bed import Friction
from macro.contact.contact_forces import ContactForces, ContactLaw, ContactLaws
from macro.contact.face_equilibrium import FaceShear
from macro.contact.face_sliders import FaceSliders
from macro.contact.loaded_face import ContactFace, Mode
from macro.contact.shear_lines import ShearLines, shear_lines
from support.arrays import Array
from support.errors import NotConverged


class FrictionalForces(ContactForces):
    """Contact forces with Coulomb friction: every sample bears a pressure and two shear stresses.

    Shear stresses are those of `FaceSliders`. The derivative has the part ∂τ/∂c, with which it is
    unsymmetric. Where a shear force is prescribed, the shift of the plane is eliminated as its
    other motions are.

    Args:
        face: The contact face with its patches.
        mode: Where the laws are evaluated.
        laws: One law per patch, or all of them together; the same on every rank.
        gap: Macroscopic gap between plane and face at this rank's samples, shape (n,) [mm].
        friction: The friction.

    Attributes:
        sliders: The sliders of the samples.
        slope: Stiffness over w of this rank's samples along the normal and both axes, at the latest
            `update`, shape (3 n,) [N/mm⁵].
    """

    def __init__(
        self,
        face: ContactFace,
        mode: Mode,
        laws: Sequence[ContactLaw] | ContactLaws,
        gap: Array,
        friction: Friction,
    ) -> None:
        super().__init__(face, face.sampling(mode), laws, gap)
        each: Any = getattr(laws, "laws", laws)
        self.sliders = FaceSliders(self._sampling, self.levers, each, friction, self.comm)
        self._operator = face.in_all_directions(mode)
        self._stresses = self._operator.createVecRight()
        n = len(self._sampling.weight)
        self.slope = np.zeros(3 * n)
        self._lines: ShearLines | None = None
        self._tangent: Array = np.zeros((n, 3, 3))
        self._by_pressure: Array = np.zeros((n, 3))  # of (p, τx, τy) as the plane moves
        self._by_slip: Array = np.zeros((n, 2, 2))

    def prescribe(self, control: Control, plane: Array) -> None:
        """Set what a load step prescribes, of the shear too: without any the plane does not shift.

        Args:
            control: What a load step prescribes.
            plane: Where the plane is now, shape (3,).
        """
        super().prescribe(control, plane)
        self._lines = None
        self.sliders.prescribe(control)

    def respond(self, closure: Array, displacement: PETSc.Vec) -> SliderResponse:
        """Return the shear stresses at closures and displacements; the plane shifts where free.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements of the body [mm].

        Raises:
            NotConverged: When the contact does not transmit the prescribed shear force.
        """
        pressure, stiffness = self.pressure(closure), self.stiffness(closure)
        return self.sliders.respond(closure, self.along(displacement), pressure, stiffness)

    def along(self, displacement: PETSc.Vec) -> Array:
        """Return the displacements of samples along the axes of the face, shape (n, 2) [mm].

        Of two bodies they are the differences of both.
        """
        return self._stretched(displacement)[:, 1:] / self._sampling.weight[:, None]

    def _stretched(self, displacement: PETSc.Vec) -> Array:
        """Return w times the displacements of samples against the directions, shape (n, 3)."""
        self._operator.multTranspose(displacement, self._stresses)
        return self._stresses.array_r.reshape(-1, 3).copy()

    # --- the forces and their derivative

    def write(self, displacement: PETSc.Vec, load: PETSc.Vec) -> None:
        """Write the forces by pressures and shear stresses at a displacement.

        Args:
            displacement: u [mm].
            load: Receives the nodal forces [N].
        """
        closure = self.closure(displacement)
        pressure = self.pressure(closure)
        moved, stiffness = self.along(displacement), self.stiffness(closure)
        shear = self.sliders.respond(closure, moved, pressure, stiffness).stress
        self.write_stresses(pressure, shear, load)

    def write_stresses(self, pressure: Array, shear: Array, load: PETSc.Vec) -> None:
        """Write the forces by pressures (n,) and shear stresses (n, 2) of this rank's samples."""
        self._stresses.array[:] = np.column_stack([pressure, shear]).ravel()
        self._operator.mult(self._stresses, load)

    def write_lines(
        self,
        displacement: PETSc.Vec,
        closure: Array,
        pressure: Array,
        stiffness: Array,
        load: PETSc.Vec,
        *,
        body: float,
        shear: Array | None,
    ) -> None:
        """Write the forces on laws that are lines; see `ContactForces.write_lines`.

        Springs stick where pressures on the lines do not transmit the prescribed shear force yet.
        """
        sliders, moved = self.sliders, self.along(displacement)
        if sliders.shifts:
            at = closure, moved, pressure, stiffness
            try:
                found = sliders.respond(*at)
            except NotConverged:
                found = sliders.respond(*at, sticks=True)
            lines = ShearLines(found.slip, closure, found.stress, found)
        else:
            slip = sliders.slip(moved)
            respond = partial(sliders.at_slip, closure, np.maximum(pressure, 0.0), stiffness)
            if shear is None:
                assert self._lines is not None
                shear = self._lines.at(slip, closure)
            lines = shear_lines(respond, slip, closure, shear, body)
        self._lines = lines
        self.write_stresses(pressure, lines.stress, load)
        self.linearise_shear(stiffness, lines.response)

    def write_shear_in(
        self,
        parts: Array,
        y: Array,
        stretches: Array,
        closure: Array,
        pressure: Array,
        stiffness: Array,
    ) -> None:
        """Add the work of shear stresses and its derivative; see `ContactForces.write_shear_in`.

        The latest stresses stay where pressures do not transmit the prescribed shear force yet.
        """
        along = stretches[:, :, 1:]
        moved = np.einsum("k,kni->ni", y, along) / self._sampling.weight[:, None]
        try:
            found = self.sliders.respond(closure, moved, pressure, stiffness)
        except NotConverged:
            parts[0] -= np.einsum("kni,ni->k", along, self.sliders.memory.stress)
            return
        self.linearise_shear(stiffness, found)
        parts[0] -= np.einsum("kni,ni->k", along, found.stress)
        changes = np.array([self._stress_change(each)[:, 1:] for each in stretches])
        parts[1 : len(y) + 1] += np.einsum("kni,lni->kl", along, changes)

    @property
    def last_shear(self) -> Array:
        """Shear stresses of the latest load step, shape (n, 2) [MPa]."""
        return self.sliders.memory.stress

    def write_last_shear(self, load: PETSc.Vec) -> None:
        """Write the forces by the shear stresses of the latest load step."""
        stress = self.last_shear
        self.write_stresses(np.zeros(len(stress)), stress, load)

    def update(self, displacement: PETSc.Vec) -> None:
        """Move the derivative to a displacement."""
        closure = self.closure(displacement)
        stiffness = self.stiffness(closure)
        self.linearise_shear(stiffness, self.respond(closure, displacement))

    def linearise(self, stiffness: Array) -> None:
        """Move the derivative to stiffnesses of this rank's samples; sliders do not slip.

        Args:
            stiffness: Stiffnesses, shape (n,) [MPa/mm].
        """
        self._take(stiffness, np.zeros((len(stiffness), 3, 3)))

    def linearise_shear(self, stiffness: Array, response: SliderResponse) -> None:
        """Move the derivative to stiffnesses of the laws, and to those of shear stresses.

        Args:
            stiffness: Stiffnesses, shape (n,) [MPa/mm].
            response: The shear stresses.
        """
        tangent = np.zeros((len(stiffness), 3, 3))
        tangent[:, 1:, 0], tangent[:, 1:, 1:] = response.by_closure, response.by_slip
        self._take(stiffness, tangent)

    def linearise_sticking(self, stiffness: Array, stuck: Array) -> None:
        """Move the derivative to that of springs that stick, under a given shift.

        Args:
            stiffness: Stiffnesses of the laws at this rank's samples, shape (n,) [MPa/mm].
            stuck: Tangential stiffness of what sticks there, shape (n,) [MPa/mm].
        """
        tangent = np.zeros((len(stuck), 3, 3))
        tangent[:, 1:, 1:] = stuck[:, None, None] * np.eye(2)
        self.sliders.hold_shift()
        self._take(stiffness, tangent)

    def _take(self, stiffness: Array, tangent: Array) -> None:
        weight = self._sampling.weight
        super().linearise(stiffness)
        tangent[:, 0, 0] = stiffness
        self._tangent = tangent / weight[:, None, None]
        along = 0.5 * (tangent[:, 1, 1] + tangent[:, 2, 2])  # preconditioners know the mean
        self.slope = (np.column_stack([stiffness, along, along]) / weight[:, None]).ravel()
        closes = np.divide(1.0, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0)
        self._by_pressure = np.column_stack(
            [np.ones_like(closes), tangent[:, 1:, 0] * closes[:, None]]
        )
        self._by_slip = tangent[:, 1:, 1:].copy()

    @property
    def normal_slope(self) -> Array:
        """p'/w of this rank's samples at the latest `update`, shape (n,) [N/mm⁵]."""
        return self.slope[::3]

    @property
    def tangents(self) -> Array:
        """Derivatives of (p, τx, τy)/w by closure and slips of this rank's samples, (n, 3, 3).

        Those under a plane in a given place [N/mm⁵].
        """
        return self._tangent

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec, known: Array | float = 0.0) -> None:
        """Add the product of the derivative to y, as `ContactForces.add_product` does.

        Args:
            x: A vector.
            y: What it is added to.
            known: A part of `slope` that is left out, as y holds its product already, shape (3 n,).
        """
        stretch = self._stretched(x)
        self._add_stresses(self._stress_change(stretch).ravel() - known * stretch.ravel(), y)

    def _stress_change(self, stretch: Array) -> Array:
        """Return the change of pressures and shear stresses where samples move, shape (n, 3).

        Args:
            stretch: What they move by against the directions, times their weights, (n, 3) [mm³].
        """
        change = np.einsum("nij,nj->ni", self._tangent, stretch)
        if self._border.shape[1]:
            parted = self._border @ self.levers.summed(self._border.T @ stretch[:, 0])
            change -= self._by_pressure * parted[:, None]
        if self.sliders.shifts:
            total = self.sliders.total
            moves = total(self._by_slip.reshape(-1, 4)).reshape(2, 2)
            shift = np.linalg.lstsq(moves, total(change[:, 1:]), rcond=1e-13)[0]
            change[:, 1:] -= self._by_slip @ shift
        return change

    def add_springs_product(self, slope: Array, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product with springs of other slopes, shape (3 n,), to y."""
        self._add_stresses(slope * self._stretched(x).ravel(), y)

    def _add_stresses(self, stresses: Array, y: PETSc.Vec) -> None:
        self._stresses.array[:] = stresses
        self._operator.multAdd(self._stresses, y, y)

    # --- load steps

    def accept(self, closure: Array, displacement: PETSc.Vec) -> FaceShear:
        """Move the sliders on to the end of a load step that has converged.

        Args:
            closure: Closures at its end, shape (n,) [mm].
            displacement: Displacements there [mm].

        Returns:
            The shear of the face there.
        """
        return self.sliders.accept(self.respond(closure, displacement))

    def shear_state(self, closure: Array, displacement: PETSc.Vec) -> FaceShear:
        """Return the shear of the face at closures and displacements.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements [mm].
        """
        return self.sliders.shear_of(self.respond(closure, displacement))


def sliders_of(forces: ContactForces) -> FaceSliders | None:
    """Return the sliders of the forces of laws; None without friction."""
    return forces.sliders if isinstance(forces, FrictionalForces) else None


def contact_forces(
    face: ContactFace,
    mode: Mode,
    laws: Sequence[ContactLaw] | ContactLaws,
    gap: Array,
    friction: Friction | None,
) -> ContactForces:
    """Return the forces of laws on a face, with friction where there is any.

    Args:
        face: The contact face with its patches.
        mode: Where the laws are evaluated.
        laws: One law per patch, or all of them together.
        gap: Macroscopic gap at this rank's samples, shape (n,) [mm].
        friction: The friction; None: none.
    """
    if friction is None:
        return ContactForces(face, face.sampling(mode), laws, gap)
    return FrictionalForces(face, mode, laws, gap, friction)
