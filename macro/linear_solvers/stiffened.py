"""The stiffness of a body plus that of springs at few of its nodes, without a second matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.linear_solvers.options import WeakContext

Array = NDArray[np.float64]


def springs_at(points: PETSc.Mat, slope: Array) -> PETSc.Mat:
    """Return the stiffness Bᵀ diag(s) B of springs at points.

    Args:
        points: B, rows of weighted basis functions of the points [mm²].
        slope: s of this rank's points, shape (n,) [N/mm⁵].

    Note:
        Collective.
    """
    scale, scaled = points.createVecLeft(), points.copy()
    scale.array[:] = slope
    scaled.diagonalScale(scale)
    springs = points.transposeMatMult(scaled)
    for part in (scale, scaled):  # PETSc keeps objects that Python drops
        part.destroy()
    return springs


class Stiffened:
    """The sum K + S of a body's stiffness and that of springs.

    Args:
        stiffness: K, symmetric positive definite.
        springs: S, with entries only where K has some; of type ``aij``.

    Attributes:
        springs: S.
        product: The sum as a PETSc matrix without entries; this object must be kept as long as it.

    Note:
        Every method is collective.
    """

    def __init__(self, stiffness: PETSc.Mat, springs: PETSc.Mat) -> None:
        self._stiffness, self.springs = stiffness, springs
        self.product = PETSc.Mat().createPython(
            stiffness.getSizes(), WeakContext(self), comm=stiffness.comm
        )
        self.product.setUp()

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product y with x; PETSc calls this."""
        self._stiffness.mult(x, y)
        self.springs.multAdd(x, y, y)

    def assembled(self) -> PETSc.Mat:
        """Return the sum with entries, which takes as much memory as K."""
        matrix = self._stiffness.copy()
        matrix.axpy(1.0, self.springs, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        matrix.setNearNullSpace(self._stiffness.getNearNullSpace())
        return matrix

    def diagonal_blocks(self) -> PETSc.Mat:
        """Return the 3 × 3 blocks of the nodes, a matrix without others; K has type ``baij``."""
        blocks = np.linalg.inv(np.reshape(self._stiffness.invertBlockDiagonal(), (-1, 3, 3)))
        starts, columns, entries = self.springs.getDiagonalBlock().getValuesCSR()
        rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        own = rows // 3 == columns // 3
        rows, columns = rows[own], columns[own]
        blocks[rows // 3, rows % 3, columns % 3] += entries[own]
        first, count = self._stiffness.getOwnershipRange()[0] // 3, len(blocks)
        pattern = np.arange(count + 1, dtype=PETSc.IntType), first + np.arange(count)
        csr = (pattern[0], pattern[1].astype(PETSc.IntType), blocks.ravel())
        size = (3 * count, None)
        return PETSc.Mat().createBAIJ((size, size), 3, csr=csr, comm=self._stiffness.comm)
