"""Equilibrium of the block and its contact laws: residual and exact tangent."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.block import Block
from macro.contact.contact_law import Contact
from macro.contact.law_interface import Sampling
from macro.linear_solvers.options import WeakContext

Array = NDArray[np.float64]


class Equilibrium:
    """The equations K u = B p(c(u)) of a block in contact with a rigid plane.

    Closures are c = δ − Bᵀu / w; what of the plane's approaches δ is not prescribed follows from u
    (see `Contact`). The residual K u − B p is the gradient of a convex energy when no law softens.
    Its derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is applied without being assembled: B has few
    columns (patches) or few rows (nodes of the interface) with entries, E a column for every motion
    of the plane that follows from u. It lies between K and the derivative under a fixed plane.

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

    def __init__(self, block: Block, sampling: Sampling, contact: Contact) -> None:
        self.block, self.contact, self._sampling = block, contact, sampling
        self.scale = 0.0
        stiffness = block.stiffness
        self._load = stiffness.createVecLeft()
        self._samples = sampling.operator.createVecRight()
        self._action = _TangentAction(stiffness, sampling)
        self.tangent = PETSc.Mat().createPython(
            stiffness.getSizes(), WeakContext(self._action), comm=stiffness.comm
        )
        self.tangent.setUp()

    def closure(self, displacement: PETSc.Vec) -> Array:
        """Balance the plane, and return the closures of this rank's samples, shape (n,) [mm]."""
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
        self._action.slope = stiffness / self._sampling.weight
        self._action.border = self.contact.border(stiffness)


class _TangentAction:
    """What PETSc calls to multiply by the tangent.

    Apart from :class:`Equilibrium`, which holds the matrix that is multiplied by.
    """

    def __init__(self, stiffness: PETSc.Mat, sampling: Sampling) -> None:
        self._stiffness, self._operator = stiffness, sampling.operator
        self._comm = stiffness.comm.tompi4py()
        self._stretch = sampling.operator.createVecRight()
        self.slope: Array = np.zeros(len(sampling.weight))  # p'/w
        self.border: Array = np.zeros((len(sampling.weight), 0))  # E

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write K x + B (diag(p'/w) − E Eᵀ) Bᵀ x."""
        self._stiffness.mult(x, y)
        self._operator.multTranspose(x, self._stretch)
        stretch = self._stretch.array_r
        pressure = self.slope * stretch
        if self.border.shape[1]:
            pressure -= self.border @ self._comm.allreduce(self.border.T @ stretch, op=MPI.SUM)
        self._stretch.array[:] = pressure
        self._operator.multAdd(self._stretch, y, y)

    multTranspose = mult
