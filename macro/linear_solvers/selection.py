"""Which linear solver a block gets: by its mesh, its element and its Poisson's ratio.

Towards ν = ½ the volume becomes stiff beside the shape by λ/μ = 2ν/(1 − 2ν), and what smooths the
one on a grid, or interpolates it to the next, does nothing for the other: iterations grow with
(1 − 2ν)^-½. On lattices a polynomial over a range of eigenvalues that is wider by as much, and of a
degree that follows, buys this back up to ν = 0.495; beyond, and on other meshes, so does a
factorisation, where it fits. Counted to 1e-8, from 10⁴ to 2·10⁵ unknowns:

    lattices        7 to 10 with tetrahedra; at ν = 0.49 13 (Q1), 14 (P1), 16 to 23 (Q2)
    refined meshes  11 to 15 up to ν = 0.3, 18 at 0.4, 24 at 0.45
    factorised      1 to 2; 10⁵ unknowns take 4 to 6 s and 1 GB, once
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

from petsc4py import PETSc

from geometry.materials import Material
from geometry.meshes.block import BlockShape
from geometry.meshes.refined_block import RefinedShape
from macro.linear_solvers.direct import DIRECT_DEFAULTS
from macro.linear_solvers.multigrid import Lattice, coarser_grids
from macro.linear_solvers.multigrid_degrees import two_degree_solver
from macro.linear_solvers.options import PREFIX, linear_solver

COMPRESSIBLE = 0.45
"""Poisson's ratio up to which multigrid does without a lattice."""

SOFT = 0.3
"""Poisson's ratio up to which points alone smooth hexahedra; beyond, more smoothing takes half the
iterations in the same time."""

STIFF = 0.495
"""Poisson's ratio up to which multigrid does on lattices, with more smoothing."""

FACTORISED = 100_000
"""Unknowns up to which a factorisation replaces multigrid for what is nearly incompressible; what
is larger has multigrid as it is, and twice its iterations for every fourth of 1 − 2ν."""

_DEGREES = (4, 8)  # of the smoothing polynomial
_SMALLEST = 0.005  # eigenvalue smoothed, over the largest
_ESTIMATES = 20
"""Steps that find the largest eigenvalue. PETSc's 10 miss up to 8 % of it, beyond which these wide
ranges make a smoother that is not definite; 20 miss 1 %."""


def block_solver(
    matrix: PETSc.Mat,
    space: Any,
    shape: BlockShape | RefinedShape,
    lattice: Lattice | None,
    material: Material,
    free: PETSc.Vec,
) -> PETSc.KSP:
    """Return a solver for a block's stiffness; PETSc's options of the user win.

    Args:
        matrix: The stiffness with unit rows for held unknowns, its near-nullspace attached.
        space: Its space.
        shape: What was meshed.
        lattice: The lattice that its nodes form, if they do.
        material: What it is of.
        free: 1 for unknowns that are free, 0 for those that are held.

    Note:
        Collective.
    """
    ratio = material.poisson_ratio
    asked = PETSc.Options(PREFIX).getString("pc_type", "")
    limit = COMPRESSIBLE if lattice is None else STIFF
    if not asked and ratio > limit and matrix.getSize()[0] <= FACTORISED:
        return linear_solver(matrix, preconditioner=DIRECT_DEFAULTS)
    if lattice is not None and isinstance(shape, BlockShape):
        smoother = smoothing(ratio, hexahedral=shape.hexahedral) if asked in ("", "mg") else {}
        grids = partial(coarser_grids, lattice, matrix, free)
        return linear_solver(matrix, coarser=grids, preconditioner=smoother)
    if asked in ("", "mg") and shape.degree == 2:
        return two_degree_solver(matrix, space, free)
    return linear_solver(matrix)


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
