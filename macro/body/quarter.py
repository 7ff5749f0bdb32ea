"""A quarter of a block, in which even and odd modes of pressure are solved for apart.

The planes through the middle of the block divide it into quarters. Pressures that are even about
such a plane do not displace it across, odd ones do not displace it along.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import bmat, csr_matrix, kron

from macro.block import Sides
from macro.body.line import Line
from macro.elasticity import Material
from macro.factorisation import set_up

Array = NDArray[np.float64]
Parity = tuple[int, int]
"""0 for modes that are even along x, and along y; 1 for odd ones."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Quarter:
    """The quarter of a block beyond the middle of its contact face, clamped at the bottom.

    Args:
        lines: Elements along x and y from the middle to the sides, along z from the bottom up.
        lengths: Sides (Lx, Ly) of the contact face [mm].
        material: Elastic constants.
        sides: Support of the block's sides.
    """

    lines: tuple[Line, Line, Line]
    lengths: tuple[float, float]
    material: Material
    sides: Sides

    @property
    def shape(self) -> tuple[int, int, int]:
        """Unknowns of a component along x, y and z."""
        x, y, z = (line.count for line in self.lines)
        return x, y, z

    def displacements(self, count: int, parity: Parity) -> tuple[Array, Array, Array]:
        """Return how the modes of one parity displace the face.

        Args:
            count: Modes K along a side, even and odd together.
            parity: That of the modes of pressure.

        Returns:
            Integrals over the face of modes times displacements by unit modes of pressure, along
            x, y and downwards, shape (k, l, m, n) [mm³/MPa]. Displacements along an axis are
            even along it where the pressure is odd, and odd where it is even: k and l count the
            modes of their parity, m and n those of the pressure.
        """
        free = np.flatnonzero(self._free(parity))
        stiffness = self._stiffness[free][:, free]
        top, place = self._top(free)
        modes = [
            [self._modes(along, count, (parity[along] + (along == axis)) % 2) for along in (0, 1)]
            for axis in range(3)
        ]
        loads = np.kron(*modes[2])[:, place[2]]
        right = np.zeros((len(free), len(loads)), order="F")
        right[top[2]] = -loads.T
        solved = _solved(stiffness, right)
        found = []
        for axis, sign in enumerate((1.0, 1.0, -1.0)):
            seen = 4.0 * sign * np.kron(*modes[axis])[:, place[axis]] @ solved[top[axis]]
            sizes = [len(part) for part in (*modes[axis], *modes[2])]
            found.append(seen.reshape(sizes))
        return found[0], found[1], found[2]

    @cached_property
    def _stiffness(self) -> csr_matrix:
        """Stiffness without any support, of unknowns (component, ix, iy, iz) [N/mm]."""
        parts = [line.matrices() for line in self.lines]
        lame, shear = self.material.lame
        blocks: list[list[Any]] = [[None] * 3 for _ in range(3)]
        for row in range(3):
            weights = [lame + 2.0 * shear if axis == row else shear for axis in range(3)]
            blocks[row][row] = sum(
                weight * _product(parts, {axis: "stiffness"}) for axis, weight in enumerate(weights)
            )
            for column in range(row):
                first = _product(parts, {row: "slopes of rows", column: "slopes of columns"})
                second = _product(parts, {column: "slopes of rows", row: "slopes of columns"})
                blocks[row][column] = lame * first + shear * second
                blocks[column][row] = blocks[row][column].T
        return csr_matrix(bmat(blocks))

    def _free(self, parity: Parity) -> NDArray[np.bool_]:
        """Return which unknowns no support and no symmetry holds, flat."""
        free = np.ones((3, *self.shape), dtype=bool)
        free[:, :, :, 0] = False
        for axis in (0, 1):
            for component in range(3):
                line = np.moveaxis(free[component], axis, 0)
                line[0] &= (component == axis) == (parity[axis] == 1)
                if self.sides == "roller" and component == axis:
                    line[-1] = False
        return free.ravel()

    def _top(self, free: NDArray[np.intp]) -> tuple[list[NDArray[np.intp]], list[NDArray[np.intp]]]:
        """Return the free unknowns on top, by component, and their places (ix, iy), flat."""
        component, ix, iy, iz = np.unravel_index(free, (3, *self.shape))
        flat = ix * self.shape[1] + iy
        top = [np.flatnonzero((component == axis) & (iz == self.shape[2] - 1)) for axis in range(3)]
        return top, [flat[index] for index in top]

    def _modes(self, axis: int, count: int, parity: int) -> Array:
        every = self.lines[axis].mode_integrals(self.lengths[axis], count)
        return every[parity::2]


def _product(parts: list[dict[str, csr_matrix]], kinds: dict[int, str]) -> csr_matrix:
    """Return the Kronecker product of some matrices of the axes, else of their masses."""
    return reduce(kron, (part[kinds.get(axis, "mass")] for axis, part in enumerate(parts)))


def _solved(stiffness: csr_matrix, right: Array) -> Array:
    """Solve for many right-hand sides with one factorisation."""
    kind = PETSc.IntType
    rows, columns = stiffness.indptr.astype(kind), stiffness.indices.astype(kind)
    matrix = PETSc.Mat().createAIJ(
        stiffness.shape, csr=(rows, columns, stiffness.data), comm=PETSc.COMM_SELF
    )
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("preonly")
    conditioner = solver.pc
    conditioner.setType("cholesky")
    conditioner.setFactorSolverType("mumps")
    set_up(solver)
    solution = np.zeros_like(right, order="F")
    dense = [
        PETSc.Mat().createDense(right.shape, array=array, comm=matrix.comm)
        for array in (right, solution)
    ]
    conditioner.getFactorMatrix().matSolve(*dense)
    for part in (*dense, conditioner, solver, matrix):  # PETSc would keep what Python drops
        part.destroy()
    return solution
