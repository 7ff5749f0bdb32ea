"""Start of a load step: the state of least energy among combinations of earlier displacements."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.contact.equilibrium import Equilibrium
from macro.contact.law_interface import Sampling

Array = NDArray[np.float64]

_ROUNDING = 1e-7  # share of a new vector that must be new, or it only adds rounding
_STEPS, _HALVINGS = 30, 10  # of Newton's method in the basis


class DisplacementBasis:
    """Displacements that spanned earlier solutions, orthonormal in the block's energy.

    The block is linear, so every solution lies in the space K⁻¹ range(B), of as many dimensions
    as there are samples. Galerkin's method in the span of the solutions known so far costs no
    linear solve and gives the start of least error in the energy norm, extrapolation in the
    approach included. Once the basis is as rich as the patches, the start is the solution.

    Args:
        equilibrium: The equations that are being solved.
        sampling: Their samples of the interface.
        size: Largest number of vectors kept; the oldest go first.

    Note:
        Collective.
    """

    def __init__(self, equilibrium: Equilibrium, sampling: Sampling, *, size: int = 32) -> None:
        self._equilibrium, self._sampling, self._size = equilibrium, sampling, size
        self._comm = equilibrium.block.mesh.comm
        self._vectors: Array = np.empty((0, equilibrium.block.owned_dofs))  # W
        self._forces: Array = np.empty_like(self._vectors)  # K W
        self._sampled: Array = np.empty((0, len(sampling.weight)))  # Wᵀ B of this rank's samples

    def __len__(self) -> int:
        return len(self._vectors)

    def add(self, displacement: PETSc.Vec) -> None:
        """Add what is new in a displacement; collective."""
        work = displacement.duplicate()
        self._equilibrium.block.stiffness.mult(displacement, work)
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

    def start(self, into: PETSc.Vec) -> None:
        """Write the state of least energy in the basis under what is prescribed of the plane."""
        into.array[:] = self._coefficients() @ self._vectors

    def _coefficients(self) -> Array:
        """Solve y = Wᵀ B p(closure(W y)) by damped Newton steps; a rough answer will do."""
        y = np.zeros(len(self))
        value, slope = self._projected(y)
        first = float(np.linalg.norm(value))
        for _ in range(_STEPS):
            if np.linalg.norm(value) <= _ROUNDING**2 * first:
                break
            step = np.linalg.solve(slope, value)
            for share in 0.5 ** np.arange(_HALVINGS):
                trial = y - share * step
                trial_value, trial_slope = self._projected(trial)
                if np.linalg.norm(trial_value) < np.linalg.norm(value):
                    break
            else:
                break
            y, value, slope = trial, trial_value, trial_slope
        return y

    def _projected(self, y: Array) -> tuple[Array, Array]:
        """Return the equilibrium's residual and tangent in the basis."""
        contact, weight, columns = self._equilibrium.contact, self._sampling.weight, self._sampled
        closure = contact.closure((y @ columns) / weight)
        pressure, stiffness = contact.pressure(closure), contact.stiffness(closure)
        parts = np.vstack([
            -columns @ pressure,
            (columns * (stiffness / weight)) @ columns.T,
            (columns @ contact.border(stiffness)).T,
        ])  # fmt: skip
        parts = self._sum(parts)
        stiff, border = parts[1 : len(y) + 1], parts[len(y) + 1 :]
        return y + parts[0], np.eye(len(y)) + stiff - border.T @ border

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)
