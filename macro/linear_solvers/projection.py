"""The orthogonal projection on displacements that held degrees of freedom leave."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

Array = NDArray[np.float64]


class Projection:
    """The orthogonal projection P: identity on what is free, Q Qᵀ on what is held.

    Args:
        comm: MPI communicator.
    """

    def __init__(self, comm: Any) -> None:
        self._comm = comm
        self._dofs: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._motions: Array = np.empty((0, 0))

    def hold(self, dofs: NDArray[np.intp], motions: Array) -> None:
        """Hold degrees of freedom but for motions Q; see `ConstrainedSolver.hold`."""
        self._dofs, self._motions = dofs, motions

    def project(self, vector: PETSc.Vec) -> None:
        """Project a vector in place; collective."""
        values, q = vector.array, self._motions
        shares = q.T @ values[self._dofs]
        if shares.size:
            shares = self._comm.allreduce(shares, op=MPI.SUM)
        values[self._dofs] = q @ shares
