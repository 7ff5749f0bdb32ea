"""Which solver a block gets, and that the user's options win."""

import numpy as np
import pytest
from helpers.petsc_build import ALGEBRAIC
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, RefinedShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers import selection as block_solver

CUBE = {"interface": (1.0, 1.0), "height": 1.0}
COARSE = {"places": np.array([[0.5, 0.5]]), "fine": 0.3, "coarse": 0.5}


def make(element, ratio):
    refined = element.endswith("*")
    shape = (
        RefinedShape(**CUBE, **COARSE, element=element[:2])
        if refined
        else BlockShape(**CUBE, cells=(4, 4, 3), element=element)
    )
    material = Material(young_modulus=4e3, poisson_ratio=ratio)
    return Block(block_mesh(shape, MPI.COMM_SELF), material)


@pytest.fixture
def options():
    """Give a function that sets PETSc's options as a user does; they go afterwards."""
    database, names = PETSc.Options("patchlaw_"), []

    def put(**values):
        for name, value in values.items():
            database[name] = value
            names.append(name)

    yield put
    for name in names:
        database.delValue(name)


@pytest.mark.long
@pytest.mark.parametrize(
    ("element", "ratio", "kind"),
    [
        ("Q1", 0.495, "mg"),
        ("Q2", 0.4999, "cholesky"),
        ("P1*", 0.45, ALGEBRAIC),  # * without a lattice
        ("P2*", 0.45, "mg"),
        ("P1*", 0.46, "cholesky"),
        ("P2*", 0.46, "cholesky"),
    ],
)
def test_choice(iterations, element, ratio, kind):
    block = make(element, ratio)
    assert block.solver.method == kind
    if kind == "cholesky":
        assert iterations(block) <= 2


@pytest.mark.long
@pytest.mark.parametrize(("element", "kind"), [("Q1", "mg"), ("P1*", ALGEBRAIC), ("P2*", "mg")])
def test_what_is_too_large_is_not_factorised(monkeypatch, iterations, element, kind):
    monkeypatch.setattr(block_solver, "FACTORISED", 100)
    blocks = [make(element, ratio) for ratio in (0.4975, 0.499375)]
    assert [block.solver.method for block in blocks] == [kind, kind]
    # four times nearer to 1/2: twice the iterations
    counts = [iterations(block) for block in blocks]
    assert counts[1] < 2.3 * counts[0]


@pytest.mark.parametrize(
    ("ratio", "sides", "cells", "height"),
    # with PETSc's own estimate of the largest eigenvalue the smoother is not definite here
    [(0.49, "roller", (4, 3, 3), 1.0), (0.495, "free", (4, 4, 3), 0.6)],
)
def test_wide_ranges_of_eigenvalues_reach_the_largest(iterations, ratio, sides, cells, height):
    shape = BlockShape(interface=(1.0, 1.0), height=height, cells=cells, element="P1")
    material = Material(young_modulus=4e3, poisson_ratio=ratio)
    block = Block(block_mesh(shape, MPI.COMM_SELF), material, sides)
    assert iterations(block) <= 15  # the module's 14 at 0.49, and one


@pytest.mark.long
@pytest.mark.parametrize(("element", "ratio"), [("Q1", 0.3), ("P2*", 0.3), ("P2*", 0.49)])
@pytest.mark.parametrize("kind", ["jacobi", "gamg"])
def test_the_users_preconditioner_wins(options, element, ratio, kind):
    options(pc_type=kind)
    assert make(element, ratio).solver.method == kind


def test_the_users_smoother_wins(options):
    options(mg_levels_pc_type="sor", mg_coarse_pc_type="jacobi")
    solver = make("P2*", 0.3).solver.pc
    assert solver.getMGSmoother(1).pc.getType() == "sor"
    assert solver.getMGCoarseSolve().pc.getType() == "jacobi"
