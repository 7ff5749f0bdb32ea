"""Which linear solver a body gets: by its mesh, its element and its largest Poisson's ratio.

Towards ν = ½ the resistance to volume changes grows beside that to shear as
λ/μ = 2ν/(1 − 2ν). What smooths one kind of error on a grid, or interpolates it to the next grid,
does not smooth the other, and iterations grow with (1 − 2ν)^-½. On lattices a Chebyshev smoother of
higher degree over a wider range of eigenvalues compensates for that up to ν = 0.495. Beyond, and on
other meshes, a factorisation is used where it fits into memory. Iterations to 1e-8, measured from
10⁴ to 2·10⁵ unknowns on lattices, and to 5·10⁶ on other meshes:

    lattices        7 to 10 with tetrahedra; at ν = 0.49 13 (Q1), 14 (P1), 16 to 23 (Q2)
    other meshes    16 to 22 up to ν = 0.3 on cells of even lengths, 26 to 29 at 0.45; with their
                    slow modes solved for (`slow_modes`) 15 to 16 on flat tetrahedra, 29 to 47 on
                    flat hexahedra, whose iterations cost half of what hypre's do; 31 to 36 on a
                    quadratic brake pad held at the rim of its piston, 15 to 20 where the grid of
                    its vertices is factorised
    factorised      1 to 2; 10⁵ unknowns take 4 to 6 s and 1 GB, once

Without a lattice hypre's BoomerAMG coarsens linear elements.
Coarse unknowns are some of the finer ones (PMIS or HMIS), and the others are interpolated from at
most four of them ("extended+i"; De Sterck, Falgout, Nolting & Yang 2008, doi 10.1002/nla.544), each
displacement component from its own kind. Two settings of twelve were best on brake pads, flanges,
rings and L shapes of 3·10⁴ to 6·10⁵ unknowns, with moduli up to 10⁴ : 1.

Only hypre's grids are taken for linear elements. A cycle takes one step of Jacobi's method by the
blocks of the nodes before and after, whose products need half of a symmetric matrix: 3 in an
iteration, with that of conjugate gradients. Springs of laws come onto every grid as they are, so
that no other matrix and no other grids are made for them. Beside hypre's sweeps on its own copy,
eight load steps of a pad of 132,000 unknowns took 0.69 of the CPU time with 1.27 times the
iterations, and the whole 0.76 of the memory; single solutions 0.47 to 0.8 of the time on pads and
flanges from 50,000 unknowns on, 1.1 on flat hexahedra, whose set-up took 0.6. A second step, two on
coarser grids, W cycles, other thresholds and longer interpolation took 1.02 to 1.5 times as long.

On quadratic elements the matrix of the vertices is factorised; beyond `FACTORISED_VERTICES` it has
hypre's cycle, whose sweeps go both ways each time. The vertices are an eighth of the unknowns, so
that sweeping one way saves little there: a pad of 308,000 unknowns took 48 iterations with it, 10.8
s of CPU time, in place of 34 and 8.6 s.

Tetrahedra coarsen node by node, by the norms of the 3 × 3 blocks, which takes half the time and
three quarters of the memory of coarsening by component. Hexahedra coarsen by component with a high
threshold: norms of blocks do not tell the directions of flat cells apart, which took 128 to 255
iterations.

A PETSc without hypre, such as that of dolfinx's wheels, has smoothed aggregation (GAMG) instead,
with the rigid body modes of the nodes and the smoother of `ALGEBRAIC_DEFAULTS`. Iterations to 1e-8
on the same bodies, those of the tests, with slow modes solved for:

    pads, flange, L of linear elements      hypre 15 to 29, smoothed aggregation 8 to 14
    their quadratic elements                      13 to 17                       13 to 17
    rings of cells 8 times as long as high        15 to 38                       13 to 20
    the same, 20 times                            41 to 47                       24

Its set-up takes more CPU time, and under laws much stiffer than the elements a linear solve takes
more iterations, 11 to 13. It is used on request, too (``-patchlaw_pc_type
gamg``). The figures are of PETSc 3.18; 3.25 differs by two iterations at most.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy import sparse
from scipy.linalg import block_diag

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.multigrid import algebraic_grids, coarser_grids
from patchlaw.macro.linear_solvers.node_matrices import (
    Stiffened,
    block_diagonal,
    diagonal_blocks,
    for_displacements,
    joined_diagonal,
    with_springs,
)
from patchlaw.macro.linear_solvers.options import (
    ALGEBRAIC_DEFAULTS,
    DIRECT_DEFAULTS,
    PREFIX,
    SMOOTHED,
    has_hypre,
    has_mumps,
    largest_eigenvalue,
)
from patchlaw.macro.linear_solvers.solvers import (
    COARSEST,
    MARGINS,
    CoarserGrid,
    LinearSolver,
    linear_solver,
    pointwise,
)
from patchlaw.support import Array, Locals

COMPRESSIBLE = 0.45
"""Largest Poisson's ratio at which multigrid is used without a lattice."""

SOFT = 0.3
"""Largest Poisson's ratio at which pointwise smoothing is used for hexahedra. Beyond it, stronger
smoothing takes half the iterations in the same time."""

STIFF = 0.495
"""Largest Poisson's ratio at which multigrid is used on lattices, with stronger smoothing."""

FACTORISED = 100_000
"""Largest number of unknowns for which a factorisation replaces multigrid when nearly
incompressible. Larger systems keep multigrid and take twice the iterations for every factor of four
in 1 − 2ν."""

FACTORISED_VERTICES = 120_000
"""Largest number of the vertices' unknowns whose matrix is factorised in place of a multigrid, on
quadratic elements. Brake pads of 308,000 and 762,000 unknowns then take 17 and 15 iterations to
1e-8 in place of 34 and 35, 3.7 and 8.4 s of CPU time in place of 8.6 and 38, and 2.5 and 7.6 s of
set-up in place of 4.4 and 18, on one rank; the larger one 1.7 kB an unknown at its peak in place of
1.2. Factors of 12,000 and 28,000 unknowns are 0.7 and 3.9 Gflop once, 188 and 283 entries an
unknown. Flanges of 26,000 and 152,000 unknowns take the same in both ways. Half of it holds for
hexahedra, whose factors are denser: a cube with 38,900 took 12 iterations in place of 17, 5.3 s of
set-up in place of 7.7, and 1.3 kB an unknown of the body in place of 0.75, with factors of 33 Gflop
and 687 entries an unknown; work grows with the square. One of tetrahedra with 20,200 took 7."""

_FACTORISED_GRID: Mapping[str, object] = {**DIRECT_DEFAULTS, "mat_mumps_icntl_14": MARGINS[1]}
"""With room for pivots on several ranks, see `MARGINS`."""

_DEGREES = (4, 8)
"""Smallest and largest degree of the smoothing polynomial."""

_SMALLEST = 0.005
"""Smallest eigenvalue that is smoothed, relative to the largest."""

_ESTIMATES = 20
"""Iterations that estimate the largest eigenvalue. PETSc's 10 miss up to 8 % of it, and with these
wide ranges a smoother that misses more than 5 % is not definite; 20 miss 1 %."""


_BOTH: Mapping[str, object] = {
    "pc_type": "hypre",
    "pc_hypre_type": "boomeramg",
    "pc_hypre_boomeramg_interp_type": "ext+i",
    "pc_hypre_boomeramg_P_max": 4,
}

_BY_NODES: Mapping[str, object] = {
    **_BOTH,
    "pc_hypre_boomeramg_nodal_coarsen": 4,
    "pc_hypre_boomeramg_coarsen_type": "PMIS",
    "pc_hypre_boomeramg_strong_threshold": 0.25,
}

_BY_COMPONENTS: Mapping[str, object] = {
    **_BOTH,
    "pc_hypre_boomeramg_coarsen_type": "HMIS",
    "pc_hypre_boomeramg_strong_threshold": 0.7,
}

_USERS_RANGE = f"{SMOOTHED}eigenvalues", f"{SMOOTHED}esteig"
"""PETSc's options by which users state where the smoother smooths."""

_SMOOTHING: Mapping[str, object] = {
    "pc_mg_galerkin": "none",
    f"{SMOOTHED}esteig": "0,0.05,0,1.1",
    "mg_levels_esteig_ksp_max_it": 30,
    "mg_levels_pc_type": "pbjacobi",
    "mg_coarse_ksp_type": "preonly",
}
"""Chebyshev smoothing with the nodes' blocks on all nodes. A third step saved one or two iterations
and Gauss–Seidel three, but both took more time. PETSc's 10 iterations missed 12 % of the largest
eigenvalue of a brake pad, so that the smoother was not definite; 20 found it."""

_SMOOTHING_ONCE: Mapping[str, object] = {
    **_SMOOTHING,
    "mg_levels_ksp_max_it": 1,
    f"{SMOOTHED}esteig": "0,0.2,0,1.1",
    "mg_levels_esteig_ksp_max_it": 15,
}
"""One step on hypre's grids. It is definite while the largest eigenvalue is at most 1.3 times what
15 iterations find, and springs at few points stand apart, which few iterations find."""

_FLAT = 4.0
"""Longest over shortest distance of a cell's vertices beyond which it counts as flat or slender."""

_SMOOTHING_FLAT: Mapping[str, object] = {
    "mg_levels_ksp_max_it": 6,
    f"{SMOOTHED}esteig": "0,0.02,0,1.1",
}
"""Smoothing where most cells are flat: 31 iterations instead of 54 to 58 where they are eight times
as long as high. The vertices do not see bending within a cell, which is soft there."""


@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """What is known of a body's matrix with its preconditioner, which serves with springs too.

    Args:
        modes: This rank's rows of the modes that its solver solves for; None: not looked for.
        largest: Largest eigenvalue on all nodes of quadratic elements; 0 where none was estimated.
    """

    modes: Array | None
    largest: float

    @classmethod
    def of(cls, solver: LinearSolver) -> Spectrum:
        """Return what a body's solver found; collective."""
        two_grids = solver.method == "mg" and solver.pc.getMGLevels() == 2
        smoother = solver.pc.getMGSmoother(1) if two_grids else None
        return cls(solver.modes, largest_eigenvalue(smoother) if smoother else 0.0)


def takes_rigid_body_modes() -> bool:
    """Tell whether a matrix may get a preconditioner that reads its near-nullspace."""
    user = PETSc.Options(PREFIX)
    return not has_hypre() or user.hasName("pc_type") or user.hasName("mg_coarse_pc_type")


def body_solver(
    bodies: Sequence[Any], matrix: PETSc.Mat, stiffened: Stiffened | None = None
) -> LinearSolver:
    """Return a solver for the stiffness of a body, or of those that springs join.

    Laws stiffer than two bodies let their faces move together. A preconditioner that knows one body
    at a time damps that motion little, however well it knows the laws: only one multigrid of both
    bodies, with the laws between them, does. PETSc's options of the user win.

    Args:
        bodies: The `ElasticBody`, or several that springs join.
        matrix: Their stiffness, block diagonal; may be without entries where there are springs.
        stiffened: The same with springs, which the preconditioner is to know; it must be kept as
            long as the solver. None: no springs.

    Note:
        Collective.
    """
    lattice = bodies[0].lattice if stiffened is None else None
    ratio, mesh = max(body.poisson_ratio for body in bodies), _hardest(bodies)
    requested = PETSc.Options(PREFIX).getString("pc_type", "")
    most = COMPRESSIBLE if lattice is None else STIFF
    if not requested and ratio > most and matrix.getSize()[0] <= FACTORISED:
        whole = None if stiffened is None else stiffened.assembled()
        return linear_solver(matrix, preconditioner=DIRECT_DEFAULTS, whole=whole)
    if lattice is not None and requested in ("", "mg"):
        smoother = smoothing(ratio, hexahedral=compat.is_hexahedral(mesh))
        return linear_solver(matrix, coarser_grids(lattice, matrix, bodies[0].free), smoother)
    modes = None if stiffened is None else _slow_modes(bodies)
    if any(body.degree == 2 for body in bodies) and lattice is None and requested in ("", "mg"):
        if stiffened is None:
            finest = matrix, block_diagonal(diagonal_blocks(matrix), matrix.comm)
        else:
            finest = stiffened.product, stiffened.block_diagonal()
        grid = _vertex_grid(bodies, None if stiffened is None else stiffened.springs)
        options = quadratic_options(mesh, grid.matrix)
        known = bodies[0].spectrum.largest if stiffened is not None and len(bodies) == 1 else 0.0
        solver = linear_solver(matrix, [grid], options, finest=finest)
        if known and not any(PETSc.Options(PREFIX).hasName(key) for key in _USERS_RANGE):
            _smooth_from(solver.pc.getMGSmoother(1), options, known)
        if _has_slow_modes(solver):
            solver.solve_slow_modes(solver.pc.getMGCoarseSolve(), modes=modes)
        return solver
    ours = None if requested else _on_algebraic_grids(bodies, matrix, stiffened)
    if ours and ours[1]:
        solver = linear_solver(matrix, ours[1], _SMOOTHING_ONCE, finest=ours[0])
    else:
        whole = None if stiffened is None else stiffened.assembled()
        solver = linear_solver(matrix, preconditioner=algebraic_options(mesh), whole=whole)
    if not requested:
        solver.solve_slow_modes(solver, stiffened.product if stiffened else None, modes)
    return solver


def _on_algebraic_grids(
    bodies: Sequence[Any], matrix: PETSc.Mat, stiffened: Stiffened | None
) -> tuple[tuple[PETSc.Mat, PETSc.Mat], Sequence[CoarserGrid]]:
    """Return what the finest grid smooths, with its blocks, and the coarser grids.

    Those of one body serve whatever springs are on it; several that springs join have their own.
    """
    if stiffened is None:
        blocks = block_diagonal(diagonal_blocks(matrix), matrix.comm)
        return (matrix, blocks), bodies[0].coarser_grids
    finest = stiffened.product, stiffened.block_diagonal()
    if len(bodies) == 1:
        return finest, _with_springs(bodies[0].coarser_grids, stiffened.springs)
    for body in bodies:
        body.__dict__.pop("coarser_grids", None)
    return finest, grids_of(stiffened.assembled(), _hardest(bodies))


def grids_of(matrix: PETSc.Mat, mesh: Any) -> list[CoarserGrid]:
    """Return the coarser grids of the stiffness of linear elements; the matrix itself, of few.

    There are none without hypre's BoomerAMG, and where it makes none, as of one layer of flat
    cells whose other side is held.

    Args:
        matrix: The stiffness; of type ``aij`` it is destroyed.
        mesh: dolfinx mesh of tetrahedra or hexahedra.

    Note:
        Collective.
    """
    if matrix.getSize()[0] <= COARSEST:
        return [CoarserGrid(_identity(matrix), pointwise(matrix))]
    method = PETSc.Options(PREFIX).getString("pc_hypre_type", "boomeramg")
    usable = has_hypre() and method == "boomeramg"
    return algebraic_grids(matrix, algebraic_options(mesh)) if usable else []


def _with_springs(grids: Sequence[CoarserGrid], springs: PETSc.Mat) -> list[CoarserGrid]:
    """Return coarser grids with springs on the finest one; matrices stay what they are."""
    stiffer = []
    for grid in grids:
        springs = springs.ptap(grid.interpolation)
        size = 1 if grid.blocks is None else grid.blocks.getBlockSize()
        there = Stiffened(grid.matrix, [grid.matrix], springs)
        if grid.blocks is None:
            stiffer.append(CoarserGrid(grid.interpolation, there.assembled()))
        else:
            blocks = there.block_diagonal(size)
            stiffer.append(CoarserGrid(grid.interpolation, there.product, blocks, there))
    return stiffer


def algebraic_options(mesh: Any) -> Mapping[str, object]:
    """Return PETSc's options of algebraic multigrid for linear elements.

    Args:
        mesh: dolfinx mesh of tetrahedra or hexahedra.

    Returns:
        Those of hypre, or of smoothed aggregation where PETSc was built without it.
    """
    if not has_hypre():
        return ALGEBRAIC_DEFAULTS
    return _BY_COMPONENTS if compat.is_hexahedral(mesh) else _BY_NODES


def quadratic_options(mesh: Any, vertices: PETSc.Mat) -> Mapping[str, object]:
    """Return PETSc's options of the grids of all nodes and of the vertices.

    Args:
        mesh: dolfinx mesh of tetrahedra or hexahedra.
        vertices: The matrix on the grid of the vertices.

    Note:
        Collective.
    """
    most = FACTORISED_VERTICES // (2 if compat.is_hexahedral(mesh) else 1)
    small = vertices.getSize()[0] <= most and has_mumps()
    coarse = _FACTORISED_GRID if small else algebraic_options(mesh)
    flat = _SMOOTHING_FLAT if _mostly_flat(mesh) else {}
    return {**_SMOOTHING, **flat, **{f"mg_coarse_{key}": coarse[key] for key in coarse}}


def _has_slow_modes(solver: LinearSolver) -> bool:
    """Tell whether the grid of the vertices has a multigrid of ours, which may miss some modes.

    Args:
        solver: Made with `quadratic_options`.
    """
    requested = PETSc.Options(PREFIX).hasName("mg_coarse_pc_type")
    coarse = solver.pc.getMGCoarseSolve().pc.getType()
    return not requested and coarse != _FACTORISED_GRID["pc_type"]


def _smooth_from(smoother: PETSc.KSP, options: Mapping[str, object], known: float) -> None:
    """Let a smoother of K + S reach from the largest eigenvalue of K, if it has found no larger.

    Preconditioned by blocks of its diagonal, the sum of two matrices has no larger eigenvalue than
    the larger of theirs. That of springs is less than that of elements unless few points are much
    stiffer than all beside them, as where two laws meet. Then it stands apart, and few iterations
    find it. To estimate that of K, all of them, took two thirds of a set-up.

    Args:
        smoother: The smoother, set up.
        options: Its options.
        known: Largest eigenvalue of K, preconditioned like that.
    """
    found = largest_eigenvalue(smoother)
    if found:  # else the user gave the eigenvalues
        low, high = (float(part) for part in str(options[f"{SMOOTHED}esteig"]).split(",")[1::2])
        ends = (ctypes.c_double(share * max(found, known)) for share in (high, low))
        compat.call("KSPChebyshevSetEigenvalues", ctypes.c_void_p(smoother.handle), *ends)


def _mostly_flat(mesh: Any) -> bool:
    """Return whether most cells are flat or slender."""
    vertices = len(compat.lagrange_points(mesh.topology.cell_name(), 1))
    cells = compat.cell_vertices(mesh)[: mesh.topology.index_map(3).size_local, :vertices]
    least, most = np.full(len(cells), np.inf), np.zeros(len(cells))
    for one, other in combinations(range(vertices), 2):
        edge = mesh.geometry.x[cells[:, one]] - mesh.geometry.x[cells[:, other]]
        square = np.einsum("ck,ck->c", edge, edge)
        least, most = np.minimum(least, square), np.maximum(most, square)
    flat = int(np.sum(most > _FLAT**2 * least))
    return bool(2 * mesh.comm.allreduce(flat) > mesh.comm.allreduce(len(cells)))


def smoothing(poisson_ratio: float, *, hexahedral: bool) -> Mapping[str, object]:
    """Return PETSc's options of the smoother on a lattice's grids.

    Args:
        poisson_ratio: Poisson's ratio of the block.
        hexahedral: Whether its cells are hexahedra.
    """
    if hexahedral and poisson_ratio <= SOFT:
        return {}
    stiffer = 1.0 / (1.0 - 2.0 * poisson_ratio)
    degree = min(max(round(math.sqrt(stiffer)), _DEGREES[0]), _DEGREES[1])
    smallest = min(max(0.5 / stiffer, _SMALLEST), 0.05)
    return {
        "mg_levels_pc_type": "pbjacobi",
        "mg_levels_ksp_max_it": degree,
        "mg_levels_esteig_ksp_max_it": _ESTIMATES,
        "mg_levels_ksp_chebyshev_esteig": f"0,{smallest:g},0,1.05",
    }


def _vertex_grid(bodies: Sequence[Any], springs: PETSc.Mat | None) -> CoarserGrid:
    """Return the one coarser grid where displacements are of degree 2: that of the vertices.

    Args:
        bodies: The bodies.
        springs: Stiffness besides that of the bodies, such as that of contact laws; it joins them.

    Note:
        Collective.
    """
    matrices = [body.linear.stiffness if body.degree == 2 else body.stiffness for body in bodies]
    transfer = from_vertices(bodies)
    if springs is None:
        return CoarserGrid(transfer, pointwise(matrices[0]))
    there = springs.ptap(transfer)
    grid = CoarserGrid(transfer, with_springs(matrices, there))
    there.destroy()
    return grid


def vertex_transfer(space: Any, linear: Any, free: PETSc.Vec) -> PETSc.Mat:
    """Return the interpolation from the vertices to all nodes, constrained unknowns apart.

    Args:
        space: Vector space of degree 2.
        linear: That of degree 1 on the same mesh, whose nodes the vertices are.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Note:
        Collective.
    """
    owned, vertices = (of.dofmap.index_map.size_local for of in (space, linear))
    near, shares = (part[:owned] for part in _vertices_near(space, linear))
    used = shares > 0.0
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    numbers = linear.dofmap.index_map.local_to_global(near[used].astype(np.int32))
    total = linear.dofmap.index_map.size_global
    weights = sparse.csr_matrix((shares[used], numbers, starts), (owned, total))
    weights.sort_indices()
    own = np.flatnonzero(shares.max(axis=1) == 1.0)  # both spaces own a vertex on the same rank
    stay = np.empty(vertices, dtype=np.intp)
    stay[near[own, shares[own].argmax(axis=1)]] = own
    matrix, _ = for_displacements(weights, stay, free, blocks=True)
    return matrix


def _vertices_near(space: Any, linear: Any) -> tuple[Locals, Array]:
    """Return the vertices of a cell of every node, and their shares in the node.

    Returns:
        Nodes of the linear space that are the vertices, and the values there of its basis, shape
        (n, vertices of a cell), for the nodes of this rank's cells.
    """
    cell, nodes = space.mesh.topology.cell_name(), space.dofmap.index_map
    values = compat.lagrange_values(cell, 1, compat.lagrange_points(cell, 2))
    corner = np.count_nonzero(values, axis=1) == 1
    values[corner] = np.rint(values[corner])
    cells = compat.cell_nodes(space)
    place = np.zeros((2, nodes.size_local + nodes.num_ghosts), dtype=np.int32)
    place[:, cells] = np.indices(cells.shape, dtype=np.int32)  # a cell of every node
    return compat.cell_nodes(linear)[place[0]], values[place[1]]


def from_vertices(bodies: Sequence[Any], kept: Sequence[Any] = ()) -> PETSc.Mat:
    """Return the interpolation of the displacements of bodies from those of their vertices.

    Args:
        bodies: The bodies; those on linear elements keep their unknowns.
        kept: Others that keep them.

    Note:
        Collective.
    """
    transfers = [
        _identity(body.stiffness) if body.degree == 1 or body in kept else body.from_vertices
        for body in bodies
    ]
    return transfers[0] if len(bodies) == 1 else joined_diagonal(transfers)


def _identity(matrix: PETSc.Mat) -> PETSc.Mat:
    """Return the identity of a matrix's sizes; collective."""
    same = PETSc.Mat().createAIJ(matrix.getSizes(), nnz=1, comm=matrix.comm)
    same.setDiagonal(matrix.createVecRight())  # inserts the entries
    same.shift(1.0)
    return same


def _slow_modes(bodies: Sequence[Any]) -> Array | None:
    """Return this rank's rows of the modes that the bodies' own solvers solve for.

    None where the grid of a body was small enough for a factorisation, and that of all is not.
    """
    modes = []
    for body in bodies:
        own = body.linear if body.degree == 2 else body
        modes.append(body.spectrum.modes)
        if modes[-1] is None:
            if body.degree == 2 and body.lattice is None:
                return None
            modes[-1] = np.zeros((own.owned_dofs, 0))
    return np.asarray(block_diag(*modes))


def _hardest(bodies: Sequence[Any]) -> Any:
    """Return the mesh whose multigrid serves all: one of hexahedra, if there is one."""
    return max((body.mesh.mesh for body in bodies), key=compat.is_hexahedral)
