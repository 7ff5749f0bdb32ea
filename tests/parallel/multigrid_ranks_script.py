"""Solve blocks on all ranks and print iterations and norms as JSON; for test_multigrid_ranks.py."""

import numpy as np
import pytest
from helpers.on_ranks import tell
from mpi4py import MPI

from benchmarks.machine_parts import Part, part_body, read_part
from patchlaw.geometry import BlockShape, RefinedShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers import selection
from patchlaw.macro.linear_solvers.multigrid import coarser_grids, lattice_of

COMM = MPI.COMM_WORLD
CUBE = {"interface": (1.0, 1.0), "height": 1.0}
CENTRE = {"places": np.array([[0.5, 0.5]]), "coarse": 0.3}
CASES = {
    "graded": {"cells": (10, 8, 6), "grading": 10.0},
    "margin": {"cells": (6, 6, 6), "margin": 1.0, "margin_cells": 3, "margin_grading": 5.0},
    "quadratic": {"cells": (4, 4, 3), "element": "Q2"},
    "tetrahedra": {"cells": (6, 6, 6), "element": "P1", "grading": 4.0},
    # fewer nodes of the coarsest grid than ranks could share
    "column": {"cells": (1, 1, 6)},
    "stiff volume": {"cells": (8, 8, 6), "poisson_ratio": 0.49},
    "incompressible": {"cells": (4, 4, 3), "element": "Q2", "poisson_ratio": 0.4999},
    "refined": {"fine": 0.08, "element": "P2"},
    "refined, linear": {"fine": 0.05, "element": "P1"},
    "refined, incompressible": {"fine": 0.1, "element": "P2", "poisson_ratio": 0.4999},
}


SOFT = Material(young_modulus=500.0, poisson_ratio=0.3)
PARTS = {
    "part, linear": ({"name": "pad", "cells": "tet", "size": 5.0}, {"second": SOFT}),
    "part, quadratic": ({"name": "pad", "cells": "tet", "size": 9.0}, {"degree": 2}),
    "part, hexahedra": ({"name": "pad", "cells": "hex", "size": 6.0}, {"rollers": True}),
    "part, quadratic hexahedra": ({"name": "pad", "cells": "hex", "size": 9.0}, {"degree": 2}),
    # flat cells; few of them on every rank, but more unknowns than are factorised at once
    "part, flat": ({"name": "ring", "cells": "layers", "size": 1.9, "flat": 8.0}, {}),
}


def missed(block):
    """Return by how much products with coarser matrices M x miss Pᵀ(A(P x)), relative to them."""
    lattice = lattice_of(block.space, block.mesh)
    if lattice is None:
        return 0.0
    finer, worst = block.stiffness, 0.0
    for grid in coarser_grids(lattice, finer, block.free):
        x = grid.matrix.createVecRight()
        x.array[:] = np.random.default_rng(COMM.rank).standard_normal(x.getLocalSize())
        expected, found = x.duplicate(), x.duplicate()
        fine = grid.interpolation.createVecLeft()
        grid.interpolation.mult(x, fine)
        grid.interpolation.multTranspose(finer * fine, expected)
        grid.matrix.mult(x, found)
        found.axpy(-1.0, expected)
        worst, finer = max(worst, found.norm() / expected.norm()), grid.matrix
    return worst


def run(case):
    """Return what must not depend on the number of ranks, and the preconditioner."""
    content = dict(case)
    ratio = content.pop("poisson_ratio", 0.3)
    refined = "fine" in content
    shape = RefinedShape(**CUBE, **CENTRE, **content) if refined else BlockShape(**CUBE, **content)
    material = Material(young_modulus=4000.0, poisson_ratio=ratio)
    block = Block(block_mesh(shape, COMM), material, "roller")
    return solved(block) | {"missed": missed(block)}


def solved(block):
    """Return the displacements' norm under unit forces, iterations and preconditioner."""
    load = block.stiffness.createVecRight()
    load.set(1.0)
    load.pointwiseMult(load, block.free)
    found = load.duplicate()
    block.solver.solve(load, found)
    return {
        "norm": found.norm(),
        "iterations": block.solver.its,
        "preconditioner": block.solver.method,
    }


if __name__ == "__main__":
    result = {name: run(case) for name, case in CASES.items()}
    for name, (part, options) in PARTS.items():
        result[name] = solved(part_body(read_part(Part(**part), COMM), **options))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(selection, "has_hypre", lambda: False)
        part, options = PARTS["part, flat"]
        result["part, without hypre"] = solved(part_body(read_part(Part(**part), COMM), **options))
    tell(result)
