"""Rigid body modes."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry.meshes.block import BlockShape
from patchlaw.macro import Block, Material, block_mesh, compat
from patchlaw.macro.elastic_body import rigid_body_modes


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_rigid_motions_need_no_force(element):
    shape = BlockShape(interface=(1.0, 2.0), height=0.5, cells=(2, 2, 2), element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    free = compat.assemble_matrix(compat.compile_form(block.form), [])
    modes = rigid_body_modes(block.space.tabulate_dof_coordinates(), MPI.COMM_SELF).getVecs()
    assert len(modes) == 6
    for mode in modes:
        force = mode.duplicate()
        free.mult(mode, force)
        assert force.norm() < 1e-13 * free.norm()  # round-off
    assert np.linalg.matrix_rank(np.array([mode.array for mode in modes])) == 6
