"""A quarter of a block, in which even and odd modes of pressure are solved for separately.

The two vertical planes of symmetry divide the block into quarters. Under a pressure that is even
along an axis, the displacement component along that axis is odd along it, and the other components
are even; under an odd pressure it is the other way round.

Theory: section 6 of ``demos/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import bmat, csr_matrix, kron

from geometry.materials import Material
from macro.block import Sides
from macro.compliance.elements import Division, Line, mode_integrals
from macro.linear_solvers.direct import set_up

Array = NDArray[np.float64]
Parity = tuple[int, int]
"""Parity of a pressure along x and along y: 0 even, 1 odd."""

_NEGLIGIBLE = 1e-13
"""Share of the largest entry below which an entry is the rounding error of a zero integral."""


class Response(NamedTuple):
    """Response of the top to modes of pressure: integrals over the top of modes times fields.

    Fields are those of a mode of pressure of mean square 1 MPa². The shape is (k, l, m, n): k and l
    count the modes of the field's parity, m and n those of the pressure's. The parity of the shear
    strain is the opposite one along both axes.

    Attributes:
        normal: Displacements downwards [mm³/MPa].
        xx: Strains along x [mm²/MPa].
        yy: Strains along y [mm²/MPa].
        xy: Shear strains ε_xy, half the change of the angle [mm²/MPa].
        growth: Derivative of ``normal`` with respect to the height of the block [mm²/MPa].
    """

    normal: Array
    xx: Array
    yy: Array
    xy: Array
    growth: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Quarter:
    """The quarter of a block at x and y beyond the middle of its top, clamped at the bottom.

    Args:
        division: Its elements.
        lengths: Sides (Lx, Ly) of the top [mm].
        material: Elastic constants.
        sides: Support of the block's sides.
        parity: Parity of the pressures.
    """

    division: Division
    lengths: tuple[float, float]
    material: Material
    sides: Sides
    parity: Parity

    def response(self, count: int) -> Response:
        """Return the displacements and strains of the top by the modes of the parity.

        Args:
            count: Modes K along a side, even and odd together.
        """
        free = np.concatenate([part.ravel() for part in self._free])
        top, place = self._top
        x, y = ([self._modes(component, axis, count) for component in range(3)] for axis in (0, 1))
        loads = np.kron(x[2], y[2])[:, place[2]].T
        right = np.zeros((int(free.sum()), loads.shape[1]), order="F")
        right[top[2]] = -loads
        solved = _solved(self._stiffness()[free][:, free], right)

        def seen(component: int, along_x: Array, along_y: Array) -> Array:
            modes = np.kron(along_x, along_y)[:, place[component]]
            sizes = len(along_x), len(along_y), len(x[2]), len(y[2])
            return np.asarray(4.0 * (modes @ solved[top[component]]).reshape(sizes))

        dx, dy = (
            [self._modes(component, axis, count, slopes=True) for component in (0, 1)]
            for axis in (0, 1)
        )
        normal = -seen(2, x[2], y[2])
        # derivative of the inverse stiffness when all elements grow in proportion
        change = self._stiffness(by_height=True)[free][:, free]
        growth = -4.0 * solved.T @ (change @ solved)
        return Response(
            normal=normal,
            xx=seen(0, dx[0], y[0]),
            yy=seen(1, x[1], dy[1]),
            xy=0.5 * (seen(0, x[0], dy[0]) + seen(1, dx[1], y[1])),
            growth=growth.reshape(normal.shape),
        )

    def _modes(self, component: int, axis: int, count: int, *, slopes: bool = False) -> Array:
        """Return the integrals of modes times a component's shapes, or slopes, along an axis."""
        return mode_integrals(
            self._lines[component][axis], self.lengths[axis], count, slopes=slopes
        )

    @cached_property
    def _lines(self) -> list[tuple[Line, Line, Line]]:
        """Lines along x, y and z by component of the displacement."""
        division, (odd_x, odd_y) = self.division, self.parity
        return [
            (
                replace(division.x, parity=(odd_x + (component == 0)) % 2),
                replace(division.y, parity=(odd_y + (component == 1)) % 2),
                division.z,
            )
            for component in range(3)
        ]

    @cached_property
    def _free(self) -> list[NDArray[np.bool_]]:
        """Which unknowns (ix, iy, iz) no roller constrains, by component."""
        found = [np.ones([len(line.unknowns) for line in lines], bool) for lines in self._lines]
        if self.sides == "roller":
            for axis in (0, 1):
                np.moveaxis(found[axis], axis, 0)[self._lines[axis][axis].end] = False
        return found

    @property
    def _top(self) -> tuple[list[NDArray[np.intp]], list[NDArray[np.intp]]]:
        """Free unknowns with values on the top, by component, and their flat indices (ix, iy)."""
        top, place, before = [], [], 0
        for free in self._free:
            number = before + np.cumsum(free).reshape(free.shape) - 1
            here = free[:, :, self.division.z.end]
            top.append(number[:, :, self.division.z.end][here])
            place.append(np.flatnonzero(here))
            before += int(free.sum())
        return top, place

    def _stiffness(self, *, by_height: bool = False) -> csr_matrix:
        """Return the stiffness of all unknowns (component, ix, iy, iz) [N/mm].

        Args:
            by_height: Return its derivative with respect to the block's height instead [N/mm²].
        """
        lame, shear = self.material.lame
        blocks: list[list[Any]] = [[None] * 3 for _ in range(3)]
        for row in range(3):
            weights = [lame + 2.0 * shear if axis == row else shear for axis in range(3)]
            blocks[row][row] = sum(
                weight * self._product((row, row), (axis, axis), by_height)
                for axis, weight in enumerate(weights)
            )
            for column in range(row):
                first = self._product((row, column), (row, column), by_height)
                second = self._product((row, column), (column, row), by_height)
                blocks[row][column] = lame * first + shear * second
                blocks[column][row] = blocks[row][column].T
        return csr_matrix(bmat(blocks))

    def _product(
        self, components: tuple[int, int], slopes: tuple[int, int], by_height: bool
    ) -> csr_matrix:
        """Return the integrals of products of two components' slopes, or their derivative.

        Args:
            components: Component of the rows, and of the columns.
            slopes: Axis of the slopes of the rows' component, and of the columns'.
            by_height: Return the derivative with respect to the height instead.
        """
        factors = []
        for axis in range(3):
            one, other = (self._sampled[component][axis] for component in components)
            left = one.slopes if axis == slopes[0] else one.values
            right = other.slopes if axis == slopes[1] else other.values
            matrix = (left * one.weights) @ right.T
            large = np.abs(matrix) > _NEGLIGIBLE * np.abs(matrix).max(initial=0.0)
            factors.append(csr_matrix(np.where(large, matrix, 0.0)))
        # with the height λ of elements integrals over z grow as λ, and slopes along z as 1/λ
        share = (1.0 - slopes.count(2)) / -self.division.z.ticks[0] if by_height else 1.0
        return share * reduce(kron, factors)

    @cached_property
    def _sampled(self) -> list[list[Any]]:
        return [[line.sampled(max(line.degrees) + 1) for line in lines] for lines in self._lines]


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
    for part in (*dense, conditioner, solver, matrix):  # PETSc keeps objects that Python drops
        part.destroy()
    return solution
