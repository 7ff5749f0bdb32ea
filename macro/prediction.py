"""Start of a load step: the state of least energy among combinations of earlier displacements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.interface import ContactLaw, Sampling

Array = NDArray[np.float64]

_ROUNDING = 1e-7  # share of a new vector that must be new, or it only adds rounding


class DisplacementBasis:
    """Displacements that spanned earlier solutions, orthonormal in the block's energy.

    The block is linear, so all its solutions lie in the space K⁻¹ range(B), of as many dimensions
    as there are samples. Solving the contact problem by Galerkin's method in the span of what is
    known already costs no linear solve and gives the best start in the energy norm; linear
    extrapolation in the approach is among the candidates. Once the basis is as rich as the
    patches, the start is the solution.

    Args:
        stiffness: Stiffness matrix K of the block.
        sampling: Samples of the interface.
        size: Largest number of vectors kept; the oldest go first.
    """

    def __init__(self, stiffness: PETSc.Mat, sampling: Sampling, *, size: int = 32) -> None:
        self._stiffness, self._sampling, self._size = stiffness, sampling, size
        self._comm = stiffness.comm.tompi4py()
        owned, samples = stiffness.getLocalSize()[0], len(sampling.weight)
        self._vectors, self._forces = np.empty((2, 0, owned))  # W and K W, one row per vector
        self._sampled = np.empty((0, samples))  # Wᵀ B of this rank's samples

    def __len__(self) -> int:
        return len(self._vectors)

    def add(self, displacement: PETSc.Vec) -> None:
        """Add what is new in a displacement; collective."""
        work = displacement.duplicate()
        self._stiffness.mult(displacement, work)
        vector, force = displacement.array_r.copy(), work.array_r.copy()
        before = self._sum(vector @ force)
        for _ in range(2):  # once more for what rounding left
            shares = self._sum(self._vectors @ force)
            vector -= shares @ self._vectors
            force -= shares @ self._forces
        square = self._sum(vector @ force)
        if not square > _ROUNDING**2 * before:
            return
        vector, force = vector / square**0.5, force / square**0.5
        work.array[:] = vector
        sampled = self._sampling.operator.createVecRight()
        self._sampling.operator.multTranspose(work, sampled)
        first = max(0, len(self) + 1 - self._size)
        self._vectors = np.vstack([self._vectors, vector])[first:]
        self._forces = np.vstack([self._forces, force])[first:]
        self._sampled = np.vstack([self._sampled, sampled.array_r])[first:]

    def start(self, laws: Sequence[ContactLaw], approach: Array, into: PETSc.Vec) -> None:
        """Write the state of least energy in the basis.

        Args:
            laws: One law per patch.
            approach: Rigid approach at this rank's samples, shape (n,) [mm].
            into: Receives the displacement.

        Note:
            Collective.
        """
        into.array[:] = self._coefficients(laws, approach) @ self._vectors

    def _coefficients(self, laws: Sequence[ContactLaw], approach: Array) -> Array:
        """Solve y = Σ (Bᵀ W)ᵀ p(closure(y)) by damped Newton steps; a rough answer will do."""
        size, weight, columns = len(self), self._sampling.weight, self._sampled

        def residual(y: Array) -> tuple[Array, Array]:
            closure = approach - (y @ columns) / weight
            pressure, stiffness = self._sampling.evaluate(laws, closure)
            parts = np.empty((size + 1, size))
            parts[0] = -columns @ pressure
            parts[1:] = (columns * (stiffness / weight)) @ columns.T
            parts = self._sum(parts)
            return y + parts[0], np.eye(size) + parts[1:]

        y = np.zeros(size)
        value, slope = residual(y)
        for _ in range(30):
            step, share = np.linalg.solve(slope, value), 1.0
            trial = residual(y - step)
            while np.linalg.norm(trial[0]) > np.linalg.norm(value) and share > 1e-3:
                share *= 0.5
                trial = residual(y - share * step)
            if not np.linalg.norm(trial[0]) < np.linalg.norm(value):
                break
            y, (value, slope) = y - share * step, trial
        return y

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)
