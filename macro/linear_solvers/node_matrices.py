"""Unknowns of nodes, and distributed matrices of nodes with three each: parts, sums, transfers."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.options import shell
from patchlaw.support import Array, Counts, Indices, InputError, Locals


def node_submatrix(matrix: PETSc.Mat, rows: Indices, columns: Indices) -> csr_matrix:
    """Return the part of a matrix that belongs to some nodes.

    Whole nodes are taken because matrices of PETSc's type ``baij`` give no smaller parts. Those of
    type ``sbaij`` give square ones alone, so that rows and columns had better be the same or few.

    Args:
        matrix: The matrix; of this process alone, or of all ranks.
        rows: Global numbers of the rows' nodes, ascending.
        columns: Global numbers of the columns' nodes, ascending.

    Note:
        Collective over the ranks of the matrix.
    """
    half = matrix.getType().endswith("sbaij")
    nodes = (np.union1d(rows, columns),) * 2 if half else (rows, columns)
    sets = [
        PETSc.IS().createBlock(3, each.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        for each in nodes
    ]
    (part,) = matrix.createSubMatrices(*sets)
    if half:
        part.convert("aij")
    starts, places, entries = part.getValuesCSR()
    part.destroy()
    whole = csr_matrix((entries, places, starts), shape=[3 * len(each) for each in nodes])
    if not half:
        return whole
    down, along = (dofs_of(np.searchsorted(nodes[0], each)) for each in (rows, columns))
    return whole[down][:, along]


def nodes_beside(matrix: PETSc.Mat, nodes: Indices) -> Indices:
    """Return the nodes that have entries in the rows of some nodes, ascending.

    There, and nowhere else, the product of the matrix with random numbers at the nodes is not zero.

    Args:
        matrix: Symmetric, of this process alone.
        nodes: The nodes.
    """
    numbers, product = matrix.createVecs()
    entries = dofs_of(nodes)
    numbers.array[entries] = np.random.default_rng(1).uniform(1.0, 2.0, len(entries))
    matrix.mult(numbers, product)
    beside = np.flatnonzero(product.array_r.reshape(-1, 3).any(axis=1))
    for part in (numbers, product):  # PETSc keeps objects that Python drops
        part.destroy()
    return beside


def coupled_nodes(matrix: PETSc.Mat) -> Indices:
    """Return this rank's nodes whose rows have entries in columns of other ranks, ascending.

    There, and nowhere else, the product of the matrix with random numbers differs from the
    product of the rank's own part with them.

    Args:
        matrix: The matrix of all ranks.

    Returns:
        Local numbers, shape (n,).

    Note:
        Collective.
    """
    local = matrix.getDiagonalBlock()
    numbers, whole = matrix.createVecs()
    part, alone = local.createVecs()
    part.array[:] = np.random.default_rng(1).standard_normal(part.local_size)
    numbers.array[:] = part.array_r
    matrix.mult(numbers, whole)
    local.mult(part, alone)
    differs = (whole.array_r != alone.array_r).reshape(-1, 3)
    return np.flatnonzero(differs.any(axis=1))


def free_unknowns(conditions: Sequence[Any], like: PETSc.Vec) -> PETSc.Vec:
    """Return 1 for free degrees of freedom and 0 for those that Dirichlet conditions constrain.

    Args:
        conditions: The conditions.
        like: A vector of these degrees of freedom, which becomes the result.
    """
    like.set(1.0)
    for condition in conditions:
        dofs, _ = condition.dof_indices()
        like.array[dofs[dofs < like.local_size]] = 0.0
    return like


def dofs_of(nodes: Indices) -> Indices:
    """Return the three unknowns of every node, shape (3 n,)."""
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def distributed(
    rows: csr_matrix, columns: int, comm: PETSc.Comm, block_size: int | None = None
) -> PETSc.Mat:
    """Return a matrix from the rows of every rank.

    Args:
        rows: This rank's rows; columns are numbered through all ranks.
        columns: Number of columns that this rank owns.
        comm: Communicator of the matrix.
        block_size: PETSc's block size of the matrix; None: none.

    Note:
        Collective.
    """
    pattern = (part.astype(PETSc.IntType) for part in (rows.indptr, rows.indices))
    size = ((rows.shape[0], None), (columns, None))
    return PETSc.Mat().createAIJ(size, bsize=block_size, csr=(*pattern, rows.data), comm=comm)


def joined(blocks: Sequence[Sequence[PETSc.Mat | None]]) -> PETSc.Mat:
    """Return a matrix of blocks, each rank's rows and columns of all of them one after another.

    Args:
        blocks: Rows of distributed matrices; None for a block of zeros.

    Note:
        Collective.
    """
    parts = [[part and part.convert("aij", PETSc.Mat()) for part in row] for row in blocks]
    nest = PETSc.Mat().createNest(parts)
    matrix = nest.convert("aij", PETSc.Mat())
    for part in (nest, *(part for row in parts for part in row if part)):
        part.destroy()  # PETSc keeps objects that Python drops
    return matrix


def joined_diagonal(parts: Sequence[PETSc.Mat]) -> PETSc.Mat:
    """Return the block diagonal matrix of some matrices, see `joined`; collective."""
    count = range(len(parts))
    if len(parts) == 1:  # a nest of one fails on several ranks
        return parts[0].convert("aij", PETSc.Mat())
    return joined([[one if i == k else None for k in count] for i, one in enumerate(parts)])


def for_displacements(
    weights: csr_matrix, stay: Indices, free: PETSc.Vec, *, blocks: bool = False
) -> tuple[PETSc.Mat, PETSc.Vec]:
    """Interpolate all three components of displacements, constrained unknowns apart.

    Args:
        weights: Weights of all coarse nodes, numbered rank after rank, in this rank's nodes.
        stay: This rank's nodes that are its coarse nodes.
        free: 1 for unknowns that are free, 0 for constrained ones.
        blocks: Whether the matrix has PETSc's block size 3, which products with it inherit.

    Returns:
        The matrix, and ``free`` of the coarse unknowns.

    Note:
        Collective.
    """
    count = weights.shape[0]
    rows = weights[np.repeat(np.arange(count), 3)]
    component = np.repeat(np.tile(np.arange(3), count), np.diff(rows.indptr))
    rows.indices = 3 * rows.indices + component
    matrix = distributed(rows, 3 * len(stay), free.comm, 3 if blocks else None)
    coarse = matrix.createVecRight()
    same = dofs_of(stay)
    coarse.array[:] = free.array_r[same]
    matrix.diagonalScale(free, coarse)
    fixed = np.flatnonzero(coarse.array_r == 0.0)
    if len(fixed):
        first_row, first_column = matrix.getOwnershipRange()[0], coarse.getOwnershipRange()[0]
        matrix.setValuesIJV(
            np.arange(len(fixed) + 1, dtype=PETSc.IntType),
            (fixed + first_column).astype(PETSc.IntType),
            np.ones(len(fixed)),
            rowmap=(same[fixed] + first_row).astype(PETSc.IntType),
        )
    matrix.assemble()
    return matrix, coarse


def springs_at(points: PETSc.Mat, slope: Array) -> PETSc.Mat:
    """Return the stiffness Bᵀ C B of springs at points.

    Args:
        points: B, rows of weighted basis functions, k for every point [mm²].
        slope: C of this rank's points, shape (n, k, k); or its diagonal, shape (n k,) [N/mm⁵].

    Note:
        Collective.
    """
    if slope.ndim == 1:
        scale, scaled = points.createVecLeft(), points.copy()
        scale.array[:] = slope
        scaled.diagonalScale(scale)
        used = (scale, scaled)
    else:
        count, width = slope.shape[:2]
        place = np.arange(width * count).reshape(count, 1, width).repeat(width, axis=1).ravel()
        starts = width * np.arange(width * count + 1)
        rows = csr_matrix((slope.ravel(), place, starts), shape=2 * (width * count,))
        rows.indices += points.getOwnershipRange()[0]
        coupling = distributed(rows, width * count, points.comm)
        scaled = coupling.matMult(points)
        used = (coupling, scaled)
    springs = points.transposeMatMult(scaled)
    for part in used:  # PETSc keeps objects that Python drops
        part.destroy()
    return springs


class Stiffened:
    """The sum K + S of the stiffness of a body, or of several, and that of springs at few nodes.

    Args:
        stiffness: K, symmetric positive definite; products alone are asked of it.
        parts: The bodies' own stiffnesses, the diagonal blocks of K.
        springs: S, of type ``aij``; between the nodes of one body only where K has entries.

    Attributes:
        springs: S.
        product: The sum as a PETSc matrix without entries; this object must be kept as long as it.

    Note:
        Every method is collective.
    """

    def __init__(
        self, stiffness: PETSc.Mat, parts: Sequence[PETSc.Mat], springs: PETSc.Mat
    ) -> None:
        self._stiffness, self._parts, self.springs = stiffness, parts, springs
        self.product = shell(stiffness, self)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product y with x; PETSc calls this."""
        self._stiffness.mult(x, y)
        self.springs.multAdd(x, y, y)

    def assembled(self) -> PETSc.Mat:
        """Return the sum with entries, which takes as much memory as K."""
        return with_springs(self._parts, self.springs)

    def block_diagonal(self, size: int = 3) -> PETSc.Mat:
        """Return the blocks of the nodes, of a row for each component, a matrix without others."""
        blocks = np.concatenate([diagonal_blocks(part, size) for part in self._parts])
        starts, columns, entries = self.springs.getDiagonalBlock().getValuesCSR()
        rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        own = rows // size == columns // size
        rows, columns = rows[own], columns[own]
        blocks[rows // size, rows % size, columns % size] += entries[own]
        return block_diagonal(blocks, self.springs.comm)


def diagonal_blocks(matrix: PETSc.Mat, size: int = 3) -> Array:
    """Return the blocks on the diagonal of a matrix, of this rank's nodes, shape (n, size, size).

    Args:
        matrix: Of type ``aij``, ``baij`` or, of size 3, ``sbaij``; positive definite blocks.
        size: Components of a node, the matrix's block size.

    Note:
        Collective.
    """
    if not matrix.getType().endswith("sbaij"):
        return np.linalg.inv(np.reshape(matrix.invertBlockDiagonal(), (-1, size, size)))
    own = matrix.getDiagonalBlock()
    starts, _ = own.getRowIJ(compressed=True)
    entries = ctypes.POINTER(ctypes.c_double)()
    compat.call("MatSeqSBAIJGetArray", ctypes.c_void_p(own.handle), ctypes.byref(entries))
    if not len(starts) or not starts[-1]:
        return np.zeros((0, 3, 3))
    blocks = np.ctypeslib.as_array(entries, (int(starts[-1]), 3, 3))[starts[:-1]]
    compat.call("MatSeqSBAIJRestoreArray", ctypes.c_void_p(own.handle), ctypes.byref(entries))
    return np.asarray(blocks)


def block_diagonal(blocks: Array, comm: PETSc.Comm) -> PETSc.Mat:
    """Return the matrix of blocks on the diagonal, of type ``baij``.

    Args:
        blocks: Those of this rank's nodes, shape (n, k, k).
        comm: Communicator of the matrix.

    Note:
        Collective.
    """
    count, width = blocks.shape[:2]
    first = comm.tompi4py().exscan(count) or 0
    starts, columns = np.arange(count + 1), first + np.arange(count)
    csr = (starts.astype(PETSc.IntType), columns.astype(PETSc.IntType), blocks.ravel())
    size = (width * count, None)
    return PETSc.Mat().createBAIJ((size, size), width, csr=csr, comm=comm)


def with_springs(parts: Sequence[PETSc.Mat], springs: PETSc.Mat) -> PETSc.Mat:
    """Return the sum of stiffnesses of bodies, as diagonal blocks, and of springs.

    Args:
        parts: The stiffnesses. The rigid body modes of a single one go along.
        springs: Between the nodes of one body only where its stiffness has entries.

    Note:
        Collective.
    """
    structure = PETSc.Mat.Structure
    if len(parts) == 1:
        half = parts[0].getType().endswith("sbaij")
        matrix = parts[0].convert("aij", PETSc.Mat()) if half else parts[0].copy()
        matrix.axpy(1.0, springs, structure=structure.SUBSET_NONZERO_PATTERN)
        matrix.setNearNullSpace(parts[0].getNearNullSpace())
        return matrix
    matrix = joined_diagonal(parts)
    matrix.setBlockSizes(3, 3)  # algebraic multigrid asks for the components of a node
    matrix.axpy(1.0, springs, structure=structure.DIFFERENT_NONZERO_PATTERN)
    return matrix


def assemble_symmetric(form: Any, conditions: Sequence[Any], space: Any) -> PETSc.Mat:
    """Assemble a symmetric form of displacements, of which half is stored.

    PETSc's type ``sbaij`` holds the 3 × 3 blocks on and above the diagonal. Beside ``baij`` it
    takes half the memory, and its products 0.65 of the time.

    Args:
        form: Compiled form.
        conditions: Dirichlet conditions.
        space: Vector space of the form.

    Note:
        Collective.
    """
    nodes, comm = space.dofmap.index_map, space.mesh.comm
    every = np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32)
    numbers = nodes.local_to_global(every).astype(PETSc.IntType)
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes(((3 * nodes.size_local, 3 * nodes.size_global),) * 2)
    matrix.setType("sbaij")
    matrix.setBlockSize(3)
    matrix.setPreallocationNNZ(_blocks_above(space, numbers))
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    matrix.setOption(PETSc.Mat.Option.IGNORE_LOWER_TRIANGULAR, True)
    local = PETSc.LGMap().create(numbers, bsize=3, comm=comm)
    matrix.setLGMap(local, local)
    compat.assemble_matrix_into(matrix, form, conditions)
    return matrix


def _blocks_above(space: Any, numbers: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return how many nodes from itself on this rank's nodes share cells with.

    Args:
        space: Vector space.
        numbers: Global numbers of this rank's nodes, those of ghosts included.

    Returns:
        For every node of this rank, of this rank's nodes and of those of higher ranks.
    """
    cells = compat.cell_nodes(space)[: space.mesh.topology.index_map(3).size_local]
    own = space.dofmap.index_map.size_local
    starts = np.arange(0, cells.size + 1, cells.shape[1] or 1, dtype=PETSc.IntType)
    pattern = starts[: len(cells) + 1], numbers[cells.ravel()], np.ones(cells.size)
    members = PETSc.Mat().createAIJ(
        ((len(cells), None), (own, None)), csr=pattern, comm=space.mesh.comm
    )
    shared = members.transposeMatMult(members)
    members.destroy()
    first, last = shared.getOwnershipRange()
    starts, columns, _ = shared.getValuesCSR()
    shared.destroy()
    row = np.repeat(np.arange(first, last), np.diff(starts))
    above = columns >= row
    counts = [
        np.bincount(row[part] - first, minlength=own).astype(PETSc.IntType)
        for part in (above & (columns < last), above & (columns >= last))
    ]
    return counts[0], counts[1]


@dataclass(frozen=True, eq=False)
class Displacements:
    """Where the displacements of nodes stand among the unknowns of a problem.

    Args:
        space: Vector space of the displacements alone, Lagrange of degree 1 or 2.
        whole: The space of all unknowns, or the displacements' part of it.
        taken: Unknown of this rank of each of its displacements, ghosts included, (nodes d,);
            None: they are all unknowns.
        axisymmetric: Whether a plane mesh is turned about x = 0.
    """

    space: Any
    whole: Any
    taken: Locals | None = None
    axisymmetric: bool = False

    @classmethod
    def of(cls, space: Any, *, axisymmetric: bool = False) -> Displacements:
        """Return the displacements of a space, or of a part ``W.sub(i)`` of a mixed one.

        Args:
            space: The space.
            axisymmetric: As above.

        Raises:
            InputError: On all ranks, when these are no displacements as contact takes them.
        """
        whole, taken = space, None
        if space.component() and space.num_sub_spaces:
            space, taken = compat.collapsed(space)
        fits = compat.holds_displacements(space)
        if not (fits and compat.cell_vertices(space.mesh).shape[1] in (3, 4, 6, 8, 9, 10, 27)):
            raise InputError(
                "the cells do not fit" if fits else "the space of the displacements does not fit",
                value=str(whole.ufl_element()),
                allowed="a continuous Lagrange space of degree 1 or 2, or a part W.sub(i) of a "
                "mixed space, with three components on tetrahedra or hexahedra, or two on "
                "triangles or quadrilaterals, of first or second order",
            )
        if axisymmetric:
            _check_radii(space.mesh)
        return cls(space, whole, taken, axisymmetric)

    @property
    def dimension(self) -> int:
        """Components of a displacement, 2 or 3."""
        return int(self.space.dofmap.index_map_bs)

    @property
    def owned(self) -> int:
        """Number of unknowns that this rank owns."""
        return int(self.whole.dofmap.index_map.size_local * self.whole.dofmap.index_map_bs)

    @property
    def total(self) -> int:
        """Number of unknowns of all ranks."""
        return int(self.whole.dofmap.index_map.size_global * self.whole.dofmap.index_map_bs)

    @cached_property
    def own(self) -> tuple[Locals, Locals]:
        """Unknowns that this rank owns and that are displacements, and the axis of each.

        Whoever owns a displacement in its own space may not own the unknown.
        """
        nodes = self.space.dofmap.index_map
        count = (nodes.size_local + nodes.num_ghosts) * self.dimension
        axis, every = np.arange(count, dtype=np.int32) % self.dimension, self.taken
        every = np.arange(count, dtype=np.int32) if every is None else every
        return every[every < self.owned], axis[every < self.owned]

    def columns(self, nodes: Locals) -> Counts:
        """Return the global unknowns of this rank's nodes along x, y, z; −1: none, shape (…, 3)."""
        dimension = self.dimension
        local = dimension * nodes[..., None] + np.arange(dimension, dtype=np.int32)
        local = local if self.taken is None else self.taken[local]
        known, size = self.whole.dofmap.index_map, self.whole.dofmap.index_map_bs
        place, part = np.divmod(local, size)
        found = np.full((*nodes.shape, 3), -1, dtype=np.int64)
        found[..., :dimension] = part + size * known.local_to_global(
            place.ravel().astype(np.int32)
        ).reshape(place.shape)
        return found


def _check_radii(mesh: Any) -> None:
    """Refuse what is no half of a section through an axis of symmetry at x = 0.

    Raises:
        InputError: On all ranks.
    """
    least = mesh.comm.allreduce(float(mesh.geometry.x[:, 0].min(initial=np.inf)), min)
    largest = mesh.comm.allreduce(float(np.abs(mesh.geometry.x[:, 0]).max(initial=0.0)), max)
    if mesh.topology.dim != 2 or least < -1e-9 * largest:
        raise InputError(
            "the mesh is no half of a section through the axis x = 0",
            key="axisymmetric",
            value=f"{mesh.topology.dim} dimensions, x from {least:.6g} mm",
            allowed="a plane mesh whose x is the radius",
        )
