"""Tetrahedra that are small only where contact can occur."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import RefinedShape, Surface, places_in_reach
from patchlaw.geometry.meshes.refined_block import EdgeLengths, depth_below_plane


def shape(**changes):
    content = {
        "interface": (1.0, 0.8),
        "height": 0.5,
        "places": np.array([[0.3, 0.4]]),
        "fine": 0.02,
        "coarse": 0.2,
    }
    return RefinedShape(**(content | changes))


def edges_of(mesh):
    """Return midpoints and lengths of the edges of all tetrahedra."""
    corners = mesh.points[mesh.cells]
    pairs = [(i, j) for i in range(4) for j in range(i)]
    ends = np.concatenate([corners[:, [i, j]] for i, j in pairs])
    return ends.mean(axis=1), np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)


def volumes(mesh):
    corners = mesh.points[mesh.cells]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0


def test_sizes_follow_the_distance():
    middle, length = edges_of(shape().meshed())
    distance = np.linalg.norm(middle - [0.3, 0.4, 0.0], axis=1)
    depth = -middle[:, 2]
    wanted = np.minimum(0.02 + 0.25 * np.maximum(distance - 0.04, 0.0), 0.2 + 0.25 * depth)
    assert np.all(length <= 1.75 * wanted * (1.0 + 1e-12))
    # the lengths of bisected cells lie within a factor of 2^(1/3) of each other, and so on average
    assert np.median(length / wanted) == pytest.approx(1.0, abs=0.3)


def test_tetrahedra_fill_the_block():
    mesh = shape(interface=(1.0, 0.5), height=0.7).meshed()
    assert volumes(mesh).sum() == pytest.approx(0.35, rel=1e-12)
    corners = mesh.points[mesh.facets]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(across, axis=1).sum()
    assert area == pytest.approx(2.0 * (0.5 + 0.7 + 0.35), rel=1e-12)


def test_places_may_have_edges_of_their_own():
    two = np.array([[0.2, 0.4], [0.8, 0.4]])
    sizes = EdgeLengths(shape(places=two, relative=np.array([1.0, 3.0])))
    at_places = sizes(np.column_stack([two, np.zeros(2)])) / 1.75
    np.testing.assert_allclose(at_places, [0.02, 0.06], rtol=1e-12)
    middle, length = edges_of(shape(places=two, relative=np.array([1.0, 3.0])).meshed())
    near = [length[np.linalg.norm(middle[:, :2] - place, axis=1) < 0.05] for place in two]
    assert np.median(near[1]) > 2.0 * np.median(near[0])


def test_edges_at_a_hollow_are_a_fifth_of_those_around_and_grow_from_there():
    hollow = np.array([[[0.83, 0.07, -0.41], [0.83, 0.71, -0.41]]])
    points = hollow[0, 1] + [[0.0, 0.0, 0.0], [0.0, 0.03, 0.0]]  # its end, and beyond it
    around = EdgeLengths(shape(coarse=0.05))(points[:1])
    assert around == pytest.approx(1.75 * (0.05 + 0.25 * 0.41), rel=1e-12)
    found = EdgeLengths(shape(coarse=0.05), hollow)(points)
    assert found == pytest.approx(0.2 * around + [0.0, 1.75 * 0.25 * 0.03], rel=1e-12)


def test_places_are_where_the_plane_can_come():
    x = (np.arange(32) + 0.5) / 32
    heights = -0.5 * ((x[:, None] - 0.5) ** 2 + (x - 0.25) ** 2)
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    places = places_in_reach(surface, 5e-3, spacing=0.01)
    radius = np.hypot(places[:, 0] - 0.5, places[:, 1] - 0.25)
    assert radius.max() == pytest.approx(0.1, abs=0.01)  # r² / 2 = 5e-3
    assert len(places) == pytest.approx(np.pi * 10**2, rel=0.1)
    assert len(places_in_reach(surface, 0.0, spacing=0.3)) == 1


def test_depth_is_counted_from_the_tilted_plane():
    x = (np.arange(16) + 0.5) / 16
    slope = Surface(heights=np.tile(0.1 * x[:, None], 16), lengths=(1.0, 1.0))
    points = np.array([[0.0, 0.5], [0.5, 0.5], [1.0, 1.0]])
    depth = depth_below_plane(slope, *points.T, 0.01, (0.2, 0.4))
    # the summit, 0.1 high, is at x = 1
    np.testing.assert_allclose(depth, [0.01 - 0.1 - 0.1, 0.01 - 0.05, 0.01 + 0.1 + 0.2], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"element": "Q1"}, "element is unknown"),
        ({"fine": 0.3}, "edge lengths are out of range"),
        ({"fine": 0.0}, "fine = 0.0: must be greater than 0"),
        ({"growth": 0.0}, "growth = 0.0: must be greater than 0"),
        ({"height": np.inf}, "height = inf: must be a finite number"),
        ({"places": np.empty((0, 2))}, "places have two coordinates"),
        ({"places": np.zeros((4, 3))}, "places have two coordinates"),
        ({"places": np.array([[0.3, 0.4], [0.3, 0.9]])}, "lies outside the interface"),
        ({"places": np.array([[np.nan, 0.4]])}, "lies outside the interface"),
        ({"interface": (1.0, -1.0)}, "interface"),
        ({"relative": np.ones(2)}, "relative edge lengths do not fit the places"),
        ({"relative": np.zeros(1)}, "relative edge lengths do not fit the places"),
    ],
)
def test_impossible_shapes_are_refused(changes, text):
    with pytest.raises(InputError, match=text):
        shape(**changes)


@pytest.mark.parametrize("size", [2.0**-40, 2.0**30])
def test_blocks_of_any_size_have_the_same_mesh(size):
    other = shape(
        interface=(size, 0.8 * size),
        height=0.5 * size,
        places=size * np.array([[0.3, 0.4]]),
        fine=0.02 * size,
        coarse=0.2 * size,
    )
    expected, found = shape().meshed(), other.meshed()
    np.testing.assert_array_equal(found.cells, expected.cells)
    np.testing.assert_allclose(found.points, size * expected.points, rtol=1e-12)
