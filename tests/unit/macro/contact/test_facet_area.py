"""The border of contact within facets: closed forms, every element's lattice."""

import numpy as np
import pytest

from patchlaw.macro.contact.face_nodes import covered, facet_lattice

# a triangle with two legs of one along the axes; edges opposite its corners
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
EDGES = np.array([[np.sqrt(2.0), 1.0, 1.0]])


@pytest.mark.parametrize("at", [0.05, 0.3, 0.8])
@pytest.mark.parametrize("inside", [True, False])
def test_straight_border_is_found_where_the_fields_put_it(at, inside):
    distance = (at - CORNERS[:, 0]) * (1.0 if inside else -1.0)  # positive in contact
    kappa = 7.0
    pressure = kappa * np.sqrt(np.maximum(distance, 0.0))
    gap = 4.0 / 3.0 * kappa * np.maximum(-distance, 0.0) ** 1.5
    share = covered((distance > 0.0)[None], pressure[None], gap[None], EDGES)
    left = 1.0 - (1.0 - at) ** 2
    # exact on the leg; on the slanted edge distances are √2 longer than across the border
    assert share[0] == pytest.approx(left if inside else 1.0 - left, abs=0.07)


def test_border_across_one_edge_is_exact():
    # along an edge of length h at a distance s from its inner end
    for s, h in ((0.2, 1.0), (0.9, 2.0)):
        pressure = np.array([[np.sqrt(s), 0.0, 0.0]])
        gap = np.array([[0.0, 4.0 / 3.0 * (h - s) ** 1.5, 4.0 / 3.0 * (h - s) ** 1.5]])
        share = covered(gap == 0.0, pressure, gap, np.full((1, 3), h))
        assert share[0] == pytest.approx((s / h) ** 2, rel=1e-10)


def test_all_none_and_closed_neighbours():
    flags = np.array([[True] * 3, [False] * 3, [True, True, False]])
    none = np.zeros((3, 3))
    # a neighbour without a gap touches as well
    np.testing.assert_array_equal(covered(flags, none, none, np.ones((3, 3))), [1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("cell", "degree", "nodes", "triangles"),
    [
        ("hexahedron", 1, 4, 4),
        ("hexahedron", 2, 9, 16),
        ("tetrahedron", 1, 3, 1),
        ("tetrahedron", 2, 6, 4),
    ],
)
def test_facets_are_cut_between_their_nodes(cell, degree, nodes, triangles):
    lattice = facet_lattice(cell, degree)
    assert lattice.nodes.shape == (6 if cell == "hexahedron" else 4, nodes)
    assert all(len(set(row)) == nodes for row in lattice.nodes.tolist())
    assert lattice.corners.shape == (triangles, 3)
    assert set(lattice.corners.ravel()) == set(range(nodes))
