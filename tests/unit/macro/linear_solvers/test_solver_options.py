"""PETSc options under a prefix, and the names of reasons."""

import pytest
from petsc4py import PETSc

from patchlaw.macro.linear_solvers.options import default_options, reason_name
from patchlaw.macro.linear_solvers.solvers import linear_solver


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
