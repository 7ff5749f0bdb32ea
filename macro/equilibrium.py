"""Equilibrium of the block and its contact laws: residual and exact tangent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.collective import together
from macro.block import Block
from macro.interface import ContactLaw, Sampling

Array = NDArray[np.float64]


class Equilibrium:
    """The equations K u = B p(δ − Bᵀu / w) for given rigid approaches δ of the samples.

    The residual K u − B p is the gradient of a convex energy when no law softens. Its derivative
    K + B diag(p'/w) Bᵀ is applied without being assembled: B has few columns (patches) or few
    rows (nodes of the interface) with entries.

    Args:
        block: The elastic block.
        sampling: Where the laws are evaluated.
        laws: One law per patch, the same on every rank.

    Attributes:
        approach: Rigid approach at this rank's samples, shape (n,) [mm]; set it before a solve.
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.
        scale: Norm of the interface's load at the displacement last given to ``residual`` [N].

    Note:
        Every method is collective.
    """

    def __init__(self, block: Block, sampling: Sampling, laws: Sequence[ContactLaw]) -> None:
        self.block, self._sampling, self._laws = block, sampling, laws
        self.approach: Array = np.zeros(len(sampling.weight))
        self.scale = 0.0
        stiffness = block.stiffness
        self._load = stiffness.createVecLeft()
        self._samples = sampling.operator.createVecRight()
        self._action = _TangentAction(stiffness, sampling)
        self.tangent = PETSc.Mat().createPython(
            stiffness.getSizes(), self._action, comm=stiffness.comm
        )
        self.tangent.setUp()

    def closure(self, displacement: PETSc.Vec) -> Array:
        """Return the closures of this rank's samples, shape (n,) [mm]."""
        self._sampling.operator.multTranspose(displacement, self._samples)
        return self.approach - self._samples.array_r / self._sampling.weight

    def pressure(self, closure: Array) -> Array:
        """Return the laws' pressures at this rank's samples, shape (n,) [MPa].

        What a law raises on one rank is raised on all.
        """
        return together(self.block.mesh.comm, lambda: self._sampling.pressure(self._laws, closure))

    def stiffness(self, closure: Array) -> Array:
        """Return the laws' stiffnesses dp/dc likewise, shape (n,) [MPa/mm]."""
        return together(self.block.mesh.comm, lambda: self._sampling.stiffness(self._laws, closure))

    def residual(self, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual K u − B p(closure(u)) at a displacement u.

        Args:
            displacement: u [mm].
            residual: Receives the residual [N].
        """
        pressure = self.pressure(self.closure(displacement))
        self._samples.array[:] = pressure
        self._sampling.operator.mult(self._samples, self._load)
        self.scale = self._load.norm()
        self.block.stiffness.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def update_tangent(self, displacement: PETSc.Vec) -> None:
        """Move the tangent to a displacement."""
        stiffness = self.stiffness(self.closure(displacement))
        self._action.slope.array[:] = stiffness / self._sampling.weight


class _TangentAction:
    """What PETSc calls to multiply by the tangent.

    Apart from :class:`Equilibrium`, because a matrix whose context holds the matrix is never freed.
    """

    def __init__(self, stiffness: PETSc.Mat, sampling: Sampling) -> None:
        self._stiffness, self._operator = stiffness, sampling.operator
        self.slope = sampling.operator.createVecRight()  # p'/w
        self._stretch = self.slope.duplicate()

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write K x + B diag(p'/w) Bᵀ x."""
        self._stiffness.mult(x, y)
        self._operator.multTranspose(x, self._stretch)
        self._stretch.pointwiseMult(self._stretch, self.slope)
        self._operator.multAdd(self._stretch, y, y)

    multTranspose = mult
