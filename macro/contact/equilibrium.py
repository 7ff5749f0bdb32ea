"""Equilibrium of a block with contact laws: residual and exact tangent.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.block import Block
from macro.contact.contact_law import LawContact
from macro.contact.law_interface import Sampling
from macro.linear_solvers.options import WeakContext

Array = NDArray[np.float64]


class Equilibrium:
    """The equations K u = B p(c(u)) of a block in contact with a rigid plane.

    Closures are c = δ − Bᵀu / w, with the approach δ of the plane at the samples. Motions of the
    plane that are not prescribed follow from u (see `LawContact`). The residual K u − B p is the
    gradient of a convex energy if no law softens. Its derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is
    applied without being assembled: B has few columns (patches) or few rows with entries (nodes of
    the interface), and E has a column for every free motion of the plane. The derivative lies
    between K and the derivative under a fixed plane.

    Args:
        block: The elastic block.
        sampling: Where the laws are evaluated.
        contact: The laws and the plane.

    Attributes:
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.
        scale: Norm of the interface's load at the displacement last given to ``residual`` [N].

    Note:
        Every method is collective.
    """

    def __init__(self, block: Block, sampling: Sampling, contact: LawContact) -> None:
        self.block, self.contact, self._sampling = block, contact, sampling
        self.scale = 0.0
        stiffness = block.stiffness
        self._load = stiffness.createVecLeft()
        self._samples = sampling.operator.createVecRight()
        self._slope: Array = np.zeros(len(sampling.weight))  # p'/w
        self._border: Array = np.zeros((len(sampling.weight), 0))  # E
        self.tangent = PETSc.Mat().createPython(
            stiffness.getSizes(), WeakContext(self), comm=stiffness.comm
        )
        self.tangent.setUp()

    def closure(self, displacement: PETSc.Vec) -> Array:
        """Bring the plane into equilibrium, and return this rank's closures, shape (n,) [mm]."""
        self._sampling.operator.multTranspose(displacement, self._samples)
        return self.contact.closure(self._samples.array_r / self._sampling.weight)

    def residual(self, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual K u − B p(closure(u)) at a displacement u.

        Args:
            displacement: u [mm].
            residual: Receives the residual [N].
        """
        self._samples.array[:] = self.contact.pressure(self.closure(displacement))
        self._sampling.operator.mult(self._samples, self._load)
        self.scale = self._load.norm()
        self.block.stiffness.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def update_tangent(self, displacement: PETSc.Vec) -> None:
        """Move the tangent to a displacement."""
        stiffness = self.contact.stiffness(self.closure(displacement))
        self._slope = stiffness / self._sampling.weight
        self._border = self.contact.border(stiffness)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the tangent's product K x + B (diag(p'/w) − E Eᵀ) Bᵀ x; PETSc calls this."""
        operator, samples = self._sampling.operator, self._samples
        self.block.stiffness.mult(x, y)
        operator.multTranspose(x, samples)
        stretch = samples.array_r
        pressure = self._slope * stretch
        if self._border.shape[1]:
            comm = self.block.mesh.comm
            pressure -= self._border @ comm.allreduce(self._border.T @ stretch, op=MPI.SUM)
        samples.array[:] = pressure
        operator.multAdd(samples, y, y)

    multTranspose = mult
