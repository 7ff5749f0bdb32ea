"""PETSc keeps nothing of what load steps and corrections have dropped."""

import numpy as np
import pytest
from helpers.block_cases import rough_contact
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, Control, PatchGrid, Spectrum, synthesise
from patchlaw.macro import (
    Block,
    LoadedFace,
    Material,
    block_mesh,
    compat,
    displacements_under,
    face_compliance,
)

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 3))


@pytest.fixture
def kept(capfd):
    """Return a function that counts the objects that PETSc keeps for a communicator."""

    def count(comm):
        capfd.readouterr()
        PETSc.garbage_view(comm)
        lines = capfd.readouterr().out.splitlines()
        return sum(line.startswith("| ") and "Object ID" not in line for line in lines)

    if not hasattr(PETSc, "garbage_view"):
        pytest.skip("this PETSc keeps nothing")
    compat.collect_garbage(PETSc.COMM_SELF)
    PETSc.Vec().createSeq(1)  # dropped at once
    if not count(PETSc.COMM_SELF):
        pytest.skip("this PETSc keeps nothing on a single rank")
    compat.collect_garbage(PETSc.COMM_SELF)
    return count


def rough_block(method):
    spectrum = Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.1, seed=2)
    surface = synthesise(spectrum, grid=(32, 32), lengths=(1.0, 1.0))
    return rough_contact(SHAPE, surface, MATERIAL, method=method)


@pytest.mark.parametrize("method", ["active-set", "augmented-lagrangian"])
def test_a_rough_block_leaves_nothing_of_a_load_step(kept, method):
    rough = rough_block(method)
    for approach in (6e-3, 9e-3):
        assert rough.solve(Control(approach=approach)).nodes > 0
        assert kept(rough.body.stiffness.comm) + kept(PETSc.COMM_SELF) == 0


@pytest.mark.parametrize("method", ["active-set", "augmented-lagrangian"])
def test_fields_do_not_pile_up_within_a_load_step(kept, monkeypatch, method):
    rough = rough_block(method)
    comm, free, found = rough.body.stiffness.comm, compat.collect_garbage, []

    def counted(of):
        found.append(kept(comm))
        free(of)

    rough.solve(Control(approach=6e-3))
    monkeypatch.setattr(compat, "collect_garbage", counted)
    assert rough.solve(Control(approach=12e-3)).iterations > 2
    assert max(found) <= 10  # of one step of Newton's method


def test_a_compliance_keeps_no_fields_of_its_patches(kept):
    block = Block(block_mesh(SHAPE, MPI.COMM_SELF), MATERIAL)
    found = []
    for grid in ((1, 1), (4, 4)):
        interface = LoadedFace.of_block(block, PatchGrid(grid=grid, lengths=(1.0, 1.0)))
        displacements_under(interface, np.eye(interface.patches.count))
        found.append(kept(block.stiffness.comm))
    assert found[1] <= found[0]


def test_displacements_keep_no_fields_of_their_load_steps(kept):
    block = Block(block_mesh(SHAPE, MPI.COMM_SELF), MATERIAL)
    interface = LoadedFace.of_block(block, PatchGrid(grid=(2, 1), lengths=(1.0, 1.0)))
    found = []
    for count in (1, 8):
        assert (displacements_under(interface, np.ones((count, 2))) > 0.0).all()
        found.append(kept(block.stiffness.comm))
    assert found[1] <= found[0]


def test_a_compliance_in_modes_keeps_no_factors(kept):
    found = face_compliance((1.0, 1.0), 1.0, MATERIAL, "free", 3, MPI.COMM_SELF)
    assert np.all(np.isfinite(found.normal))
    assert kept(PETSc.COMM_SELF) == 0
