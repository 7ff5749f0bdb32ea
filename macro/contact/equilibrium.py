"""Equilibrium of a body with contact laws under a rigid plane: residual and exact tangent.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any, Protocol

from petsc4py import PETSc

from macro.contact.contact_forces import ContactForces

_MATRIX = "patchlaw matrix"


class AddsProduct(Protocol):
    """Contact whose derivative is applied without being assembled."""

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative with a vector x to y."""
        ...


class ContactTangent:
    """What PETSc holds of a matrix plus the derivatives of contacts, which their owners keep.

    The references to them are weak, and PETSc itself counts the matrix: an object that Python lets
    go of while PETSc frees the shell would never be freed.

    Args:
        contacts: The contacts.
    """

    def __init__(self, contacts: Sequence[AddsProduct]) -> None:
        self.follow(contacts)

    def follow(self, contacts: Sequence[AddsProduct]) -> None:
        """Take the derivatives of other contacts from now on."""
        self._contacts = [weakref.proxy(contact) for contact in contacts]

    def shell(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return the sum with a matrix, as a PETSc matrix without entries."""
        shell = PETSc.Mat().createPython(matrix.getSizes(), self, comm=matrix.comm)
        shell.compose(_MATRIX, matrix)
        shell.setUp()
        return shell

    def mult(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product with x; PETSc calls this."""
        shell.query(_MATRIX).mult(x, y)
        self._add_contacts(x, y)

    def multTranspose(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product of the transpose with x; the part of contact is symmetric."""
        shell.query(_MATRIX).multTranspose(x, y)
        self._add_contacts(x, y)

    def _add_contacts(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        for contact in self._contacts:
            contact.add_product(x, y)


class Equilibrium:
    """The equations K u = B p(c(u)) of a body in contact with a rigid plane.

    The plane is eliminated by its own nonlinear equilibrium, so that displacements are the only
    unknowns of Newton's method. The residual K u − B p is the gradient of a convex energy if no law
    softens. Its derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is applied without being assembled; it lies
    between K and the derivative under a fixed plane.

    Args:
        body: The `ElasticBody`, or a `BodyPair`.
        forces: Forces of the laws on its contact face.

    Attributes:
        body: The elastic body.
        forces: Forces of the laws on its contact face.
        matrix: K.
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.
        scale: Norm of the contact face's load at the displacement last given to ``residual`` [N].

    Note:
        Every method is collective.
    """

    def __init__(self, body: Any, forces: ContactForces) -> None:
        self.body, self.forces, self.matrix = body, forces, body.stiffness
        self.scale = 0.0
        self._load = self.matrix.createVecLeft()
        self.tangent = ContactTangent([forces]).shell(self.matrix)

    def residual(self, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual K u − B p(closure(u)) at a displacement u.

        Args:
            displacement: u [mm].
            residual: Receives the residual [N].
        """
        self.forces.write(displacement, self._load)
        self.scale = self._load.norm()
        self.matrix.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def update_tangent(self, displacement: PETSc.Vec) -> None:
        """Move the tangent to a displacement."""
        self.forces.update(displacement)
