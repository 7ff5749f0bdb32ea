"""Factorisations that run out of room get more, or say so."""

import numpy as np
import pytest
from mpi4py import MPI

from geometry import BlockShape
from geometry.errors import NotConverged
from macro import Block, Material, block_mesh
from macro.linear_solvers import direct as factorisation
from macro.linear_solvers.options import solve_linear

SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(5, 5, 4), element="Q2")
INCOMPRESSIBLE = Material(young_modulus=4000.0, poisson_ratio=0.4999)


def pulled():
    """Return a block's displacements under unit forces, and MUMPS's factor."""
    block = Block(block_mesh(SHAPE, MPI.COMM_SELF), INCOMPRESSIBLE, "roller")
    load = block.stiffness.createVecRight()
    load.set(1.0)
    load.pointwiseMult(load, block.free)
    found = load.duplicate()
    assert solve_linear(block.solver, load, found) <= 2
    residual = block.stiffness * found - load
    return found.array.copy(), residual.norm() / load.norm(), block.solver.pc.getFactorMatrix()


def test_a_factor_that_runs_out_of_room_gets_more(monkeypatch):
    usual, _, _ = pulled()
    monkeypatch.setattr(factorisation, "_ROOMS", (-30, 100))  # less than its estimate
    found, missed, factor = pulled()
    assert factor.getMumpsIcntl(14) == 100
    assert missed < 1e-10  # KRYLOV_DEFAULTS's tolerance
    np.testing.assert_allclose(found, usual, rtol=0.0, atol=1e-9 * np.abs(usual).max())


def test_what_never_fits_is_said(monkeypatch):
    monkeypatch.setattr(factorisation, "_ROOMS", (-30, -30))
    with pytest.raises(NotConverged, match=r"factorisation of the block .*INFOG\(1\) = -9 "):
        pulled()
