"""Equilibrium of a body with contact laws under a rigid plane: residual and exact tangent.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.contact.contact_forces import ContactForces
from macro.elastic_body import ElasticBody
from macro.linear_solvers.options import WeakContext

Array = NDArray[np.float64]


class Equilibrium:
    """The equations K u = B p(c(u)) of a body in contact with a rigid plane.

    The plane is eliminated by its own nonlinear equilibrium, so that displacements are the only
    unknowns of Newton's method. The residual K u − B p is the gradient of a convex energy if no law
    softens. Its derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is applied without being assembled; it lies
    between K and the derivative under a fixed plane.

    Args:
        body: The elastic body.
        forces: Forces of the laws on its contact face.

    Attributes:
        body: The elastic body.
        forces: Forces of the laws on its contact face.
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.
        scale: Norm of the contact face's load at the displacement last given to ``residual`` [N].

    Note:
        Every method is collective.
    """

    def __init__(self, body: ElasticBody, forces: ContactForces) -> None:
        self.body, self.forces = body, forces
        self.scale = 0.0
        stiffness = body.stiffness
        self._load = stiffness.createVecLeft()
        self.tangent = PETSc.Mat().createPython(
            stiffness.getSizes(), WeakContext(self), comm=stiffness.comm
        )
        self.tangent.setUp()

    def residual(self, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual K u − B p(closure(u)) at a displacement u.

        Args:
            displacement: u [mm].
            residual: Receives the residual [N].
        """
        self.forces.write(displacement, self._load)
        self.scale = self._load.norm()
        self.body.stiffness.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def update_tangent(self, displacement: PETSc.Vec) -> None:
        """Move the tangent to a displacement."""
        self.forces.update(displacement)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the tangent's product K x + B (diag(p'/w) − E Eᵀ) Bᵀ x; PETSc calls this."""
        self.body.stiffness.mult(x, y)
        self.forces.add_stiffness(x, y)

    multTranspose = mult
