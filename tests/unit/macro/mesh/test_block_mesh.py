"""The distributed mesh of a block."""

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from patchlaw.geometry import BlockShape, RefinedShape
from patchlaw.macro import BOTTOM, SIDES, TOP, block_mesh, compat
from patchlaw.support import InputError


@pytest.mark.parametrize("element", ["Q1", "P2"])
def test_faces_are_marked_and_complete(element):
    shape = BlockShape(
        interface=(1.0, 2.0), height=0.5, cells=(2, 3, 2), element=element,
        margin=0.3, margin_cells=1,
    )  # fmt: skip
    block = block_mesh(shape, MPI.COMM_SELF)
    assert block.mesh.topology.index_map(3).size_global == shape.cell_count
    per_quad = 1 if element == "Q1" else 2
    counts = {BOTTOM: 4 * 5, TOP: 4 * 5, SIDES: 2 * 2 * (4 + 5)}
    for marker, count in counts.items():
        assert len(block.facet_tags.find(marker)) == count * per_quad
    for marker, height in ((BOTTOM, -0.5), (TOP, 0.0)):
        middle = dmesh.compute_midpoints(block.mesh, 2, block.facet_tags.find(marker))
        assert (middle[:, 2] == height).all()  # nodes lie on the planes exactly
    outermost = dmesh.compute_midpoints(block.mesh, 2, block.facet_tags.find(SIDES))
    across = np.abs(outermost[:, :2] - [0.5, 1.0]) - [0.8, 1.3]
    np.testing.assert_allclose(across.max(axis=1), 0.0, atol=1e-14)  # round-off of midpoints


class Unmeshable(RefinedShape):
    """A block that cannot be meshed."""

    def meshed(self):
        raise InputError("meshing gave up")


def test_error_of_meshing_is_passed_on():
    shape = Unmeshable(
        interface=(1.0, 1.0), height=1.0, places=np.array([[0.5, 0.5]]), fine=0.5, coarse=0.5
    )
    with pytest.raises(InputError, match="meshing gave up"):
        block_mesh(shape, MPI.COMM_SELF)


@pytest.mark.parametrize("element", ["Q1", "P1"])
def test_planes_say_where_nodes_are(element):
    shape = BlockShape(
        interface=(1.0, 2.0), height=0.5, cells=(3, 2, 4), element=element, grading=7.0,
        margin=0.3, margin_cells=2, margin_grading=3.0,
    )  # fmt: skip
    block = block_mesh(shape, MPI.COMM_SELF)
    places = [ticks[block.planes[:, k]] for k, ticks in enumerate(shape.ticks)]
    np.testing.assert_array_equal(block.mesh.geometry.x, np.stack(places, axis=1))


@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_tables_of_a_mesh_fit_its_space(element):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2), element=element)
    mesh = block_mesh(shape, MPI.COMM_SELF).mesh
    space = compat.vector_space(mesh, shape.degree)
    nodes = {"Q1": 8, "Q2": 27, "P1": 4, "P2": 10}[element]
    assert compat.cell_nodes(space).shape == (shape.cell_count, nodes)
    corners = {"Q": 8, "P": 4}[element[0]]
    table = compat.cell_vertices(mesh)
    assert table.shape == (shape.cell_count, corners)
    # the first nodes of a cell are its vertices, in the same order
    places = space.tabulate_dof_coordinates()[compat.cell_nodes(space)[:, :corners]]
    np.testing.assert_allclose(places, mesh.geometry.x[table], atol=1e-14)  # round-off
    assert isinstance(fem.Function(space).x.array, np.ndarray)
