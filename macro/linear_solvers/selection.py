"""Which linear solver a body gets: by its mesh, its element and its largest Poisson's ratio.

Towards ν = ½ the resistance to volume changes grows beside that to shear as
λ/μ = 2ν/(1 − 2ν). What smooths one kind of error on a grid, or interpolates it to the next grid,
does not smooth the other, and iterations grow with (1 − 2ν)^-½. On lattices a Chebyshev smoother of
higher degree over a wider range of eigenvalues compensates for that up to ν = 0.495. Beyond, and on
other meshes, a factorisation is used where it fits into memory. Iterations to 1e-8, measured from
10⁴ to 2·10⁵ unknowns on lattices, and to 5·10⁶ on other meshes:

    lattices        7 to 10 with tetrahedra; at ν = 0.49 13 (Q1), 14 (P1), 16 to 23 (Q2)
    other meshes    10 to 18 up to ν = 0.3 on cells of even lengths, 20 at 0.45, whatever the shape,
                    the supports and the jump of the moduli; 31 on tetrahedra of 8 : 1 and 16 : 1,
                    28 to 43 on hexahedra of 8 : 1 and 20 : 1
    factorised      1 to 2; 10⁵ unknowns take 4 to 6 s and 1 GB, once

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from petsc4py import PETSc

from geometry.materials import Material
from geometry.meshes.block import BlockShape
from geometry.meshes.refined_block import RefinedShape
from macro.linear_solvers.algebraic import algebraic_options
from macro.linear_solvers.multigrid import Lattice, coarser_grids
from macro.linear_solvers.multigrid_degrees import Linear, quadratic_options, vertex_grid
from macro.linear_solvers.options import DIRECT_DEFAULTS, PREFIX, linear_solver
from macro.linear_solvers.stiffened import Stiffened

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

_DEGREES = (4, 8)
"""Smallest and largest degree of the smoothing polynomial."""

_SMALLEST = 0.005
"""Smallest eigenvalue that is smoothed, relative to the largest."""

_ESTIMATES = 20
"""Iterations that estimate the largest eigenvalue. PETSc's 10 miss up to 8 % of it, and with these
wide ranges a smoother that misses more than 5 % is not definite; 20 miss 1 %."""


def block_solver(
    matrix: PETSc.Mat,
    space: Any,
    shape: BlockShape | RefinedShape,
    lattice: Lattice | None,
    material: Material,
    free: PETSc.Vec,
    linear: Callable[[], Linear],
) -> PETSc.KSP:
    """Return a solver for a block's stiffness; PETSc's options of the user win.

    Args:
        matrix: The stiffness with unit rows for constrained unknowns, its near-nullspace attached.
        space: Its space.
        shape: Shape that was meshed.
        lattice: The lattice that its nodes form, if they form one.
        material: Elastic constants of the block.
        free: 1 for unknowns that are free, 0 for constrained ones.
        linear: Gives the same block with linear displacements.

    Note:
        Collective.
    """
    ratio = material.poisson_ratio
    requested = PETSc.Options(PREFIX).getString("pc_type", "")
    if lattice is None:
        return body_solver(
            matrix, space, degree=shape.degree, poisson_ratio=ratio, free=free, linear=linear
        )
    if not requested and ratio > STIFF and matrix.getSize()[0] <= FACTORISED:
        return linear_solver(matrix, preconditioner=DIRECT_DEFAULTS)
    if requested not in ("", "mg"):
        return linear_solver(matrix)
    smoother = smoothing(ratio, hexahedral=shape.hexahedral)
    return linear_solver(matrix, coarser_grids(lattice, matrix, free), smoother)


def body_solver(
    matrix: PETSc.Mat,
    space: Any,
    *,
    degree: int,
    poisson_ratio: float,
    free: PETSc.Vec,
    linear: Callable[[], Linear],
    stiffened: Stiffened | None = None,
) -> PETSc.KSP:
    """Return a solver for the stiffness of a body whose mesh is no lattice.

    Args:
        matrix: The stiffness with unit rows for constrained unknowns, its near-nullspace attached.
        space: Its space.
        degree: Degree of the displacements.
        poisson_ratio: Largest Poisson's ratio of the body.
        free: 1 for unknowns that are free, 0 for constrained ones.
        linear: Gives the same body with linear displacements; used for degree 2.
        stiffened: The matrix with springs, which the preconditioner is to know; None: no springs.

    Note:
        Collective.
    """
    requested = PETSc.Options(PREFIX).getString("pc_type", "")
    direct = not requested and poisson_ratio > COMPRESSIBLE and matrix.getSize()[0] <= FACTORISED
    if degree == 2 and not direct and requested in ("", "mg"):
        springs, finest = None, None
        if stiffened is not None:
            springs = stiffened.springs
            finest = stiffened.product, stiffened.diagonal_blocks()
        grid = vertex_grid(space, linear(), free, springs)
        return linear_solver(matrix, grid, quadratic_options(space.mesh), finest=finest)
    hexahedral = space.mesh.topology.cell_name() == "hexahedron"
    options = DIRECT_DEFAULTS if direct else algebraic_options(hexahedral=hexahedral)
    whole = None if stiffened is None else stiffened.assembled()
    return linear_solver(matrix, preconditioner=options, whole=whole)


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
