"""Material constants and rigid body modes."""

import numpy as np
import pytest
from mpi4py import MPI

from geometry.errors import InputError
from geometry.meshes.block import BlockShape
from macro import Block, Material, block_mesh, compat
from macro.elasticity import rigid_body_modes


@pytest.mark.parametrize(
    ("e", "nu", "match"),
    [
        (0.0, 0.3, r"0\.0: Young's modulus must be positive \(allowed: E > 0 MPa\)"),
        (-4.0, 0.3, "Young's modulus"),
        (float("nan"), 0.3, "Young's modulus"),
        (float("inf"), 0.3, "Young's modulus"),
        (1.0, 0.5, r"0\.5: Poisson's ratio is impossible \(allowed: -1 < ν < 0\.5\)"),
        (1.0, -1.0, "Poisson's ratio"),
        (1.0, float("nan"), "Poisson's ratio"),
    ],
)
def test_impossible_material_is_refused(e, nu, match):
    with pytest.raises(InputError, match=match):
        Material(young_modulus=e, poisson_ratio=nu)


def test_moduli():
    material = Material(young_modulus=4000.0, poisson_ratio=0.15)
    assert material.contact_modulus == pytest.approx(4092.0716112531970)
    assert material.confined_modulus == pytest.approx(4000 * 0.85 / (1.15 * 0.7), rel=1e-14)
    assert Material(young_modulus=2.0, poisson_ratio=0.0).lame == (0.0, 1.0)


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_rigid_motions_need_no_force(element):
    shape = BlockShape(interface=(1.0, 2.0), height=0.5, cells=(2, 2, 2), element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    free = compat.assemble_matrix(compat.compile_form(block._form), [])
    modes = rigid_body_modes(block.space).getVecs()
    assert len(modes) == 6
    for mode in modes:
        force = mode.duplicate()
        free.mult(mode, force)
        assert force.norm() < 1e-13 * free.norm()  # round-off
    assert np.linalg.matrix_rank(np.array([mode.array for mode in modes])) == 6
