"""Refinement by bisection: conforming, within bounds of size and shape, with tags inherited."""

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from patchlaw.geometry.meshes import bisection
from patchlaw.geometry.meshes.bisection import Tetrahedra, from_hexahedra, reentrant_edges, refined
from patchlaw.geometry.meshes.block import lattice_cells

SIDES = np.array([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)])


def box(kept=lambda middle: np.ones(len(middle), bool), moved=0.1):
    """Return 2 × 2 × 2 boxes in tetrahedra, irregular inside, the outer facets above marked."""
    counts = (2, 2, 2)
    z, y, x = np.meshgrid(*[[0.0, 0.5, 1.0]] * 3, indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    cells = lattice_cells(counts, tuple(map(range, counts)), hexahedra=False)
    cells = cells[kept(points[cells].mean(axis=1))]
    inner = np.all((points > 0.0) & (points < 1.0), axis=1)
    points[inner] += np.random.default_rng(5).uniform(-moved, moved, (int(inner.sum()), 3))
    facets, counts = np.unique(
        np.sort(cells[:, SIDES].reshape(-1, 3), axis=1), axis=0, return_counts=True
    )
    facets = facets[counts == 1]
    top = np.all(points[facets, 2] == 1.0, axis=1)
    return Tetrahedra(
        points=points,
        cells=cells,
        cell_tags=(points[cells, 0].mean(axis=1) > 0.5).astype(np.int32),
        facets=facets,
        facet_tags=np.where(top, 7, -1).astype(np.int32),
    )


def volumes(points, cells):
    return np.abs(np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])) / 6.0


def areas(mesh, tag):
    a, b, c = np.swapaxes(mesh.points[mesh.facets[mesh.facet_tags == tag]], 0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def thinnest(mesh):
    """Return the least volume of a cell over the cube of its longest edge."""
    corners = mesh.points[mesh.cells]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    return (volumes(mesh.points, mesh.cells) / longest**3).min()


@pytest.fixture(scope="module")
def small():
    """A box with small cells at a corner of its top, and the size that was asked there."""

    def size(middles):
        return 0.03 + 0.5 * np.linalg.norm(middles - (0.2, 0.0, 1.0), axis=1)

    return box(), refined(box(), size), size


def test_cells_meet_facet_to_facet_and_fill_the_box(small):
    _, mesh, _ = small
    assert volumes(mesh.points, mesh.cells).sum() == pytest.approx(1.0, rel=1e-12)
    sides = np.sort(mesh.cells[:, SIDES].reshape(-1, 3), axis=1)
    facets, counts = np.unique(sides, axis=0, return_counts=True)
    assert counts.max() == 2
    own = np.sort(mesh.facets, axis=1)
    np.testing.assert_array_equal(facets[counts == 1], own[np.lexsort(own.T[::-1])])


def test_no_edge_is_longer_than_asked_and_angles_stay_bounded(small):
    begin, mesh, size = small
    pairs = np.array([(i, j) for i in range(4) for j in range(i)])
    ends = mesh.points[mesh.cells[:, pairs].reshape(-1, 2)]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert np.all(lengths <= size(ends.mean(axis=1)))
    assert lengths.min() > 0.4 * 0.03  # and not far smaller: the longest edge is halved
    assert len(mesh.cells) > 20 * len(begin.cells)
    assert thinnest(mesh) > 0.2 * thinnest(begin)


def test_tags_are_inherited(small):
    begin, mesh, _ = small
    for tag in (0, 1):
        parts = [volumes(m.points, m.cells[m.cell_tags == tag]).sum() for m in (begin, mesh)]
        assert parts[1] == pytest.approx(parts[0], rel=1e-12)
    assert areas(mesh, 7).sum() == pytest.approx(1.0, rel=1e-12)
    assert np.all(mesh.points[mesh.facets[mesh.facet_tags == 7], 2] == 1.0)
    assert areas(mesh, -1).sum() == pytest.approx(5.0, rel=1e-12)


def test_middles_lie_between_the_corners_that_dolfinx_expects(small):
    points, cells = bisection.with_middles(small[1])
    ends = np.array([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])
    np.testing.assert_array_equal(points[cells[:, 4:]], points[cells[:, ends]].mean(axis=2))
    assert len(np.unique(cells)) == len(points)


def test_with_an_edge_the_longest_of_every_facet_and_cell_with_it_is_divided():
    """Looked up one by one, on cells of every shape."""
    random = np.random.default_rng(8)
    points = random.random((60, 3))
    cells = np.asarray(Delaunay(points).simplices, dtype=np.int64)
    edges, of_cell = bisection._edges(cells)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    number = {tuple(edge): k for k, edge in enumerate(edges.tolist())}
    asked = random.random(len(edges)) < 0.03
    found = bisection._closed(asked, of_cell, bisection._order(lengths))
    assert found[asked].all() and not found.all()
    for cell in np.sort(cells).tolist():
        for size in (3, 4):
            for corners in combinations(cell, size):
                these = [number[pair] for pair in combinations(corners, 2)]
                assert found[max(these, key=lengths.__getitem__)] or not found[these].any()


def test_hexahedra_of_any_form_are_divided_without_gaps():
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    points = bits + np.random.default_rng(3).uniform(-0.15, 0.15, (8, 3))
    points = np.concatenate([points, points[:4] - (0.0, 0.0, 1.0)])
    cells = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11, 0, 1, 2, 3]])
    nodes, tetrahedra, triangles = from_hexahedra(points, cells, np.array([[4, 5, 6, 7]]))
    assert len(tetrahedra) == 48 and len(triangles) == 4
    sides = np.sort(tetrahedra[:, SIDES].reshape(-1, 3), axis=1)
    _, counts = np.unique(sides, axis=0, return_counts=True)
    assert np.sum(counts == 1) == 10 * 4  # the common side has none
    assert counts.max() == 2
    corners = nodes[tetrahedra]
    signs = np.sign(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    assert np.all(signs[:24] == signs[24:])  # none is folded


def test_hollow_edges_are_where_stresses_are_singular():
    corner = box(lambda middle: (middle[:, 0] < 0.5) | (middle[:, 2] < 0.5), moved=0.0)
    ends = reentrant_edges(corner)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(1.0)
    np.testing.assert_allclose(ends[..., [0, 2]], 0.5)
    assert not len(reentrant_edges(box()))
