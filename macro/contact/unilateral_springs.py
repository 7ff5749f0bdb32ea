"""Unilateral springs at the quadrature points of a top: their law, and a preconditioner with them.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from macro.linear_solvers.constrained import ConstrainedPreconditioner
from macro.linear_solvers.node_matrices import node_submatrix, springs_at

Array = NDArray[np.float64]


class AugmentedLaw:
    """The law p = ⟨p₀ + k d⟩ of this rank's quadrature points; a `ContactLaw`.

    Args:
        distance: Distances d₀ of the points from the plane at no approach and no tilt, shape (n,)
            [mm]; the interference d is the closure minus d₀.

    Attributes:
        distance: As given.
        slope: Stiffness k of the points, shape (n,) [MPa/mm].
        multiplier: Pressures p₀ at no interference, shape (n,) [MPa].
    """

    def __init__(self, distance: Array) -> None:
        self.distance = distance
        self.slope, self.multiplier = np.zeros_like(distance), np.zeros_like(distance)

    def pressure(self, closure: Array) -> Array:
        """Return the pressures, shape (n,) [MPa]."""
        return np.maximum(self.multiplier + self.slope * (closure - self.distance), 0.0)

    def stiffness(self, closure: Array) -> Array:
        """Return their derivatives, shape (n,) [MPa/mm]."""
        return np.where(self.pressure(closure) > 0.0, self.slope, 0.0)


class StiffPreconditioner:
    """M⁻¹ = P B P + (1 − P) S⁻¹ (1 − P), for a matrix K + C with stiff springs C at some dofs.

    B is a preconditioner of K. P constrains the dofs with springs to the motions of the plane, and
    P B P is corrected near them (see `ConstrainedPreconditioner`). S is the part of K + C between
    the dofs with springs; every rank factorises the part that it owns. The stiffer the springs,
    the weaker the two parts are coupled.

    Args:
        matrix: K.
        preconditioner: B.
        points_by_dofs: −w φ of every quadrature point, shape (points, dofs) [mm²].
        layers: Layers of nodes near which P B P is corrected.

    Note:
        Everything here is collective.
    """

    def __init__(
        self, matrix: PETSc.Mat, preconditioner: PETSc.PC, points_by_dofs: PETSc.Mat, layers: int
    ) -> None:
        self._matrix, self._points = matrix, points_by_dofs
        self._work = matrix.createVecRight()
        self._constrained = ConstrainedPreconditioner(matrix, preconditioner, layers)
        self._projection = self._constrained.projection
        self._dofs: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._factors: Any = None

    def update(self, stiffness: Array, dofs: NDArray[np.intp], motions: Array) -> None:
        """Move to other springs.

        Args:
            stiffness: Stiffness over weight of this rank's quadrature points [MPa/mm/mm²].
            dofs: Vertical dofs of this rank that have springs, ascending, shape (n,).
            motions: Their displacements by free motions of the plane, shape (n, k); orthonormal.
        """
        springs = springs_at(self._points, stiffness)
        nodes = np.unique(dofs // 3)
        among = 3 * np.searchsorted(nodes, dofs // 3) + dofs % 3
        # a copy of all rows and columns would take 1 kB per dof
        part = sum(
            node_submatrix(matrix.getDiagonalBlock(), nodes, nodes)[among][:, among]
            for matrix in (self._matrix, springs)
        )
        springs.destroy()
        self._dofs = dofs
        self._constrained.constrain(dofs, motions)
        self._factors = splu(csc_array(part)) if len(dofs) else None

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x; PETSc calls this."""
        work = self._work
        self._constrained.apply(pc, x, y)
        x.copy(work)
        self._projection.project(work)
        work.axpby(1.0, -1.0, x)  # (1 − P) x, which is zero but at the dofs with springs
        rest = work.array_r[self._dofs]
        work.set(0.0)
        if self._factors is not None:
            work.array[self._dofs] = self._factors.solve(rest)
        y.axpy(1.0, work)
        self._projection.project(work)
        y.axpy(-1.0, work)
