"""The rough block under a rigid plane: complementarity, balance, history."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw import InputError, NotConverged
from patchlaw.geometry import BlockShape, Control, PatchGrid, Spectrum, synthesise
from patchlaw.macro import Block, Material, UnilateralContactProblem, block_mesh, rough_block_mesh

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.15, seed=2), grid=(64, 64), lengths=(1.0, 1.0)
)
SHAPE = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(16, 16, 6), grading=4.0)


@cache
def block_below(surface, sides, shape, material):
    mesh, _ = rough_block_mesh(shape, surface, MPI.COMM_SELF)
    return Block(mesh, material, sides=sides)


def problem(surface=SURFACE, sides="free", shape=SHAPE, material=MATERIAL, **options):
    block = block_below(surface, sides, shape, material)
    return UnilateralContactProblem(block, surface.highest - surface.mean_height, **options)


def test_top_is_the_surface():
    found = problem()
    expected = SURFACE.height_at(found.top.x, found.top.y) - SURFACE.mean_height
    np.testing.assert_allclose(found.top.height, expected, atol=1e-12)
    assert found.top.area.sum() == pytest.approx(1.0, rel=1e-12)


def test_contact_conditions_and_balance():
    found = problem()
    state = found.solve(Control(approach=10e-3))
    gap = SURFACE.highest - SURFACE.mean_height - 10e-3 - found.top.height
    moved = state.displacement[found.top.dofs]
    assert state.force > 0.0
    assert np.all(moved <= gap + 1e-15)
    assert np.all(state.nodal.force >= 0.0)
    np.testing.assert_allclose(
        moved[state.nodal.force > 0.0], gap[state.nodal.force > 0.0], atol=1e-15
    )
    # the bottom bears what the nodes press, to the tolerance of the linear solver
    assert state.reaction == pytest.approx(state.force, rel=1e-8)


@pytest.mark.long
def test_unloading_and_direct_loading_lead_to_the_same_contact():
    one, other = problem(), problem()
    for approach in (4e-3, 12e-3, 8e-3):
        state = one.solve(Control(approach=approach, tilt=(2e-3, -1e-3)))
    direct = other.solve(Control(approach=8e-3, tilt=(2e-3, -1e-3)))
    assert state.nodes == direct.nodes
    assert state.force == pytest.approx(direct.force, rel=1e-8)


def test_plane_apart_finds_nothing():
    found = problem()
    found.solve(Control(approach=10e-3))
    for block in (problem(), found):
        state = block.solve(Control(approach=-1e-3))
        assert (state.force, state.nodes, state.contact_area) == (0.0, 0, 0.0)
        assert not state.displacement.any()


@pytest.mark.long
def test_force_and_approach_are_two_ways_to_the_same_contact():
    lean = (5e-3, 0.0)  # 5 µm per mm
    by_approach, by_force = problem(), problem()
    iterations = np.zeros(2)
    for approach in (4e-3, 6e-3, 12e-3, 3e-3):
        one = by_approach.solve(Control(approach=approach, tilt=lean))
        other = by_force.solve(Control(force=one.force, tilt=lean))
        # both are converged to 1e-10 of the contact forces
        assert other.approach == pytest.approx(approach, rel=1e-8)
        assert other.force == pytest.approx(one.force, rel=1e-9)
        assert (other.nodes, other.contacts) == (one.nodes, one.contacts)
        iterations += one.linear_iterations, other.linear_iterations
    assert iterations[1] < 1.5 * iterations[0]  # measured 1.1: no search around the solves


def test_a_small_force_after_a_large_one_is_met():
    found = problem()
    for force in (20.0, 1e-6):
        state = found.solve(Control(force=force))
        # solves are converged to 1e-10 of the contact forces found, not of those before
        assert state.force == pytest.approx(force, rel=2e-10)
        assert state.reaction == pytest.approx(force, rel=2e-10)


def test_free_plane_turns_until_there_is_no_moment():
    found = problem()
    for force in (1e-6, 0.5, 4.0):
        state = found.solve(Control(force=force, tilt=None))
        assert state.force == pytest.approx(force, rel=1e-9)
        assert state.reaction == pytest.approx(force, rel=1e-9)
        np.testing.assert_allclose(state.moment, 0.0, atol=1e-9 * force)
        assert state.nodes >= 3  # fewer cannot hold a plane
    held = problem().solve(Control(approach=state.approach, tilt=state.tilt))
    assert held.force == pytest.approx(force, rel=1e-8)
    turned = problem().solve(Control(approach=state.approach, tilt=None))
    assert turned.force == pytest.approx(force, rel=1e-8)


@pytest.mark.parametrize(
    "method", ["active-set", pytest.param("augmented-lagrangian", marks=pytest.mark.long)]
)
def test_no_force_is_first_touch(method):
    found = problem(method=method)
    touch = SURFACE.highest - SURFACE.mean_height - found.top.height.max()
    for control in (Control(force=0.0), Control(force=1.0), Control(force=0.0)):
        state = found.solve(control)
        assert (state.nodes > 0) == (state.force > 0.0) == bool(control.force)
    assert state.approach == pytest.approx(touch, rel=1e-12)
    assert state.reason == "CONVERGED_NO_CONTACT"
    assert not state.displacement.any()
    assert state.patch_closure == pytest.approx(touch, rel=1e-12)


@pytest.mark.long
def test_one_step_to_merged_contacts():
    material = replace(MATERIAL, poisson_ratio=0.49)
    found, slow = problem(material=material), problem(material=material)
    state = found.solve(Control(approach=25e-3))
    for approach in (10e-3, 18e-3, 25e-3):
        small = slow.solve(Control(approach=approach))
    assert state.force == pytest.approx(small.force, rel=1e-9)
    assert state.contact_area > 0.1
    assert small.iterations <= 6
    # far back in one step
    back = found.solve(Control(approach=2e-3))
    assert back.force == pytest.approx(
        problem(material=material).solve(Control(approach=2e-3)).force, rel=1e-8
    )


def test_patches_share_force_area_and_closure():
    patches = PatchGrid(grid=(4, 2), lengths=(1.0, 1.0))
    found = problem(patches=patches)
    state = found.solve(Control(approach=12e-3, tilt=(2e-3, 1e-3)))
    assert state.patch_force.shape == (8,)
    assert state.patch_force.sum() == pytest.approx(state.force, rel=1e-12)
    assert state.patch_area.sum() == pytest.approx(state.nodal_area, rel=1e-12)
    lean = (patches.centres - 0.5) @ state.tilt
    sag = found.top.patch_means(-state.displacement[found.top.dofs])
    np.testing.assert_allclose(state.patch_closure, 12e-3 + lean - sag, rtol=1e-12)
    # what the whole top moves is the mean over equal patches
    assert state.patch_closure.mean() == pytest.approx(
        problem().solve(Control(approach=12e-3, tilt=(2e-3, 1e-3))).patch_closure[0], rel=1e-9
    )
    # gap and displacement of the top make up the separation
    rest = (
        SURFACE.highest - SURFACE.mean_height - np.average(found.top.height, weights=found.top.area)
    )
    assert state.mean_separation == pytest.approx(rest - 12e-3 + sag.mean(), rel=1e-9)


def test_failed_step_changes_nothing():
    found = problem()
    found.solve(Control(approach=4e-3))
    most, found.method.most_solves = found.method.most_solves, 1
    message = r"the contact of the rough block at approach 0\.02 mm did not .*: ACTIVE_SET"
    with pytest.raises(NotConverged, match=message):
        found.solve(Control(approach=20e-3))
    found.method.most_solves = most
    again = found.solve(Control(approach=8e-3))
    assert again.force == pytest.approx(problem().solve(Control(approach=8e-3)).force, rel=1e-8)


def test_wrong_input_is_refused():
    with pytest.raises(InputError, match=r"unknown contact of the reference.*active-set, augm"):
        problem(method="barrier")
    with pytest.raises(InputError, match=r"patches reach beyond the top.*inside .*1\.0, 1\.0"):
        problem(patches=PatchGrid(grid=(2, 2), lengths=(1.0, 1.1)))
    wide = block_mesh(replace(SHAPE, cells=(2, 2, 1), margin=0.5, margin_cells=1), MPI.COMM_SELF)
    with pytest.raises(InputError, match=r"^0\.5: the plane presses on the whole top"):
        UnilateralContactProblem(Block(wide, MATERIAL), 0.0)


def test_a_patch_without_a_node_is_closed_like_the_nearest():
    patches = PatchGrid(grid=(40, 1), lengths=(1.0, 1.0))  # on 16 cells
    found = problem(patches=patches)
    state = found.solve(Control(approach=10e-3))
    assert state.patch_force.sum() == pytest.approx(state.force, rel=1e-12)
    # a node on a border belongs to both sides
    beside = np.abs(found.top.x[:, None] - patches.centres[:, 0])
    held = (beside <= 0.5 / 40 + 1e-9).any(axis=0)
    assert not held.all()
    sag = -state.displacement[found.top.dofs]
    for index in np.flatnonzero(~held):
        apart = np.hypot(*(np.stack([found.top.x, found.top.y]).T - patches.centres[index]).T)
        nearest = sag[apart < apart.min() * (1.0 + 1e-9)].mean()  # two may be as near
        assert state.patch_closure[index] == pytest.approx(10e-3 - nearest, rel=1e-12)
