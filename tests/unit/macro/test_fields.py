"""Fields of blocks that are written for ParaView."""

from xml.etree import ElementTree

import numpy as np
import pytest
from helpers.block_cases import rough_contact
from mpi4py import MPI

from patchlaw.geometry import BlockShape, Control, PatchGrid, RefinedShape, Surface
from patchlaw.macro import (
    Block,
    FieldStep,
    LoadedFace,
    Material,
    block_mesh,
    compat,
    write_fields,
    write_rough_fields,
)
from patchlaw.macro.fields import cell_stresses
from patchlaw.micro.closed_forms import stresses_below

h5py = pytest.importorskip("h5py")

CUBE = {"interface": (1.0, 1.0), "height": 1.0}
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)


@pytest.mark.long
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
    rough = rough_contact(shape, flat, MATERIAL, "roller")
    state = rough.solve(Control(approach=5e-3))
    write_rough_fields(tmp_path / "fields.xdmf", rough, [(0, state)])
    with h5py.File(tmp_path / "fields.h5") as file:
        pressure, displacement, stress, equivalent = (
            file[f"Function/{name}/0"][...]
            for name in ("pressure", "displacement", "stress", "von_Mises")
        )
        (places,) = (mesh["geometry"][...] for mesh in file["Mesh"].values())
    # all forces to the tolerance of a contact
    expected, pressure = MATERIAL.confined_modulus * 5e-3, pressure.ravel()
    top = places[:, 2] > -1e-9
    np.testing.assert_allclose(pressure[top], expected, rtol=1e-8)
    np.testing.assert_allclose(displacement[:, 2], -5e-3 * (1.0 + places[:, 2]), atol=1e-10)
    assert np.abs(pressure[places[:, 2] < -0.5]).max() < 1e-8 * expected
    # uniform strain: σ = λ ε I below, (λ + 2 μ) ε along the load, von Mises 2 μ ε
    first, shear = MATERIAL.lame
    uniform = -5e-3 * np.diag([first, first, first + 2.0 * shear])
    whole = np.broadcast_to(uniform.ravel(), stress.shape)
    np.testing.assert_allclose(stress, whole, atol=1e-7 * expected)
    np.testing.assert_allclose(equivalent, 2.0 * shear * 5e-3, rtol=1e-6)


def flat_block(cells=(3, 2, 2), **options):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=cells, **options)
    return Block(block_mesh(shape, MPI.COMM_SELF), MATERIAL)


def test_all_fields_of_a_load_step_are_on_one_grid(tmp_path):
    """ParaView shows stresses on the deformed block, step by step."""
    block = flat_block()
    interface = LoadedFace.of_block(block, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))
    given = [
        FieldStep(number, np.full(block.owned_dofs, 1.0 * number), np.ones(1)) for number in (2, 5)
    ]
    write_fields(tmp_path / "fields.xdmf", interface, iter(given))
    domain = ElementTree.parse(tmp_path / "fields.xdmf").getroot()[0]
    mesh, fields = domain.findall("Grid")
    assert (mesh.get("GridType"), fields.get("CollectionType")) == ("Uniform", "Temporal")
    assert [float(grid.find("Time").get("Value")) for grid in fields] == [2.0, 5.0]
    for grid in fields:
        attributes = grid.findall("Attribute")
        assert [(one.get("Name"), one.get("AttributeType")) for one in attributes] == [
            ("displacement", "Vector"), ("stress", "Tensor"),
            ("von_Mises", "Scalar"), ("pressure", "Scalar"),
        ]  # fmt: skip
        for attribute in attributes:
            name, _, place = attribute.find("DataItem").text.strip().partition(":")
            with h5py.File(tmp_path / name) as file:
                assert file[place].shape[0] in (36, 12)


@pytest.mark.long
def test_stresses_below_a_hertz_contact():
    """Against the half-space in waves, which shares nothing with the mesh."""
    cells, fine, radius = 32, 96, 0.16
    block = flat_block((cells, cells, 20), grading=6.0)
    place = (np.arange(fine) + 0.5) / fine - 0.5
    pressure = np.sqrt(np.maximum(1.0 - (place[:, None] ** 2 + place**2) / radius**2, 0.0))
    parts = PatchGrid(grid=(cells, cells), lengths=(1.0, 1.0))
    interface = LoadedFace.of_block(block, parts)
    loads = pressure.reshape(cells, 3, cells, 3).mean(axis=(1, 3)).ravel()
    found = cell_stresses(block, block.solve(interface.load(loads)))
    middles = block.mesh.mesh.geometry.x[compat.cell_vertices(block.mesh.mesh)].mean(axis=1)
    row = 3 * (cells // 2) + 1
    column = np.flatnonzero(np.abs(middles[:, :2] - (0.5 + place[row])).max(axis=1) < 1e-6)
    column = column[np.argsort(-middles[column, 2])]
    depths = -middles[column, 2]
    closed = stresses_below(pressure, (1 / fine, 1 / fine), 0.3, depths, row)[:, row]
    shear, exact = (0.5 * np.abs(s[:, 0, 0] - s[:, 2, 2]) for s in (found[column], closed))
    near = depths < 2.0 * radius
    # five cells along the radius, and a block instead of a half-space
    assert np.abs(shear - exact)[near].max() < 0.02
    assert depths[shear.argmax()] == pytest.approx(0.48 * radius, abs=0.02)
    assert shear.max() == pytest.approx(0.31, abs=0.02)
