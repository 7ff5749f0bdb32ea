"""Fields of a rough block that are written for ParaView."""

import numpy as np
import pytest
from mpi4py import MPI

from geometry import Control, RefinedShape, Surface
from geometry.meshes.block import BlockShape
from macro import Block, Material, UnilateralContactProblem, rough_block_mesh, write_rough_fields

h5py = pytest.importorskip("h5py")

CUBE = {"interface": (1.0, 1.0), "height": 1.0}
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2", "P2*"])
def test_a_confined_block_has_one_pressure(element, tmp_path):
    flat = Surface(heights=np.zeros((4, 4)), lengths=(1.0, 1.0))
    shape = (
        RefinedShape(
            **CUBE, places=np.array([[0.5, 0.5]]), fine=0.2, coarse=0.5, element=element[:2]
        )
        if element.endswith("*")  # curved cells
        else BlockShape(**CUBE, cells=(3, 2, 2), element=element)
    )
    mesh, _ = rough_block_mesh(shape, flat, MPI.COMM_SELF)
    rough = UnilateralContactProblem(Block(mesh, MATERIAL, sides="roller"), 0.0)
    state = rough.solve(Control(approach=5e-3))
    write_rough_fields(tmp_path / "fields.xdmf", rough, [(0, state)])
    with h5py.File(tmp_path / "fields.h5") as file:
        pressure = file["Function/pressure/0"][...].ravel()
        displacement = file["Function/displacement/0"][...]
        (places,) = (mesh["geometry"][...] for mesh in file["Mesh"].values())
    # all forces to the tolerance of a contact
    expected = MATERIAL.confined_modulus * 5e-3
    top = places[:, 2] > -1e-9
    np.testing.assert_allclose(pressure[top], expected, rtol=1e-8)
    np.testing.assert_allclose(displacement[:, 2], -5e-3 * (1.0 + places[:, 2]), atol=1e-10)
    assert np.abs(pressure[places[:, 2] < -0.5]).max() < 1e-8 * expected
