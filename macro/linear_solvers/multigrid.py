"""Coarser grids of multigrid: of rectangular lattices, and those that hypre makes of a matrix.

Grids of a lattice coarsen where its planes are close (see `coarsenings`). Displacements are
interpolated trilinearly in the flat lattice, also on rough blocks, and the coarser matrices are
Galerkin's products of the true matrix. A coarse node is one of the finer grid's nodes, and lives on
the same rank.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from patchlaw.geometry import BlockShape
from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.node_matrices import (
    block_diagonal,
    diagonal_blocks,
    for_displacements,
)
from patchlaw.macro.linear_solvers.options import PREFIX, default_options
from patchlaw.macro.linear_solvers.solvers import COARSEST, CoarserGrid, as_hypres, pointwise
from patchlaw.macro.mesh.block import BlockMesh
from patchlaw.support import Array, Flags, Indices

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
    coarser, finer = list[CoarserGrid](), pointwise(matrix)  # PETSc multiplies no blocks
    for interpolation in transfers(lattice, free):
        product = finer.ptap(interpolation)
        product.setBlockSize(3)
        coarser.append(CoarserGrid(interpolation, product.convert("baij", PETSc.Mat())))
        finer.destroy()  # PETSc would keep what several ranks drop
        finer = product
    finer.destroy()
    return coarser


def transfers(lattice: Lattice, free: PETSc.Vec) -> Iterator[PETSc.Mat]:
    """Yield the interpolations of unknowns from every grid but the finest to the next finer one.

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
        interpolation, coarse = for_displacements(rows, stay, free)
        yield interpolation
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
