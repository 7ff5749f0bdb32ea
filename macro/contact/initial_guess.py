"""Initial guesses of load steps from the solutions before.

With laws, guesses minimise the energy in the space of earlier solutions. Extrapolation took 1.8 to
3.2 times as many linear iterations over eight load steps with 4 patches and one closure for each,
and 3 to 24 % more with 16 and 64 patches or laws at points.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.contact.equations import Equilibrium
from macro.contact.sampling import Sampling

Array = NDArray[np.float64]

_ROUNDING = 1e-7
"""Smallest part of a displacement that must be new to the basis; less only adds rounding."""

_STEPS, _HALVINGS = 30, 10
"""Newton steps in the basis, and halvings of each."""


class DisplacementBasis:
    """Earlier displacements, orthonormal in the block's energy, as a basis for initial guesses.

    The block is linear, so every solution lies in the space K⁻¹ range(B), which has as many
    dimensions as there are samples. Galerkin's method in the span of the earlier solutions needs no
    linear solve and gives the initial guess of least error in the energy norm, which includes
    extrapolation. Once the basis has as many dimensions as there are patches, the guess is the
    solution.

    Args:
        equilibrium: The equations that are being solved.
        sampling: Their samples of the interface.
        size: Largest number of vectors; the oldest are dropped first.

    Attributes:
        vectors: W, this rank's degrees of freedom of the k vectors, shape (n,) each [mm]. They are
            all that is kept; three products with K for every solution replace their forces.

    Note:
        Collective.
    """

    def __init__(self, equilibrium: Equilibrium, sampling: Sampling, *, size: int = 32) -> None:
        self._equilibrium, self._sampling, self._size = equilibrium, sampling, size
        self._comm = equilibrium.body.comm
        self.vectors: list[Array] = []
        self._sampled: Array = np.empty((0, len(sampling.weight)))  # Wᵀ B of this rank's samples

    def __len__(self) -> int:
        return len(self.vectors)

    def add(self, displacement: PETSc.Vec) -> None:
        """Add the part of a displacement that is new to the basis; collective."""
        stiffness = self._equilibrium.body.stiffness
        work, force = displacement.copy(), displacement.duplicate()
        vector, before = work.array, 0.0
        for _ in range(2):  # a second pass removes what rounding left
            stiffness.mult(work, force)
            before = before or self._sum(vector @ force.array_r)
            shares = self._sum(np.array([each @ force.array_r for each in self.vectors]))
            for share, each in zip(shares, self.vectors, strict=True):
                vector -= share * each
        stiffness.mult(work, force)
        square = self._sum(vector @ force.array_r)
        if not square > _ROUNDING**2 * before:
            return
        vector /= square**0.5
        sampled = self._sampling.operator.createVecRight()
        self._sampling.operator.multTranspose(work, sampled)
        first = max(0, len(self) + 1 - self._size)
        self.vectors = [*self.vectors, vector.copy()][first:]
        self._sampled = np.vstack([self._sampled, sampled.array_r])[first:]

    def write_guess(self, into: PETSc.Vec) -> None:
        """Write the state of least energy in the basis under what is prescribed of the plane.

        It solves y = Wᵀ B p(closure(W y)) by damped Newton steps, which need not converge.
        """
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
        into.set(0.0)
        for share, vector in zip(y, self.vectors, strict=True):
            into.array[:] += share * vector

    def _projected(self, y: Array) -> tuple[Array, Array]:
        """Return the equilibrium's residual and tangent in the basis."""
        equations, weight = self._equilibrium.forces, self._sampling.weight
        columns = self._sampled
        closure = equations.closure_of((y @ columns) / weight)
        pressure, stiffness = equations.pressure(closure), equations.stiffness(closure)
        parts = np.vstack([
            -columns @ pressure,
            (columns * (stiffness / weight)) @ columns.T,
            (columns @ equations.border(stiffness)).T,
        ])  # fmt: skip
        parts = self._sum(parts)
        stiff, border = parts[1 : len(y) + 1], parts[len(y) + 1 :]
        return y + parts[0], np.eye(len(y)) + stiff - border.T @ border

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)
