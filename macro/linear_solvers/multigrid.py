"""Coarser grids of multigrid: of rectangular lattices, and those that hypre makes of a matrix.

Grids of a lattice coarsen where its planes are close (see `coarsenings`). Displacements are
interpolated trilinearly in the flat lattice, also on rough blocks, and the coarser matrices are
Galerkin's products of the true matrix. A coarse node is one of the finer grid's nodes, and lives on
the same rank. Products of blocks are made by every rank from the rows it owns, read in place
through PETSc's C interface, as petsc4py only hands out copies.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from patchlaw.geometry import BlockShape
from patchlaw.macro import compat
from patchlaw.macro.compat import call
from patchlaw.macro.linear_solvers.node_matrices import (
    block_diagonal,
    diagonal_blocks,
    distributed,
    for_displacements,
)
from patchlaw.macro.linear_solvers.options import PREFIX, default_options
from patchlaw.macro.linear_solvers.solvers import COARSEST, CoarserGrid, as_hypres, pointwise
from patchlaw.macro.mesh.block import BlockMesh
from patchlaw.support import Array, Flags, Indices

_NODES_AT_ONCE = 20_000
"""Nodes whose rows are multiplied at a time: 30 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class BlockRows:
    """A rank's rows of a matrix of 3 × 3 blocks, node by node.

    Every block stands as a column of its 9 entries, in PETSc's order: down its columns.

    Args:
        own: Blocks in columns of nodes that this rank owns, shape (9 n, n) with blocks (9, 1).
        ghost: Blocks in columns of other ranks' nodes, shape (9 n, ghosts).
        ghosts: Global numbers of these nodes, ascending.
    """

    own: sparse.bsr_matrix
    ghost: sparse.bsr_matrix
    ghosts: Indices


def galerkin(
    matrix: PETSc.Mat, weights: PETSc.Mat, free: PETSc.Vec, coarse_free: PETSc.Vec
) -> PETSc.Mat:
    """Return the coarser matrix (W ⊗ I₃)ᵀ A (W ⊗ I₃), constrained unknowns apart.

    One product of scalar weights serves all nine entries of a block. PETSc's own product does not
    use the blocks: on several ranks it takes four times the work, or 1 kB of memory per unknown.

    Args:
        matrix: A, symmetric, of PETSc's type ``baij``; unit rows and columns where constrained.
        weights: W, of nodes by coarse nodes.
        free: 1 for unknowns that are free, 0 for constrained ones.
        coarse_free: The same for the coarser grid.

    Returns:
        The matrix, of the same type, with unit rows and columns where constrained.

    Note:
        Collective.
    """
    parts = []
    with block_rows(matrix) as rows:
        weights_seen, coarse = _weights_of(rows, weights)
        own = weights_seen[: rows.own.shape[1]]
        units = -_diagonal_blocks(free.array_r == 0.0)  # are no part of the product
        terms = ((rows.own, own), (rows.ghost, weights_seen[rows.own.shape[1] :]), (units, own))
        for blocks, right in terms:
            parts += list(_products(own, blocks, right))
    coarser = _sum_of_parts(parts, coarse, weights)
    first = coarser.getOwnershipRange()[0]
    constrained = first + np.flatnonzero(coarse_free.array_r == 0.0)
    coarser.zeroRowsColumns(constrained.astype(PETSc.IntType), 1.0)
    return coarser


def _weights_of(rows: BlockRows, weights: PETSc.Mat) -> tuple[sparse.csr_matrix, Indices]:
    """Return the weights of own nodes, then of ghosts, and the coarse nodes that they are of."""
    first, last = weights.getOwnershipRange()
    seen = np.concatenate([np.arange(first, last), rows.ghosts])
    wanted = np.sort(seen).astype(PETSc.IntType)
    at = PETSc.IS().createGeneral(wanted, comm=PETSc.COMM_SELF)
    every = PETSc.IS().createStride(weights.getSize()[1], 0, 1, comm=PETSc.COMM_SELF)
    part = weights.createSubMatrices(at, every)[0]
    starts, columns, values = part.getValuesCSR()
    part.destroy()
    coarse, places = np.unique(columns, return_inverse=True)
    table = sparse.csr_matrix((values, places, starts), shape=(len(wanted), len(coarse)))
    return table[np.searchsorted(wanted, seen)], coarse


def _diagonal_blocks(flags: Flags) -> sparse.bsr_matrix:
    """Return flags of a rank's unknowns on the diagonals of blocks as in `BlockRows`."""
    nodes = flags.reshape(-1, 3)
    some = nodes.any(axis=1)
    blocks = np.einsum("na,ab->nab", nodes[some].astype(float), np.eye(3)).reshape(-1, 9, 1)
    starts = np.concatenate([[0], np.cumsum(some)])
    parts = (blocks, np.flatnonzero(some), starts)
    return sparse.bsr_matrix(parts, shape=(9 * len(nodes), len(nodes)))


def _products(
    left: sparse.csr_matrix, blocks: sparse.bsr_matrix, right: sparse.csr_matrix
) -> Iterator[sparse.bsr_matrix]:
    """Multiply from both sides, some rows of blocks at a time, without those that are empty.

    Yields:
        Parts of the product, blocks (1, 9) whose entries stand as in `BlockRows`.
    """
    filled = np.flatnonzero(np.diff(blocks.indptr))
    right = right.tobsr((1, 1))
    for nodes in np.array_split(filled, -(-len(filled) // _NODES_AT_ONCE) or 1):
        if not len(nodes):
            return
        first, last = nodes[0], nodes[-1] + 1
        starts = blocks.indptr[first : last + 1]
        within = slice(starts[0], starts[-1])
        some = (blocks.data[within], blocks.indices[within], starts - starts[0])
        shape = (9 * (last - first), blocks.shape[1])
        half = sparse.bsr_matrix(some, shape=shape, copy=False) @ right
        turned = (half.data.reshape(-1, 1, 9), half.indices, half.indptr)
        half = sparse.bsr_matrix(turned, shape=(last - first, 9 * right.shape[1]))
        yield left[first:last].T.tocsr().tobsr((1, 1)) @ half


def _sum_of_parts(parts: list[sparse.bsr_matrix], coarse: Indices, weights: PETSc.Mat) -> PETSc.Mat:
    """Add parts of the coarser matrix, of all ranks, at the coarse nodes that they are of."""
    owner = np.searchsorted(weights.getOwnershipRangesColumn(), coarse, side="right")
    counted = [weights.createVecRight() for _ in range(2)]
    entries = []
    for part in parts:
        counts = np.diff(part.indptr)
        filled = np.flatnonzero(counts)
        rows, columns = (coarse[at].astype(PETSc.IntType) for at in (filled, part.indices))
        near = owner[part.indices] == np.repeat(owner, counts)
        own = np.add.reduceat(near, part.indptr[filled], dtype=float)
        counted[0].setValues(rows, own, addv=True)
        counted[1].setValues(rows, counts[filled] - own, addv=True)
        starts = np.concatenate([[0], np.cumsum(counts[filled])]).astype(PETSc.IntType)
        entries.append((starts, columns, part.data.ravel(), rows))
    local, size = counted[0].getSizes()
    room = []  # blocks per row in columns of the same rank, and of others
    for vector, most in zip(counted, (local, size - local), strict=True):
        vector.assemble()
        room.append(np.minimum(np.rint(vector.array_r).astype(PETSc.IntType), most))
        vector.destroy()
    matrix = PETSc.Mat().create(weights.comm)
    matrix.setSizes(((3 * local, 3 * size),) * 2)
    matrix.setType("baij")
    matrix.setBlockSize(3)
    matrix.setPreallocationNNZ(tuple(room))
    # ranks without rows do not set this by themselves, and assembly hangs where ranks differ in it
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    matrix.setOption(PETSc.Mat.Option.ROW_ORIENTED, False)
    for starts, columns, values, rows in entries:
        matrix.setValuesBlockedIJV(starts, columns, values, addv=True, rowmap=rows)
    matrix.assemble()
    return matrix


@contextmanager
def block_rows(matrix: PETSc.Mat) -> Iterator[BlockRows]:
    """Yield this rank's rows of a matrix of PETSc's type ``baij`` without copying entries.

    Args:
        matrix: Assembled, block size 3; must not change inside the context.

    Raises:
        PETSc.Error: When the matrix is of another type.
    """
    count = matrix.getLocalSize()[0] // 3
    none = np.zeros(0, dtype=PETSc.IntType)
    own, ghost, ghosts = ctypes.c_void_p(matrix.handle), ctypes.c_void_p(), _pointer(PETSc.IntType)
    if matrix.getType() == "seqbaij":
        with _sequential(own, count) as blocks:
            yield BlockRows(blocks, sparse.bsr_matrix((9 * count, 0), blocksize=(9, 1)), none)
        return
    call("MatMPIBAIJGetSeqBAIJ", own, *map(ctypes.byref, (own, ghost, ghosts)))
    with _sequential(own, count) as first, _sequential(ghost, None) as second:
        numbers = np.ctypeslib.as_array(ghosts, second.shape[1:]) if second.shape[1] else none
        yield BlockRows(first, second, numbers)


@contextmanager
def _sequential(matrix: ctypes.c_void_p, columns: int | None) -> Iterator[sparse.bsr_matrix]:
    """Yield the blocks of a ``seqbaij`` matrix; None takes its number of columns from itself."""
    integer = np.ctypeslib.as_ctypes_type(PETSc.IntType)
    count, width, done = integer(), integer(), ctypes.c_int(0)
    rows, places, entries = map(_pointer, (PETSc.IntType, PETSc.IntType, np.float64))
    pattern = (*map(ctypes.byref, (count, rows, places, done)),)
    call("MatGetLocalSize", matrix, None, ctypes.byref(width))
    call("MatGetRowIJ", matrix, integer(0), 0, 1, *pattern)
    call("MatSeqBAIJGetArray", matrix, ctypes.byref(entries))
    try:
        starts = np.ctypeslib.as_array(rows, (count.value + 1,))
        size = int(starts[-1])
        values = np.ctypeslib.as_array(entries, (size, 9, 1)) if size else np.empty((0, 9, 1))
        indices = np.ctypeslib.as_array(places, (size,)) if size else np.empty(0, starts.dtype)
        shape = (9 * count.value, width.value // 3 if columns is None else columns)
        yield sparse.bsr_matrix((values, indices, starts), shape=shape)
    finally:
        call("MatSeqBAIJRestoreArray", matrix, ctypes.byref(entries))
        call("MatRestoreRowIJ", matrix, integer(0), 0, 1, *pattern)


def _pointer(number: Any) -> Any:
    return ctypes.POINTER(np.ctypeslib.as_ctypes_type(number))()


Kept = tuple[Indices, Indices, Indices]

_SLACK = 1.5
"""Longest merged interval relative to the target length; 1.2 and 2 took more iterations."""

_LEAST = 1.2
"""Smallest factor by which a coarser grid has fewer nodes; less would not repay its cost."""

_CORNERS = np.indices((2, 2, 2)).reshape(3, 8).T


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The planes of a lattice across one axis.

    Args:
        ticks: Their coordinates, ascending, shape (n,) [mm].
        middle: Whether a plane holds the middle nodes of elements of degree 2, shape (n,). It
            cannot be kept without both of its neighbours.
    """

    ticks: Array
    middle: Flags

    @classmethod
    def of_elements(cls, ticks: Array, degree: int) -> Lines:
        """Return the planes through the nodes of elements of degree 1 or 2 between grid planes."""
        count = degree * (len(ticks) - 1) + 1
        finer = np.interp(np.arange(count) / degree, np.arange(len(ticks)), ticks)
        return cls(finer, np.arange(count) % degree > 0)

    def __len__(self) -> int:
        return len(self.ticks)

    def only(self, kept: Indices) -> Lines:
        """Return some of the planes."""
        return Lines(self.ticks[kept], self.middle[kept])

    def merged(self, longest: float) -> Indices:
        """Return the planes that are kept when pairs of intervals merge, from the last one down.

        Args:
            longest: Largest length of a merged pair [mm].
        """
        kept = [len(self) - 1]
        while kept[-1] > 0:
            end = kept[-1]
            pair = (
                end > 1
                and self.ticks[end] - self.ticks[end - 2] <= longest
                and not (self.middle[end] or self.middle[end - 2])
            )
            kept.append(end - (2 if pair else 1))
        return np.array(kept[::-1])

    def shares(self, kept: Indices) -> tuple[Indices, Array]:
        """Interpolate linearly from some planes to all.

        Args:
            kept: Indices of the planes to interpolate from.

        Returns:
            For every plane the last kept plane at or before it, as an index into ``kept``, and the
            weight of the next kept plane, exactly 0 on a kept plane; shapes (n,).
        """
        before = np.searchsorted(kept, np.arange(len(self)), side="right") - 1
        after = np.minimum(before + 1, len(kept) - 1)
        start, end = self.ticks[kept[before]], self.ticks[kept[after]]
        length = np.where(after > before, end - start, 1.0)
        return before, (self.ticks - start) / length


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """The rectangular lattice that the nodes of a space form.

    Args:
        grid: The planes across x, y and z.
        nodes: Indices of the planes that meet at each of this rank's nodes, shape (n, 3).
    """

    grid: Sequence[Lines]
    nodes: Indices


@dataclass(frozen=True, slots=True, eq=False)
class Transfer:
    """From a grid to the next finer one.

    Args:
        weights: Interpolation of nodes from coarse nodes.
        interpolation: Interpolation of unknowns from coarse unknowns, constrained ones apart.
        free: 1 for unknowns of the finer grid that are free, 0 for constrained ones.
        coarse_free: The same for the coarser grid.
    """

    weights: PETSc.Mat
    interpolation: PETSc.Mat
    free: PETSc.Vec
    coarse_free: PETSc.Vec


def lattice_of(space: Any, mesh: BlockMesh) -> Lattice | None:
    """Return the lattice of a Lagrange space's nodes, or None where the mesh has none.

    Args:
        space: Space of degree 1 or 2 on the mesh.
        mesh: The block's mesh; its nodes may have moved.
    """
    shape = mesh.shape
    if mesh.planes is None or not isinstance(shape, BlockShape):
        return None
    degree, cell = shape.degree, mesh.mesh.topology.cell_name()
    corners = compat.lagrange_values(cell, 1, compat.lagrange_points(cell, degree))
    places = np.einsum(
        "nv,cvk->cnk", degree * corners, mesh.planes[compat.cell_vertices(mesh.mesh)]
    )
    nodes = space.dofmap.index_map
    planes = np.zeros((nodes.size_local + nodes.num_ghosts, 3), dtype=np.intp)
    planes[compat.cell_nodes(space)] = np.rint(places)
    grid = [Lines.of_elements(ticks, degree) for ticks in shape.ticks]
    return Lattice(grid, planes[: nodes.size_local])


def coarser_grids(lattice: Lattice, matrix: PETSc.Mat, free: PETSc.Vec) -> list[CoarserGrid]:
    """Return the interpolations and matrices of every grid but the finest, finest grid first.

    Args:
        lattice: Nodes of the finest grid.
        matrix: Its matrix, of PETSc's type ``baij``, with unit rows and columns where
            constrained.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Note:
        Collective.
    """
    coarser = []
    for step in transfers(lattice, free):
        matrix = galerkin(matrix, step.weights, step.free, step.coarse_free)
        step.weights.destroy()  # PETSc would keep what several ranks drop
        coarser.append(CoarserGrid(step.interpolation, matrix))
    return coarser


def transfers(lattice: Lattice, free: PETSc.Vec) -> Iterator[Transfer]:
    """Yield the transfers from every grid but the finest to the next finer one.

    Constrained unknowns are separate on every grid: they neither contribute to others nor take
    from others, and every coarser matrix has unit rows for them.

    Args:
        lattice: Nodes of the finest grid.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Yields:
        Finest grid first.

    Note:
        Collective.
    """
    grid, nodes = lattice.grid, lattice.nodes
    for kept in coarsenings(grid):
        rows, stay = _node_weights(grid, kept, nodes, free.comm)
        weights = distributed(rows, len(stay), free.comm)
        interpolation, coarse = for_displacements(rows, stay, free)
        yield Transfer(weights, interpolation, free, coarse)
        nodes = np.stack([np.searchsorted(of, nodes[stay, k]) for k, of in enumerate(kept)], axis=1)
        grid, free = [lines.only(of) for lines, of in zip(grid, kept, strict=True)], coarse


def _node_weights(
    grid: Sequence[Lines], kept: Kept, nodes: Indices, comm: PETSc.Comm
) -> tuple[sparse.csr_matrix, Indices]:
    """Return trilinear weights (nodes of this rank, all coarse nodes), and the kept nodes."""
    shares = [lines.shares(of) for lines, of in zip(grid, kept, strict=True)]
    before = np.stack([share[0][nodes[:, k]] for k, share in enumerate(shares)], axis=1)
    ahead = np.stack([share[1][nodes[:, k]] for k, share in enumerate(shares)], axis=1)
    weights = np.prod(np.where(_CORNERS, ahead[:, None], 1.0 - ahead[:, None]), axis=2)
    used = weights > 0.0
    size = [len(of) for of in kept]
    corners = np.ravel_multi_index(tuple((before[:, None] + _CORNERS)[used].T), size)
    stay = np.flatnonzero((ahead == 0.0).all(axis=1))
    # coarse nodes are numbered rank after rank; PETSc distributes the table of their numbers
    own = np.ravel_multi_index(tuple(before[stay].T), size).astype(PETSc.IntType)
    directory = PETSc.AO().createMemoryScalable(own, comm=comm)
    wanted, back = np.unique(corners, return_inverse=True)
    columns = directory.app2petsc(wanted.astype(PETSc.IntType))[back]
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    rows = sparse.csr_matrix((weights[used], columns, starts), (len(nodes), int(np.prod(size))))
    rows.sort_indices()
    return rows, stay


def coarsenings(grid: Sequence[Lines], coarsest: int = COARSEST) -> list[Kept]:
    """Coarsen a lattice where its planes are close, until few unknowns are left.

    Unknowns are coupled most strongly along the shortest edges, and pointwise smoothing removes
    errors along those edges only. So a target length doubles from grid to grid, and intervals merge
    only where they are shorter than it: flat cells become thick first, and graded layers become
    even. After that all cells grow in all directions.

    Args:
        grid: The planes across x, y and z.
        coarsest: Number of unknowns, three per node, at which coarsening ends.

    Returns:
        The kept planes of every grid but the coarsest. There is at least one coarser grid unless
        all nodes are corners of the block.
    """
    coarsened: list[Kept] = []
    longest = _SLACK * (1.0 + 1e-6) * min(float(np.diff(lines.ticks).min()) for lines in grid)
    while any(len(lines) > 2 for lines in grid) and (not coarsened or 3 * _size(grid) > coarsest):
        coarser, kept = list(grid), [np.arange(len(lines)) for lines in grid]
        while _size(coarser) * _LEAST > _size(grid) and any(len(lines) > 2 for lines in coarser):
            longest *= 2.0
            stay = [lines.merged(longest) for lines in coarser]
            kept = [of[which] for of, which in zip(kept, stay, strict=True)]
            coarser = [lines.only(which) for lines, which in zip(coarser, stay, strict=True)]
        coarsened.append((kept[0], kept[1], kept[2]))
        grid = coarser
    return coarsened


def _size(grid: Sequence[Lines]) -> int:
    return int(np.prod([len(lines) for lines in grid]))


def algebraic_grids(matrix: PETSc.Mat, options: Mapping[str, object]) -> list[CoarserGrid]:
    """Return the coarser grids that hypre makes of a matrix, finest first.

    hypre's hierarchy is taken over without its copy of the matrix, and without its cycle: products
    with blocks of 3 × 3, half of them stored, move a third of the bytes of hypre's sweeps.

    Args:
        matrix: Symmetric positive definite.
        options: Those of hypre; PETSc's options of the user win.

    Note:
        Collective.
    """
    maker, whole = PETSc.PC().create(matrix.comm), as_hypres(pointwise(matrix))
    maker.setOptionsPrefix(PREFIX)
    maker.setOperators(whole)
    with default_options(PREFIX, options):
        maker.setFromOptions()
        maker.setUp()
        by_nodes = PETSc.Options(PREFIX).getInt("pc_hypre_boomeramg_nodal_coarsen", 0) > 0
    parts = [_taken(maker, f"PCGet{kind}") for kind in ("Interpolations", "CoarseOperators")]
    for one in (maker, whole):
        one.destroy()
    sizes = [coarse.getSize()[0] for coarse in parts[1]]
    last = next((k for k, size in enumerate(sizes) if size <= COARSEST), len(sizes) - 1)
    for one in (part for kind in parts for part in kind[last + 1 :]):
        one.destroy()  # PETSc keeps objects that Python drops
    grids: list[CoarserGrid] = []
    for transfer, coarse in zip(*(kind[: last + 1] for kind in parts), strict=True):
        matrix = _half(coarse) if by_nodes and len(grids) < last else coarse
        blocks = diagonal_blocks(matrix, 3 if by_nodes else 1) if len(grids) < last else None
        grids.append(
            CoarserGrid(
                transfer, matrix, None if blocks is None else block_diagonal(blocks, matrix.comm)
            )
        )
    return grids


def _half(matrix: PETSc.Mat) -> PETSc.Mat:
    """Return the blocks of 3 × 3 on and above the diagonal of a matrix, and destroy it."""
    matrix.setBlockSize(3)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    half = matrix.convert("sbaij", PETSc.Mat())
    matrix.destroy()
    return half


def _taken(maker: PETSc.PC, function: str) -> list[PETSc.Mat]:
    """Return the matrices that a function of PETSc takes out of hypre, of finer grids first."""
    count, array = ctypes.c_int(), ctypes.POINTER(ctypes.c_void_p)()
    compat.call(function, ctypes.c_void_p(maker.handle), ctypes.byref(count), ctypes.byref(array))
    found = []
    for k in reversed(range(count.value - 1)):
        matrix, given = PETSc.Mat().create(maker.comm), ctypes.c_void_p(array[k])
        compat.call("MatHeaderReplace", ctypes.c_void_p(matrix.handle), ctypes.byref(given))
        found.append(matrix)
    return found
