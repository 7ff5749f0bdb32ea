"""The edges that bound a contact face."""

import numpy as np
import pytest
from helpers.block_cases import block_of
from mpi4py import MPI

from macro.mesh.contact_face import top_facets
from macro.mesh.face_edges import outer_edges


@pytest.mark.parametrize("kind", ["Q1", "P1"])
def test_edges_of_a_rectangle_are_its_sides(kind):
    block = block_of(interface=(3.0, 2.0), cells=(3, 4, 1), element=kind)
    edges = outer_edges(top_facets(block.mesh), MPI.COMM_SELF)
    assert len(edges.length) == 14
    assert edges.length.sum() == pytest.approx(10.0, rel=1e-12)
    x, y = edges.middle.T
    on_side = np.isclose(x % 3.0, 0.0) | np.isclose(y % 2.0, 0.0)
    assert on_side.all()
