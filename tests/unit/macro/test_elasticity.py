"""Elastic bodies: rigid motions, supports, solves, and loads besides the contact in closed form."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from helpers.body_meshes import HIGH, LOW, box
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import (
    Block,
    LoadedFace,
    Loads,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    Traction,
    block_mesh,
    compat,
)
from patchlaw.macro.elastic_body import rigid_body_modes
from patchlaw.macro.fields import cell_stresses
from patchlaw.support import InputError, NotConverged


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_rigid_motions_need_no_force(element):
    shape = BlockShape(interface=(1.0, 2.0), height=0.5, cells=(2, 2, 2), element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    free = compat.assemble_matrix(compat.compile_form(block.form), [])
    modes = rigid_body_modes(block.space.tabulate_dof_coordinates(), MPI.COMM_SELF).getVecs()
    assert len(modes) == 6
    for mode in modes:
        force = mode.duplicate()
        free.mult(mode, force)
        assert force.norm() < 1e-13 * free.norm()  # round-off
    assert np.linalg.matrix_rank(np.array([mode.array for mode in modes])) == 6


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("depth", [0.0, 0.2])
def test_supports_bear_the_rows_of_held_displacements(order, depth):
    """On curved cells linear displacements do not turn without strains."""
    tagged = box((0, 0, 0), (2, 1, 1), (2, 2, 2), "hexahedron")
    held = [Support(tag=LOW), Support(tag=HIGH, displacement=(0.0, None, None))]
    if depth:
        tagged = bent(depth)
        held = [Support(tag=HIGH, displacement=(0.0, None, 0.0))]
    body = MeshedBody(tagged, Material(young_modulus=7.0, poisson_ratio=0.3), held, order=order)
    moved = np.random.default_rng(5).standard_normal(body.owned_dofs) * body.free.array_r
    whole = compat.assemble_matrix(compat.compile_form(body.form), [])
    x, y = whole.createVecs()
    x.array[:] = moved
    whole.mult(x, y)
    force = np.where(body.supported, y.array_r, 0.0).reshape(-1, 3)
    point = np.array([0.3, -2.0, 0.7])
    arms = body.space.tabulate_dof_coordinates() - point
    expected = [force.sum(axis=0), np.cross(arms, force).sum(axis=0)]
    np.testing.assert_allclose(body.borne(moved, point), expected, rtol=1e-10, atol=1e-10)


def bent(depth):
    """Return a cube of hexahedra of second order below a cylinder, with a tag on its top."""
    lines = np.linspace(0.0, 1.0, 5)
    grid = np.stack(np.meshgrid(lines, lines, lines, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    places = np.rint(2.0 * (corners[:, None] + compat.lagrange_points("hexahedron", 2)[None]))
    cells = (places.astype(np.int64) * np.array([25, 5, 1])).sum(axis=2)
    grid[:, 2] *= 1.0 + depth * grid[:, 0] ** 2
    mesh = compat.mesh_from_cells(cells, grid, None, MPI.COMM_SELF)
    top = dmesh.locate_entities_boundary(
        mesh, 2, lambda x: np.isclose(x[2], 1.0 + depth * x[0] ** 2)
    )
    tags = dmesh.meshtags(mesh, 2, np.sort(top), np.full(len(top), HIGH, np.int32))
    return TaggedMesh(mesh=mesh, facet_tags=tags)


E, NU, STRAIN = 4000.0, 0.3, 2e-3
STEEL = Material(young_modulus=E, poisson_ratio=NU)


def make(sides="free", **changes):
    shape = {"interface": (1.0, 1.0), "height": 1.0, "cells": (3, 3, 3)} | changes
    return Block(block_mesh(BlockShape(**shape), MPI.COMM_SELF), STEEL, sides)


def test_unknown_sides_are_refused():
    with pytest.raises(
        InputError, match=r"'glued': unknown support of the sides \(allowed: free, roller\)"
    ):
        make("glued")


@pytest.mark.parametrize("sides", ["free", "roller"])
def test_supports_hold(sides):
    block = make(sides, margin=0.5, margin_cells=1, cells=(2, 2, 2))
    interface = LoadedFace.of_block(block, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))
    u = block.solve(interface.load(np.array([100.0]))).x.array.reshape(-1, 3)
    x, y, z = block.space.tabulate_dof_coordinates().T
    assert np.abs(u[np.isclose(z, -1.0)]).max() == 0.0
    on_x, on_y = np.isclose(np.abs(x - 0.5), 1.0), np.isclose(np.abs(y - 0.5), 1.0)
    for axis, side in ((0, on_x), (1, on_y)):
        normal = np.abs(u[side, axis]).max() / np.abs(u).max()
        # multigrid touches constrained rows and leaves them to the solver's 1e-10
        assert normal < 1e-9 if sides == "roller" else normal > 1e-3
        assert np.abs(u[side & np.isclose(z, 0.0), 2]).max() > 0.0  # the sides slide


def test_failed_solve_names_the_reason():
    block = make()
    load = block.stiffness.createVecLeft()
    load.array[-1] = 1.0
    block.solver.setTolerances(max_it=1)
    with pytest.raises(NotConverged, match=r"linear solve .* DIVERGED_(MAX_)?ITS? after 1 iter"):
        block.solve(load)


HEATED = Loads(strain=((None, STRAIN),))
HELD = (0.0, 0.0, 0.0)


def loaded(*states, upper=None, cell="hexahedron", order=1):
    """Return a box that is held below, and above if it is told how."""
    mesh = box((0, 0, 0), (2, 1, 0.5), (4, 3, 2), cell)
    supports = [Support(tag=LOW, displacement=HELD)]
    if upper is not None:
        supports.append(Support(tag=HIGH, displacement=upper))
    return MeshedBody(mesh, STEEL, supports, states, order=order)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_body_that_may_grow_has_no_stress(cell, order):
    mesh = box((0, 0, 0), (2, 1, 0.5), (4, 3, 2), cell)
    # the axis of z alone holds the middle: the bottom slides, but for what rounding would move
    free = MeshedBody(mesh, STEEL, [Support(tag=LOW, displacement=(None, None, 0.0))], [HEATED],
                      order=order)  # fmt: skip
    points = free.space.tabulate_dof_coordinates()
    grown = free.function((STRAIN * points).ravel())
    np.testing.assert_allclose(cell_stresses(free, grown), 0.0, atol=1e-9 * E * STRAIN)
    # that displacement is in equilibrium with the loads
    (form,) = free._load_forms(HEATED)
    from patchlaw.macro import compat

    forces = compat.assemble_vector(compat.compile_form(form)).array_r
    internal = free._product(grown).array_r
    np.testing.assert_allclose(forces, internal, atol=1e-10 * np.abs(internal).max())


def test_a_body_that_may_not_grow_is_under_pressure():
    body = loaded(HEATED)
    rest = body.function(np.zeros(body.owned_dofs))
    pressure = E * STRAIN / (1.0 - 2.0 * NU)
    stress = cell_stresses(body, rest)
    expected = np.broadcast_to(-pressure * np.eye(3), stress.shape)
    np.testing.assert_allclose(stress, expected, rtol=1e-12, atol=1e-12)


def test_states_are_mixed_on_the_way_from_one_to_the_next():
    pulled = Loads(tractions=(Traction(tag=HIGH, stress=(0.0, 0.0, 3.0)),))
    body = loaded(Loads(), HEATED, pulled)
    hot, stretched = body.preload(1), body.preload(2)
    np.testing.assert_array_equal(body.preload(0), 0.0)
    np.testing.assert_allclose(body.preload(0.25), 0.25 * hot, rtol=1e-14)
    np.testing.assert_allclose(body.preload(1.5), 0.5 * (hot + stretched), rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(body.free_strain(0.25), 0.25 * STRAIN)
    assert loaded(Loads()).preload() is None


def test_a_pressure_acts_against_the_outward_normal():
    by_stress = loaded(Loads(tractions=(Traction(tag=HIGH, stress=(0.0, 0.0, -3.0)),)))
    by_pressure = loaded(Loads(tractions=(Traction(tag=HIGH, pressure=3.0),)))
    np.testing.assert_allclose(by_pressure.preload(), by_stress.preload(), rtol=1e-10, atol=1e-18)


def test_moments_of_a_pull_are_those_of_its_resultant():
    body = loaded()
    pull = Loads(pulls=(Traction(tag=HIGH, stress=(0.0, 0.0, 3.0)),))
    moments = body.pull_moments(pull, np.array([0.25, 0.0, 9.0]), np.eye(3)[:2])
    # 6 N in the middle of a face of 2 mm × 1 mm
    assert moments == pytest.approx([6.0 * 0.75, 6.0 * 0.5], rel=1e-12)
    assert body.comm.size == MPI.COMM_SELF.size
