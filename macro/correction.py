"""What a finite block adds to the half-space: a smooth elastic field, condensed once.

Under pressures on its top the block's displacement is u = u_hs + u_c. The half-space's part u_hs
is known in closed form, with all that is singular below the loads. The rest u_c has no load on the
top; it makes up for what the half-space gets wrong on the other faces: u_c = −u_hs on the clamped
bottom, and the traction −σ_hs n on free sides (on rollers −u_hs along the normal). It is smooth,
so that coarse elements resolve it, and linear in the pressures: one solution for each rectangle of
a grid of loads serves every load step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.interpolate import RectBivariateSpline, make_interp_spline
from scipy.sparse import csr_array

from geometry.errors import InputError
from geometry.meshes import BlockShape
from geometry.patches import PatchGrid
from macro.block import Block, Sides
from macro.elasticity import Material
from macro.mesh import block_mesh
from macro.side_loads import sides as side_planes

Array = NDArray[np.float64]

_BLOCK = 1024  # points at which the half-space is evaluated together


class HalfSpaceField(Protocol):
    """Displacements and stresses in the depth of a half-space by unit pressures on rectangles."""

    def displacements(self, x: Array, y: Array, depth: Array, loads: PatchGrid, /) -> Array:
        """Return displacements along x, y and into the depth, shape (3, n, M) [mm/MPa]."""
        ...

    def stresses(self, x: Array, y: Array, depth: Array, loads: PatchGrid, /) -> Array:
        """Return σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy, z into the depth, shape (6, n, M)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Sag:
    """Downward displacement of the block's top by u_c, a smooth function of the place.

    Args:
        spline: Spline through the nodes.
    """

    spline: RectBivariateSpline

    def __call__(self, x: Array, y: Array) -> Array:
        """Return it at points; a column of abscissae and a row of ordinates span a grid [mm]."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        if x.ndim == 2 and x.shape[1] == 1 and y.ndim == 1:
            return np.asarray(self.spline(x[:, 0], y))
        x, y = np.broadcast_arrays(x, y)
        return np.asarray(self.spline.ev(x, y))


@dataclass(frozen=True, eq=False)
class Correction:
    """The smooth field u_c at the top of a block, for pressures on a grid of rectangles.

    Args:
        loads: The M rectangles.
        x: Abscissae of the top's nodes, ascending, shape (nx,) [mm].
        y: Their ordinates, shape (ny,) [mm].
        values: Downward displacement of the nodes by unit pressure on each rectangle,
            shape (nx, ny, M) [mm/MPa].
    """

    loads: PatchGrid
    x: Array
    y: Array
    values: Array

    def sag(self, forces: Array) -> Sag:
        """Return the downward displacement by forces on the rectangles, to be added to u_hs.

        Args:
            forces: Forces, uniform on each rectangle, shape (M,) [N].
        """
        nodal = self.values @ (np.asarray(forces, float) / self.loads.area)
        degree = [min(3, len(ticks) - 1) for ticks in (self.x, self.y)]
        return Sag(RectBivariateSpline(self.x, self.y, nodal, kx=degree[0], ky=degree[1]))

    def patch_compliance(self, patches: PatchGrid) -> Array:
        """Return the mean of u_c over patch i by unit pressure on patch j, shape (N, N) [mm/MPa].

        Patches that the rectangles do not divide load them by the area they share. By reciprocity
        the matrix is symmetric; what the mesh leaves is averaged out (see `asymmetry`).

        Args:
            patches: N patches within the loads' rectangle.
        """
        found = self._means(patches)
        return np.asarray(0.5 * (found + found.T))

    @cached_property
    def asymmetry(self) -> float:
        """Largest asymmetry of the compliance of the rectangles, relative to its largest entry."""
        found = self._means(self.loads)
        return float(np.abs(found - found.T).max() / np.abs(found).max())

    def _means(self, patches: PatchGrid) -> Array:
        over_x = _interval_means(self.x, patches.borders_x)
        over_y = _interval_means(self.y, patches.borders_y)
        means = np.einsum("ia,jb,abm->ijm", over_x, over_y, self.values, optimize=True)
        share_x, share_y = (
            _overlaps(getattr(self.loads, borders), getattr(patches, borders))
            for borders in ("borders_x", "borders_y")
        )
        spread = np.einsum("ki,lj->klij", share_x, share_y)
        spread = spread.reshape(self.loads.count, patches.count) / self.loads.area
        return np.asarray(means.reshape(patches.count, -1) @ spread)


def make_correction(
    shape: BlockShape,
    material: Material,
    sides: Sides,
    loads: PatchGrid,
    half_space: HalfSpaceField,
    comm: Any,
) -> Correction:
    """Solve for the smooth field of every rectangle.

    The mesh is that of the block, with trilinear elements. Every rank meshes and factorises it
    and takes its share of the rectangles, so that the result does not depend on their number.

    Args:
        shape: The block and its division.
        material: Elastic constants.
        sides: Support of the block's sides.
        loads: Rectangles under pressure, on the interface.
        half_space: The half-space of the same material.
        comm: MPI communicator.

    Raises:
        InputError: When a rectangle reaches beyond the block's top.

    Note:
        Collective. Time and memory grow with nodes × rectangles and with a sparse factorisation:
        meant for coarse meshes.
    """
    _check_place(shape, loads)
    shape = replace(shape, element="Q1")
    block = Block(block_mesh(shape, MPI.COMM_SELF), material, sides)
    mine = np.arange(comm.rank, loads.count, comm.size)
    parts = comm.allgather(_Solver(block, half_space, loads).top(mine))
    ticks = shape.ticks
    values = np.empty((len(ticks[0]), len(ticks[1]), loads.count))
    for rank, part in enumerate(parts):
        values[:, :, rank :: comm.size] = part
    return Correction(loads=loads, x=ticks[0], y=ticks[1], values=values)


class _Solver:
    """The block of one rank, with what the half-space leaves on its faces."""

    def __init__(self, block: Block, half_space: HalfSpaceField, loads: PatchGrid) -> None:
        self._block, self._field, self._loads = block, half_space, loads
        self._shape = block.mesh.shape
        self._ticks = self._shape.ticks
        # node of the mesh at every place (i, j, k) of the grid
        places = block.space.tabulate_dof_coordinates()
        index = [
            np.searchsorted(0.5 * (ticks[1:] + ticks[:-1]), column)
            for ticks, column in zip(self._ticks, places.T, strict=True)
        ]
        self._node = np.empty([len(ticks) for ticks in self._ticks], dtype=np.intp)
        self._node[tuple(index)] = np.arange(len(places))

    def top(self, mine: NDArray[np.intp]) -> Array:
        """Return the downward displacement of the top's nodes by some of the rectangles."""
        known, traction = self._known(mine), self._tractions(mine)
        fixed = ~np.isnan(known[:, 0]) if mine.size else np.zeros(len(known), bool)
        known = np.where(fixed[:, None], known, 0.0)
        free = self._block.unsupported_stiffness
        rows, columns, entries = free.getValuesCSR()
        right = traction - csr_array((entries, columns, rows), shape=free.size) @ known
        right[fixed] = known[fixed]
        solved = _solved(self._block.stiffness, right)
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


def _in_parts(evaluate: Any, x: Array, y: Array, depth: Array, loads: PatchGrid) -> Array:
    """Evaluate the half-space at some points at a time, which bounds the memory."""
    cuts = np.arange(_BLOCK, len(x), _BLOCK)
    pieces = zip(*(np.split(part, cuts) for part in (x, y, depth)), strict=True)
    return np.concatenate([evaluate(*piece, loads) for piece in pieces], axis=1)


def _solved(matrix: PETSc.Mat, right: Array) -> Array:
    """Solve for many right-hand sides with one factorisation."""
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("preonly")
    factor = solver.getPC()
    factor.setType("cholesky")
    factor.setFactorSolverType("mumps")
    solver.setUp()
    right = np.asfortranarray(right)
    solution = np.zeros_like(right, order="F")
    dense = [
        PETSc.Mat().createDense(right.shape, array=array, comm=matrix.comm)
        for array in (right, solution)
    ]
    factor.getFactorMatrix().matSolve(*dense)
    return solution


def _interval_means(ticks: Array, borders: Array) -> Array:
    """Return the means of the interpolating spline over intervals, per value at the ticks."""
    spline = make_interp_spline(ticks, np.eye(len(ticks)), k=min(3, len(ticks) - 1))
    return np.asarray(np.diff(spline.antiderivative()(borders), axis=0) / np.diff(borders)[:, None])


def _overlaps(ours: Array, theirs: Array) -> Array:
    """Return the lengths that intervals share, shape (ours, theirs) [mm]."""
    upper = np.minimum.outer(ours[1:], theirs[1:])
    return np.maximum(upper - np.maximum.outer(ours[:-1], theirs[:-1]), 0.0)


def _check_place(shape: BlockShape, loads: PatchGrid) -> None:
    for axis, borders in enumerate((loads.borders_x, loads.borders_y)):
        low, high = -shape.margin, shape.interface[axis] + shape.margin
        slack = 1e-9 * (high - low)
        if borders[0] < low - slack or borders[-1] > high + slack:
            raise InputError(
                f"the loads reach beyond the block along {'xy'[axis]}",
                value=(float(borders[0]), float(borders[-1])),
                allowed=f"{low} … {high} mm",
            )
