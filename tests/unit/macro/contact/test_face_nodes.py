"""Nodes of the top: areas, shares of patches, connected regions."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import Block, Material, RoughFace, block_mesh
from patchlaw.macro.contact.face_nodes import TopNodes

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
