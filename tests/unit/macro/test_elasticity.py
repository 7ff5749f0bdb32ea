"""Rigid body modes, and what supports bear by them."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from helpers.body_meshes import HIGH, LOW, box
from mpi4py import MPI

from patchlaw.geometry import BlockShape
from patchlaw.macro import Block, Material, MeshedBody, Support, TaggedMesh, block_mesh, compat
from patchlaw.macro.elastic_body import rigid_body_modes


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
