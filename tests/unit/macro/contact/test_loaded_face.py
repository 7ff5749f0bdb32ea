"""Samples, loads, means and regions of the interface."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import Block, LoadedFace, Material, RoughFace, block_mesh, displacements_under
from patchlaw.macro.contact.face_nodes import TopNodes
from patchlaw.support import InputError

NODES = 1e-10  # gmsh places nodes to about 1e-11


def make(grid=(2, 3), lengths=(2.0, 1.0), origin=(0.0, 0.0), **changes):
    shape = {"interface": (2.0, 1.0), "height": 1.0, "cells": (4, 3, 2)} | changes
    mesh = block_mesh(BlockShape(**shape), MPI.COMM_SELF)
    block = Block(mesh, Material(young_modulus=1.0, poisson_ratio=0.3))
    return LoadedFace.of_block(block, PatchGrid(grid=grid, lengths=lengths, origin=origin))


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
@pytest.mark.parametrize("grid", [(2, 3), (3, 2)])
def test_linear_displacements_have_exact_means(element, grid):
    interface = make(grid, element=element, margin=0.5, margin_cells=1)
    displacement = interface.body.stiffness.createVecRight()
    x, y, _ = interface.body.space.tabulate_dof_coordinates().T
    displacement.array[2::3] = -(0.5 + 0.4 * x - 0.3 * y)  # downward
    expected = 0.5 + interface.patches.centres @ [0.4, -0.3]
    np.testing.assert_allclose(interface.patch_displacements(displacement), expected, rtol=NODES)
    for mode in ("patchwise", "pointwise"):
        sampling = interface.sampling(mode)
        sampled = sampling.operator.createVecRight()
        sampling.operator.multTranspose(displacement, sampled)
        exact = 0.5 + 0.4 * sampling.x - 0.3 * sampling.y
        np.testing.assert_allclose(sampled.array / sampling.weight, exact, rtol=NODES)


def test_load_has_the_force_and_moment_of_the_pressures():
    interface = make((3, 2))
    pressures = np.array([1.0, 0.0, 2.5, -1.0, 4.0, 3.0])
    load = interface.load(pressures).array.reshape(-1, 3)
    forces = pressures * interface.patches.area
    places = interface.body.space.tabulate_dof_coordinates()[:, :2]
    assert np.abs(load[:, :2]).max() == 0.0
    assert -load[:, 2].sum() == pytest.approx(forces.sum(), rel=NODES)
    np.testing.assert_allclose(-load[:, 2] @ places, forces @ interface.patches.centres, rtol=NODES)


def test_margin_is_free_of_traction():
    interface = make((1, 1), margin=1.0, margin_cells=3)
    load = interface.load(np.ones(1)).array.reshape(-1, 3)
    x, y, _ = interface.body.space.tabulate_dof_coordinates()[load[:, 2] != 0.0].T
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((0, 2, 0, 1), abs=1e-12)


@pytest.mark.parametrize("grid", [(2, 1), (3, 2)])
def test_compliance_of_unequal_patches_is_that_of_direct_solutions(grid):
    """Patches that reach beyond the top are cut; A_i C_ij is symmetric, C_ij is not."""
    whole = make((1, 1))
    patches = PatchGrid(grid=grid, lengths=(2.7, 1.0))
    face = LoadedFace(whole.body, whole.facets, patches)
    assert face.areas.max() > 1.4 * face.areas.min()
    place, direct = whole.body.stiffness.createVecRight(), np.empty((patches.count,) * 2)
    unknowns = np.arange(place.size, dtype=np.int32)
    stiffness = whole.body.stiffness.getValues(unknowns, unknowns)
    held = np.count_nonzero(stiffness, axis=1) == 1  # unit rows
    for j, pressure in enumerate(np.eye(patches.count)):
        load = np.where(held, 0.0, face.load(pressure).array_r)
        place.array[:] = np.linalg.solve(stiffness, load)
        direct[:, j] = face.patch_displacements(place)
    found = displacements_under(face, np.eye(patches.count)).T
    np.testing.assert_allclose(found, direct, rtol=1e-7)  # the linear solver's own residual
    work = face.areas[:, None] * found
    np.testing.assert_allclose(work, work.T, rtol=1e-7)  # Betti


def test_patches_beyond_the_top_are_refused():
    with pytest.raises(InputError, match=r"patches reach beyond .* inside the interface \(2\.0, "):
        make(lengths=(2.5, 1.0))


def test_patches_beyond_a_small_top_are_refused():
    # areas of 1e-8 mm²
    small = {"interface": (1e-3, 1e-3), "height": 1e-3, "cells": (2, 2, 1)}
    assert make((10, 10), (1e-3, 1e-3), **small).areas.sum() == pytest.approx(1e-6, rel=NODES)
    with pytest.raises(InputError, match="patches reach beyond"):
        make((10, 10), (1.2e-3, 1e-3), **small)


MATERIAL = Material(young_modulus=4e3, poisson_ratio=0.2)


def top_of(element="Q1", cells=(6, 4, 1), grid=(2, 2)):
    shape = BlockShape(interface=(3.0, 2.0), height=1.0, cells=cells, element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), MATERIAL)
    return TopNodes(RoughFace.of_block(block), PatchGrid(grid=grid, lengths=(3.0, 2.0)))


@pytest.mark.parametrize("element", ["Q1", "P2"])
def test_regions_are_joined_by_facets(element):
    top = top_of(element)
    near = np.hypot(top.x - 0.5, top.y - 0.5) < 0.6
    far = np.hypot(top.x - 2.5, top.y - 1.5) < 0.3
    assert top.regions(near & far)[1] == 0
    assert top.regions(near)[1] == 1
    assert top.regions(near | far)[1] == 2
    assert top.regions(np.ones_like(near))[1] == 1
    # two nodes with one between them do not touch each other
    apart = np.isclose(top.y, 1.0) & (np.isclose(top.x, 0.5) | np.isclose(top.x, 1.5))
    assert top.regions(apart)[1] == 2
