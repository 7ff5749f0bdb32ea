"""Solves for the smooth correction of a block, once for every rectangle of a grid of loads.

u_c has no load on the top; it makes up for what the half-space gets wrong on the other faces:
u_c = −u_hs on the clamped bottom, and the traction −σ_hs n on free sides (on rollers −u_hs along
the normal).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_array

from geometry.collective import together
from geometry.errors import InputError
from geometry.meshes import BlockShape
from geometry.partition import Partition
from geometry.smooth_shape import SmoothShape, smooth_shape
from macro.block import Block, Sides
from macro.correction import Correction
from macro.elasticity import Material
from macro.factorisation import set_up
from macro.mesh import block_mesh
from macro.side_loads import sides as side_planes

Array = NDArray[np.float64]

_BLOCK = 1024  # points at which the half-space is evaluated together


class HalfSpaceField(Protocol):
    """Displacements and stresses in the depth of a half-space by unit pressures on rectangles."""

    def displacements(self, x: Array, y: Array, depth: Array, loads: Partition, /) -> Array:
        """Return displacements along x, y and into the depth, shape (3, n, M) [mm/MPa]."""
        ...

    def stresses(self, x: Array, y: Array, depth: Array, loads: Partition, /) -> Array:
        """Return σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy, z into the depth, shape (6, n, M)."""
        ...


def make_correction(
    shape: BlockShape,
    material: Material,
    sides: Sides,
    loads: Partition,
    half_space: HalfSpaceField,
    comm: Any,
) -> Correction:
    """Solve for the smooth field of every rectangle.

    Quadratic hexahedra, finest at the block's edges, with as many nodes as trilinear ones in the
    block's cells (see `SmoothShape`). Every rank meshes and factorises the whole block and takes
    its share of the rectangles, so that the result does not depend on the number of ranks.

    Args:
        shape: The block, its element aside; its cells set the resolution.
        material: Elastic constants.
        sides: Support of the block's sides.
        loads: Rectangles under pressure, on the interface.
        half_space: The half-space of the same material.
        comm: MPI communicator.

    Raises:
        InputError: When a rectangle reaches beyond the block's top, or the cells are more than
            one factorisation should take.

    Note:
        Collective. With cells of 20 × 20 × 12 and 8 × 8 loads on a free cube, row sums of the
        compliance are 0.02 % and a corner's entry 0.08 % from their limits, after 0.7 s; entries of
        16 × 16 loads at the edges, halved there, up to 2 % of the corner's. Fine cells spend most
        of their time on the factorisation, many loads on the sides' tractions.
    """
    _check_place(shape, loads)
    smooth = smooth_shape(shape)
    mine = np.arange(comm.rank, loads.count, comm.size)

    def solved() -> Array:
        block = Block(block_mesh(smooth, MPI.COMM_SELF, "lattice"), material, sides)
        return _Solver(block, smooth, half_space, loads).top(mine)

    # one rank's factors may not fit in its memory
    parts = comm.allgather(together(comm, solved))
    x, y, _ = smooth.nodes
    values = np.empty((len(x), len(y), loads.count))
    for rank, part in enumerate(parts):
        values[:, :, rank :: comm.size] = part
    return Correction(loads=loads, x=x, y=y, values=values)


class _Solver:
    """The block of one rank, with what the half-space leaves on its faces."""

    def __init__(
        self, block: Block, shape: SmoothShape, half_space: HalfSpaceField, loads: Partition
    ) -> None:
        self._block, self._shape, self._field, self._loads = block, shape, half_space, loads
        # node of the mesh at every place (i, j, k) of the grid
        places = block.space.tabulate_dof_coordinates()
        index = tuple(
            np.searchsorted(0.5 * (planes[1:] + planes[:-1]), column)
            for planes, column in zip(shape.nodes, places.T, strict=True)
        )
        self._node = np.empty([len(planes) for planes in shape.nodes], dtype=np.intp)
        self._node[index] = np.arange(len(places))

    def top(self, mine: NDArray[np.intp]) -> Array:
        """Return the downward displacement of the top's nodes by some of the rectangles."""
        if not mine.size:
            return np.empty((*self._node.shape[:2], 0))
        known = self._known(mine)
        fixed = ~np.isnan(known[:, 0])
        known = np.where(fixed[:, None], known, 0.0)
        stiffness = self._block.unsupported_stiffness
        rows, columns, entries = stiffness.getValuesCSR()
        right = self._tractions(mine)
        right -= csr_array((entries, columns, rows), shape=stiffness.size) @ known
        right[fixed] = known[fixed]
        stiffness.zeroRowsColumns(np.flatnonzero(fixed).astype(PETSc.IntType), diag=1.0)
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        solved = _solved(stiffness, right)
        return -solved[3 * self._node[:, :, -1] + 2]

    def _known(self, mine: NDArray[np.intp]) -> Array:
        """Return the displacements that the supports need, NaN where free, (dofs, rectangles)."""
        known = np.full((self._block.dofs, len(mine)), np.nan)
        if self._block.sides == "roller":
            for axis, end in ((0, 0), (0, -1), (1, 0), (1, -1)):
                index: list[Any] = [slice(None)] * 3
                index[axis] = end
                nodes = self._node[tuple(index)].ravel()
                known[3 * nodes + axis] = -self._displacements(nodes, mine)[axis]
        bottom = self._node[:, :, 0].ravel()
        for axis, values in enumerate(self._displacements(bottom, mine)):
            known[3 * bottom + axis] = -values
        return known

    def _displacements(self, nodes: NDArray[np.intp], mine: NDArray[np.intp]) -> Array:
        """Return the half-space's displacements of nodes along the block's axes."""
        x, y, z = self._block.space.tabulate_dof_coordinates()[nodes].T
        depth = np.maximum(-z, 0.0)
        found = _in_parts(self._field.displacements, x, y, depth, self._loads)[:, :, mine]
        return found * np.array([1.0, 1.0, -1.0])[:, None, None]

    def _tractions(self, mine: NDArray[np.intp]) -> Array:
        """Return the nodal forces of the tractions −σ_hs n on the sides [N]."""
        forces = np.zeros((self._block.dofs, len(mine)))
        for side in side_planes(self._shape, self._loads):
            stress = _in_parts(self._field.stresses, *side.points, self._loads)[:, :, mine]
            # σ_xx σ_xy σ_xz, or σ_xy σ_yy σ_yz; the depth runs against z
            rows = ((0, 5, 4), (5, 1, 3))[side.axis]
            nodes = self._node[tuple(np.moveaxis(side.nodes, 2, 0))].ravel()
            for axis, row in enumerate(rows):
                sign = -side.outward if axis < 2 else side.outward
                forces[3 * nodes + axis] += sign * side.nodal(stress[row]).reshape(len(nodes), -1)
        return forces


def _in_parts(evaluate: Any, x: Array, y: Array, depth: Array, loads: Partition) -> Array:
    """Evaluate the half-space at some points at a time, which bounds the memory."""
    cuts = np.arange(_BLOCK, len(x), _BLOCK)
    pieces = zip(*(np.split(part, cuts) for part in (x, y, depth)), strict=True)
    return np.concatenate([evaluate(*piece, loads) for piece in pieces], axis=1)


def _solved(matrix: PETSc.Mat, right: Array) -> Array:
    """Solve for many right-hand sides with one factorisation, and give the matrix back."""
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("preonly")
    conditioner = solver.pc
    conditioner.setType("cholesky")
    conditioner.setFactorSolverType("mumps")
    set_up(solver)
    right = np.asfortranarray(right)
    solution = np.zeros_like(right, order="F")
    dense = [
        PETSc.Mat().createDense(right.shape, array=array, comm=matrix.comm)
        for array in (right, solution)
    ]
    conditioner.getFactorMatrix().matSolve(*dense)
    for part in (*dense, conditioner, solver, matrix):  # PETSc would keep what Python drops
        part.destroy()
    return solution


def _check_place(shape: BlockShape, loads: Partition) -> None:
    for axis, borders in enumerate((loads.borders_x, loads.borders_y)):
        low, high = -shape.margin, shape.interface[axis] + shape.margin
        slack = 1e-9 * (high - low)
        if borders[0] < low - slack or borders[-1] > high + slack:
            raise InputError(
                f"the loads reach beyond the block along {'xy'[axis]}",
                value=(float(borders[0]), float(borders[-1])),
                allowed=f"{low} … {high} mm",
            )
