"""Tetrahedra that are small only where contact can occur."""

import gmsh
import numpy as np
import pytest

from geometry import InputError, Surface
from geometry.meshes.families import depth_below_plane, places_in_reach
from geometry.meshes.refined_block import RefinedShape


def shape(**changes):
    content = {
        "interface": (1.0, 0.8),
        "height": 0.5,
        "places": np.array([[0.3, 0.4]]),
        "fine": 0.02,
        "coarse": 0.2,
    }
    return RefinedShape(**(content | changes))


def edges_of(model):
    """Return midpoints and lengths of the edges of all tetrahedra."""
    tags, coordinates, _ = model.mesh.getNodes()
    place = dict(zip(tags, coordinates.reshape(-1, 3), strict=True))
    _, nodes = model.mesh.getElementsByType(4)
    corners = np.array([place[node] for node in nodes]).reshape(-1, 4, 3)
    pairs = [(i, j) for i in range(4) for j in range(i)]
    ends = np.concatenate([corners[:, [i, j]] for i, j in pairs])
    return ends.mean(axis=1), np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)


def test_sizes_follow_the_distance():
    with shape().meshed() as model:
        middle, length = edges_of(model)
        assert model.getPhysicalGroups() == [(3, 1)]
    distance = np.linalg.norm(middle - [0.3, 0.4, 0.0], axis=1)
    near, far = length[distance < 0.03], length[distance > 0.6]
    # gmsh keeps sizes on average, single edges within a factor
    assert np.median(near) == pytest.approx(0.02, rel=0.35)
    assert 0.08 < np.median(far) < 0.3
    wanted = np.minimum(0.02 + 0.25 * np.maximum(distance - 0.04, 0.0), 0.2)
    assert np.median(length / wanted) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(("element", "kind"), [("P1", 4), ("P2", 11)])
def test_geometry_has_the_order_of_the_element(element, kind):
    with shape(element=element).meshed() as model:
        kinds, _, _ = model.mesh.getElements(3)
    assert list(kinds) == [kind]  # gmsh's numbers of tetrahedra with 4 and 10 nodes


def test_no_place_is_stepped_over():
    """Large triangles all around: gmsh's frontal algorithm puts no node near the small ones."""
    ticks = np.linspace(0.0, 1.0, 24)
    lattice = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    near = lattice[np.linalg.norm(lattice - 0.5, axis=1) < 0.14]
    places = np.vstack([near, [[0.5, 0.5]]])
    small = shape(
        interface=(1.0, 1.0), height=1.0, places=places, fine=0.05, coarse=0.29, growth=0.7
    )
    with small.meshed() as model:
        _, nodes, _ = model.mesh.getNodes(2, -1, includeBoundary=True)
    distance = np.linalg.norm(nodes.reshape(-1, 3) - [0.5, 0.5, 0.0], axis=1)
    # triangles of this edge have 2/√3 nodes per square of it: 14.5 in the disc; 1 was missed
    assert 10 <= np.count_nonzero(distance < 0.1) <= 20


def test_meshes_are_the_same_on_every_run():
    found = []
    for _ in range(2):
        with shape(fine=0.01).meshed() as model:
            found.append(model.mesh.getNodes()[1])
    np.testing.assert_array_equal(*found)


def test_sizes_of_the_callers_session_do_not_count():
    with shape().meshed() as model:
        expected = len(model.mesh.getNodes()[0])
    gmsh.initialize()
    try:
        gmsh.option.setNumber("Mesh.MeshSizeFactor", 3.0)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.1)
        with shape().meshed() as model:
            assert len(model.mesh.getNodes()[0]) == expected
        assert gmsh.option.getNumber("Mesh.MeshSizeFactor") == 3.0
    finally:
        gmsh.finalize()


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
        ({"fine": 0.0}, "edge lengths are out of range"),
        ({"growth": 0.0}, "height and growth must be positive"),
        ({"height": np.inf}, "height and growth must be positive"),
        ({"places": np.empty((0, 2))}, "places have two coordinates"),
        ({"places": np.zeros((4, 3))}, "places have two coordinates"),
        ({"places": np.array([[0.3, 0.4], [0.3, 0.9]])}, "lies outside the interface"),
        ({"places": np.array([[np.nan, 0.4]])}, "lies outside the interface"),
        ({"interface": (1.0, -1.0)}, "interface"),
    ],
)
def test_impossible_shapes_are_refused(changes, text):
    with pytest.raises(InputError, match=text):
        shape(**changes)


@pytest.mark.parametrize("size", [2.0**-40, 2.0**30])
def test_blocks_of_any_size_have_the_same_mesh(size):
    """The CAD kernel takes what is shorter than 1e-7 for nothing."""
    other = shape(
        interface=(size, 0.8 * size),
        height=0.5 * size,
        places=size * np.array([[0.3, 0.4]]),
        fine=0.02 * size,
        coarse=0.2 * size,
    )
    with shape().meshed() as model:
        expected = model.mesh.getNodes()[1]
    with other.meshed() as model:
        np.testing.assert_array_equal(model.mesh.getNodes()[1], expected)
    assert other.unit == size * shape().unit


def test_what_is_in_the_last_digits_does_not_change_the_mesh():
    """Summits are found to 1e-9 of a length; a triangle flipped moves the force by 1e-4."""
    random = np.random.default_rng(3)
    places = random.uniform(0.1, 0.7, (60, 2))
    found = []
    for size, error in ((1.0, 0.0), (1e3, 0.0), (1.0, 1e-9), (1.0, 1e-9)):
        near = {
            "interface": (size, 0.8 * size),
            "height": 0.5 * size,
            "places": size * (places + error * random.standard_normal(places.shape)),
            "fine": 0.02 * size,
            "coarse": 0.2 * size,
        }
        with shape(**near).meshed() as model:
            found.append(model.mesh.getNodes()[1])
    assert all(np.array_equal(found[0], other) for other in found[1:])
