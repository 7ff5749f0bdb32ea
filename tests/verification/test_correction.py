"""The block as half-space and smooth correction, against exact columns and the plain block."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from geometry import PatchGrid
from geometry.errors import InputError
from geometry.meshes import BlockShape
from macro.block import Block
from macro.compliance import plain_compliance
from macro.condense import make_correction
from macro.elasticity import Material
from macro.interface import Interface
from macro.kept import cached_correction
from macro.mesh import block_mesh
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
    # 0.025 % for ν = 0, 0.052 % for 0.3, the most at corners
    np.testing.assert_allclose(whole.sum(axis=1), exact, rtol=1e-3)


def test_reciprocity_holds_as_far_as_the_mesh_resolves():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(8, 8, 5))
    correction, whole = compliance(shape)
    assert 0.0 < correction.asymmetry < 0.004  # 0.35 % here
    np.testing.assert_array_equal(whole, whole.T)


def test_loads_beyond_the_block_are_refused():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2))
    loads = PatchGrid(grid=(1, 1), lengths=(1.2, 1.0))
    material = Material(young_modulus=1.0, poisson_ratio=0.3)
    with pytest.raises(InputError, match="reach beyond the block along x"):
        make_correction(shape, material, "free", loads, HalfSpace(1.0, 0.3), MPI.COMM_SELF)


def test_cells_of_scenes_give_a_cube_to_a_fraction_of_a_per_cent():
    cells = {name: (n, n, m) for name, n, m in (("scene", 16, 12), ("fine", 20, 16))}
    scene, fine = (
        compliance(BlockShape(interface=(1.0, 1.0), height=1.0, cells=cell), grid=(8, 8))[1]
        for cell in cells.values()
    )
    # 0.019 % in the mean, 0.067 % in the corner, 0.4 % in entries: half as much each 1.3-fold finer
    assert scene.sum(axis=1).mean() == pytest.approx(fine.sum(axis=1).mean(), rel=5e-4)
    assert scene[0, 0] == pytest.approx(fine[0, 0], rel=2e-3)
    np.testing.assert_allclose(scene, fine, atol=6e-3 * fine[0, 0])


def test_slender_free_column_shortens_by_youngs_modulus():
    short, tall = (
        compliance(BlockShape(interface=(1.0, 1.0), height=h, cells=(8, 8, n)))[1]
        .sum(axis=1)
        .mean()
        for h, n in ((4.0, 16), (6.0, 24))
    )
    # the clamped end drops out of the difference; this mesh leaves 0.0018 %
    assert tall - short == pytest.approx(2.0, rel=1e-4)


@pytest.mark.parametrize(
    ("cells", "margin"), [((16, 16, 12), {}), ((8, 8, 6), {"margin": 0.25, "margin_cells": 2})]
)
def test_block_agrees_with_quadratic_elements_without_decomposition(cells, margin):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=cells, **margin)
    _, whole = compliance(shape, nu=0.15)
    plain = Block(
        block_mesh(replace(shape, cells=(8, 8, 6), element="Q2"), MPI.COMM_SELF),
        Material(young_modulus=1.0, poisson_ratio=0.15),
    )
    interface = Interface(plain, PatchGrid(grid=(4, 4), lengths=(1.0, 1.0)))
    load = interface.load(np.ones(16))
    load.array[:] = plain.solve(load).x.array[: plain.owned_dofs]
    sunk = interface.patch_displacements(load).mean()
    # with a margin, pressures end within the top: these quadratic elements leave 0.17 % there
    assert whole.sum(axis=1).mean() == pytest.approx(sunk, rel=3e-3 if margin else 3e-4)


def test_single_patches_are_the_limit_of_quadratic_elements_without_decomposition():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(16, 16, 12))
    whole = compliance(shape, grid=(2, 2))[1]
    plain = Block(
        block_mesh(replace(shape, cells=(8, 8, 6), element="Q2", grading=4.0), MPI.COMM_SELF),
        Material(young_modulus=1.0, poisson_ratio=0.3),
    )
    found = plain_compliance(Interface(plain, PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))))
    # elements are stiff below a patch's own edges: 0.33 % here, 0.16 % with 16, 16, 8
    assert np.all(np.diag(found) < np.diag(whole))
    np.testing.assert_allclose(found, whole, atol=0.005 * whole.max())


def test_kept_correction_is_the_one_computed(monkeypatch, tmp_path):
    monkeypatch.setenv("PATCHLAW_CACHE", str(tmp_path))
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(4, 4, 3))
    loads = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
    material = Material(young_modulus=1.0, poisson_ratio=0.3)
    every = (shape, material, "free", loads, HalfSpace(1.0, 0.3), MPI.COMM_SELF)
    first, second = cached_correction(*every), cached_correction(*every)
    assert len(list(tmp_path.iterdir())) == 1
    cached_correction(shape, material, "roller", *every[3:])
    assert len(list(tmp_path.iterdir())) == 2
    np.testing.assert_array_equal(second.values, first.values)
