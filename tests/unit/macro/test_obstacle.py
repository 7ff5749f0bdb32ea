"""The rough block under a rigid plane: complementarity, balance, history."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from geometry import Control, Spectrum, Surface, synthesise
from geometry.meshes import BlockShape
from macro import Block, Material
from macro.obstacle import ObstacleBlock
from macro.rough_mesh import rough_block_mesh

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.15, seed=2), grid=(64, 64), lengths=(1.0, 1.0)
)
SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(16, 16, 6), grading=4.0)


def obstacle(surface=SURFACE, sides="free", shape=SHAPE):
    mesh, _ = rough_block_mesh(shape, surface, MPI.COMM_SELF)
    block = Block(mesh, MATERIAL, sides=sides)
    return ObstacleBlock(block, surface.highest - surface.mean_height)


def test_top_is_the_surface():
    found = obstacle()
    expected = SURFACE.height_at(found.top.x, found.top.y) - SURFACE.mean_height
    np.testing.assert_allclose(found.top.height, expected, atol=1e-12)
    assert found.top.area.sum() == pytest.approx(1.0, rel=1e-12)


def test_contact_conditions_and_balance():
    found = obstacle()
    state = found.press(Control(approach=10e-3))
    gap = SURFACE.highest - SURFACE.mean_height - 10e-3 - found.top.height
    moved = state.displacement[found.top.dofs]
    assert state.force > 0.0
    assert np.all(moved <= gap + 1e-15)
    assert np.all(state.pressing >= 0.0)
    np.testing.assert_allclose(moved[state.pressing > 0.0], gap[state.pressing > 0.0], atol=1e-15)
    # the bottom bears what the nodes press, to the tolerance of the linear solver
    assert state.reaction == pytest.approx(state.force, rel=1e-8)


def test_unloading_and_direct_loading_lead_to_the_same_contact():
    one, other = obstacle(), obstacle()
    for approach in (4e-3, 12e-3, 8e-3):
        state = one.press(Control(approach=approach, tilt=(2e-3, -1e-3)))
    direct = other.press(Control(approach=8e-3, tilt=(2e-3, -1e-3)))
    assert state.nodes == direct.nodes
    assert state.force == pytest.approx(direct.force, rel=1e-8)


def test_plane_apart_finds_nothing():
    found = obstacle()
    found.press(Control(approach=10e-3))
    for block in (obstacle(), found):
        state = block.press(Control(approach=-1e-3))
        assert (state.force, state.nodes, state.contact_area) == (0.0, 0, 0.0)
        assert not state.displacement.any()


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_flat_top_on_rollers_is_a_column(element):
    flat = Surface(heights=np.zeros((8, 8)), lengths=(1.0, 1.0))
    # on quadratic triangles a uniform pressure has no force at the vertices
    state = obstacle(
        flat, sides="roller", shape=replace(SHAPE, cells=(6, 5, 3), element=element)
    ).press(Control(approach=1e-3))
    # uniform strain: exact for any mesh
    assert state.force == pytest.approx(MATERIAL.confined_modulus * 1e-3, rel=1e-8)
    assert state.contact_area == pytest.approx(1.0, rel=1e-12)
