"""Factorisations that run out of memory are repeated with more, or refused with the reason."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers.options import DIRECT_DEFAULTS, default_options
from patchlaw.macro.linear_solvers.solvers import set_up, solve_linear
from patchlaw.support import NotConverged

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
