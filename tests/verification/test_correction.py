"""The block as half-space and smooth correction, against exact columns and the plain block."""

import numpy as np
import pytest
from mpi4py import MPI

from geometry import PatchGrid
from geometry.errors import InputError
from geometry.meshes import BlockShape
from macro.correction import make_correction
from macro.elasticity import Material
from micro.boussinesq import HalfSpace
from micro.influence import influence_matrix


def compliance(shape, sides="free", nu=0.3, grid=(4, 4)):
    """Return the correction, and the whole block's patch compliance for E = 1 MPa."""
    loads = PatchGrid(grid=grid, lengths=shape.interface)
    material = Material(young_modulus=1.0, poisson_ratio=nu)
    field = HalfSpace(1.0, nu)
    correction = make_correction(shape, material, sides, loads, field, MPI.COMM_SELF)
    half = influence_matrix(loads) / (np.pi * material.contact_modulus)
    return correction, half + correction.patch_compliance(loads)


@pytest.mark.parametrize("nu", [0.0, 0.3])
def test_confined_column_shortens_by_its_confined_modulus(nu):
    shape = BlockShape(interface=(1.0, 1.0), height=0.8, cells=(12, 12, 10))
    _, whole = compliance(shape, "roller", nu)
    exact = 0.8 * (1 + nu) * (1 - 2 * nu) / (1 - nu)
    # trilinear elements: MEASURED
    np.testing.assert_allclose(whole.sum(axis=1), exact, rtol=0.01)


def test_reciprocity_holds_as_far_as_the_mesh_resolves():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 5))
    correction, whole = compliance(shape)
    assert 0.0 < correction.asymmetry < 0.02
    np.testing.assert_array_equal(whole, whole.T)


def test_loads_beyond_the_block_are_refused():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2))
    loads = PatchGrid(grid=(1, 1), lengths=(1.2, 1.0))
    material = Material(young_modulus=1.0, poisson_ratio=0.3)
    with pytest.raises(InputError, match="reach beyond the block along x"):
        make_correction(shape, material, "free", loads, HalfSpace(1.0, 0.3), MPI.COMM_SELF)
