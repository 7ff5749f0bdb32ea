"""Which solver a body gets, that the user's options win, and what a factorisation needs."""

import numpy as np
import pytest
from helpers.petsc_build import ALGEBRAIC
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, RefinedShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers import selection as block_solver
from patchlaw.macro.linear_solvers.options import DIRECT_DEFAULTS, default_options, reason_name
from patchlaw.macro.linear_solvers.solvers import linear_solver, set_up, solve_linear
from patchlaw.support import NotConverged

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


@pytest.fixture
def user_options():
    """Give PETSc's database under the tests' prefix, and clean it afterwards."""
    database = PETSc.Options("patchlaw_test_")
    yield database
    for name in ("ksp_rtol", "ksp_type", "pc_type"):
        if database.hasName(name):
            database.delValue(name)


def test_defaults_are_taken_out_after_an_error(user_options):
    with pytest.raises(RuntimeError, match="boom"):
        with default_options("patchlaw_test_", {"ksp_rtol": 1e-3}):
            raise RuntimeError("boom")
    assert not user_options.hasName("ksp_rtol")


def test_a_prefix_is_mandatory():
    with pytest.raises(ValueError, match="need a prefix"):
        with default_options("", {"ksp_rtol": 1e-3}):
            pass


def laplacian():
    matrix = PETSc.Mat().createAIJ((12, 12), nnz=3, comm=PETSc.COMM_SELF)
    for i in range(12):
        matrix.setValue(i, i, 2.0)
        if i:
            matrix.setValue(i, i - 1, -1.0)
            matrix.setValue(i - 1, i, -1.0)
    matrix.assemble()
    return matrix


def test_linear_solver_takes_the_users_options(user_options):
    assert linear_solver(laplacian(), prefix="patchlaw_test_").getType() == "cg"
    user_options["ksp_type"], user_options["pc_type"] = "preonly", "cholesky"
    solver = linear_solver(laplacian(), prefix="patchlaw_test_")
    assert (solver.getType(), solver.pc.getType()) == ("preonly", "cholesky")


@pytest.mark.parametrize(
    ("reasons", "code", "name"),
    [
        (PETSc.SNES.ConvergedReason, 3, "CONVERGED_FNORM_RELATIVE"),
        (PETSc.SNES.ConvergedReason, -5, "DIVERGED_MAX_IT"),
        (PETSc.SNES.ConvergedReason, -6, "DIVERGED_LINE_SEARCH"),
        (PETSc.KSP.ConvergedReason, -8, "DIVERGED_INDEFINITE_PC"),
        (PETSc.KSP.ConvergedReason, -4711, "reason -4711"),
    ],
)
def test_reasons_have_names(reasons, code, name):
    assert reason_name(reasons, code) == name


SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(5, 5, 4), element="Q2")
INCOMPRESSIBLE = Material(young_modulus=4000.0, poisson_ratio=0.4999)


@pytest.fixture(scope="module")
def block():
    return Block(block_mesh(SHAPE, MPI.COMM_SELF), INCOMPRESSIBLE, "roller")


def factorised(block, *margins):
    """Return a solver by a factorisation that may take these margins of memory."""
    solver = PETSc.KSP().create(block.stiffness.comm)
    solver.setOptionsPrefix("patchlaw_")
    solver.setOperators(block.stiffness.convert("aij", PETSc.Mat()))
    with default_options("patchlaw_", {"ksp_type": "cg", "ksp_rtol": 1e-10, **DIRECT_DEFAULTS}):
        solver.setFromOptions()
        set_up(solver, *margins)
    return solver


def pulled(block, solver):
    """Return a block's displacements under unit forces, and the relative residual."""
    load = block.stiffness.createVecRight()
    load.set(1.0)
    load.pointwiseMult(load, block.free)
    found = load.duplicate()
    assert solve_linear(solver, load, found) <= 2
    residual = block.stiffness * found - load
    return found.array.copy(), residual.norm() / load.norm()


def test_a_factor_that_runs_out_of_memory_gets_more(block):
    usual, _ = pulled(block, block.solver)
    solver = factorised(block, (-30, 100))  # at first less than MUMPS's estimate
    found, missed = pulled(block, solver)
    assert solver.pc.getFactorMatrix().getMumpsIcntl(14) == 100
    assert missed < 1e-10  # the solver's tolerance
    np.testing.assert_allclose(found, usual, rtol=0.0, atol=1e-9 * np.abs(usual).max())


def test_what_never_fits_is_refused(block):
    with pytest.raises(NotConverged, match=r"factorisation of the block .*INFOG\(1\) = -9 "):
        factorised(block, (-30, -30))
