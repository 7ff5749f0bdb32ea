"""Patches on blocks of hexahedra without a mesh, against the same elements assembled in dolfinx."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw import InputError, NotConverged
from patchlaw.geometry import BlockShape, Material, PatchGrid
from patchlaw.macro import Block, LoadedFace, block_mesh, displacements_under
from patchlaw.macro.compliance import elements
from patchlaw.macro.compliance.face_compliance import lattice_compliance

BLOCKS = {
    "free": ({}, 0.3, "free", (2, 2)),
    "rollers": ({}, 0.3, "roller", (2, 2)),
    "quadratic": ({"element": "Q2"}, 0.15, "free", (3, 1)),
    "graded margin, patches cut elements": (
        {"margin": 0.4, "margin_cells": 3, "margin_grading": 5.0, "grading": 4.0},
        0.45, "free", (3, 2),
    ),
    "a single element": ({"cells": (1, 1, 1)}, 0.3, "roller", (2, 1)),
}  # fmt: skip


def made(shape, nu):
    shape = BlockShape(**{"interface": (1.0, 1.5), "height": 0.7, "cells": (4, 5, 3), **shape})
    return shape, Material(young_modulus=2.0, poisson_ratio=nu)


@pytest.mark.long
@pytest.mark.parametrize("name", BLOCKS)
def test_patches_sink_as_on_the_assembled_mesh(name):
    given, nu, sides, grid = BLOCKS[name]
    shape, material = made(given, nu)
    patches = PatchGrid(grid=grid, lengths=(1.0, 1.5))
    block = Block(block_mesh(shape, MPI.COMM_SELF), material, sides)
    meshed = displacements_under(LoadedFace.of_block(block, patches), np.eye(patches.count)).T
    found = lattice_compliance(shape, material, sides, patches, np.arange(patches.count), None)
    # linear solves to 1e-10
    np.testing.assert_allclose(found, meshed, rtol=0, atol=1e-9 * np.abs(meshed).max())


def test_patches_off_the_middle_of_the_block():
    """Nothing mirrors them, so that every parity has loads of its own."""
    shape, material = made({}, 0.3)
    patches = PatchGrid(grid=(2, 3), lengths=(0.5, 1.0), origin=(0.1, 0.2))
    block = Block(block_mesh(shape, MPI.COMM_SELF), material)
    meshed = displacements_under(LoadedFace.of_block(block, patches), np.eye(patches.count)).T
    some = np.array([4, 1])
    found = lattice_compliance(shape, material, "free", patches, some, None)
    np.testing.assert_allclose(found, meshed[:, some], rtol=0, atol=1e-9 * meshed.max())


def test_no_loads_displace_nothing():
    shape, material = made({}, 0.3)
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.5))
    none = np.array([], dtype=np.intp)
    assert lattice_compliance(shape, material, "free", patches, none, None).shape == (4, 0)


def test_iterations_do_not_grow_with_the_elements(monkeypatch):
    monkeypatch.setattr(elements, "_MOST_ITERATIONS", 26)  # 22 and 24 are taken
    patches = PatchGrid(grid=(1, 1), lengths=(1.0, 1.5))
    for cells in ((4, 4, 4), (32, 32, 32)):
        shape, material = made({"cells": cells}, 0.3)
        lattice_compliance(shape, material, "free", patches, np.array([0]), None)
    monkeypatch.setattr(elements, "_MOST_ITERATIONS", 3)
    with pytest.raises(NotConverged, match="the elastic block"):
        lattice_compliance(shape, material, "free", patches, np.array([0]), None)


def test_patches_beyond_the_interface_are_refused():
    shape, material = made({}, 0.3)
    patches = PatchGrid(grid=(2, 2), lengths=(1.0, 1.6))
    with pytest.raises(InputError, match="the patches reach beyond the top of the block"):
        lattice_compliance(shape, material, "free", patches, np.array([0]), None)
