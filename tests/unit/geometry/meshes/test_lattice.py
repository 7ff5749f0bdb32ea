"""The closed division of a lattice's cells among ranks."""

import itertools

import numpy as np
import pytest

from patchlaw.geometry.meshes.block import (
    Segment,
    cells_beyond,
    lattice_cells,
    lattice_part,
    node_planes,
    node_share,
)

LATTICES = [(7, 5, 3), (1, 1, 1), (1, 2, 9), (40, 3, 2)]
CASES = list(itertools.product(LATTICES, (1, 2, 3, 4, 7, 12)))


def owners_of(cells, ranks):
    """Return who has every cell, filled in part by part; a cell twice is a cell too many."""
    owners = np.full(cells, -1)
    for rank in range(ranks):
        box = np.ix_(*lattice_part(cells, ranks, rank))
        assert (owners[box] == -1).all()
        owners[box] = rank
    return owners


@pytest.mark.parametrize(("cells", "ranks"), CASES)
def test_every_cell_belongs_to_one_rank(cells, ranks):
    owners = owners_of(cells, ranks)
    assert (owners >= 0).all()


@pytest.mark.parametrize("ranks", [2, 3, 5, 8, 16, 37])
def test_parts_are_even(ranks):
    counts = np.bincount(owners_of((60, 60, 40), ranks).ravel())
    # each of at most six halvings rounds to whole layers, the last of ten and more
    assert counts.max() * ranks <= 1.1 * counts.sum()


def test_few_faces_are_cut():
    owners = owners_of((24, 24, 24), 8)
    cut = sum((np.diff(owners, axis=axis) != 0).sum() for axis in range(3))
    assert cut == 3 * 24**2  # of a cube in eight cubes
    flat = owners_of((24, 24, 4), 4)
    assert sum((np.diff(flat, axis=axis) != 0).sum() for axis in range(3)) == 2 * 24 * 4


@pytest.mark.parametrize(("cells", "ranks"), CASES)
def test_ranks_beyond_faces(cells, ranks):
    owners = owners_of(cells, ranks)
    for rank in range(ranks):
        part = lattice_part(cells, ranks, rank)
        expected = set()
        for number, place in enumerate(itertools.product(*part)):
            for axis, step in itertools.product(range(3), (-1, 1)):
                beside = [at + step * (k == axis) for k, at in enumerate(place)]
                if 0 <= beside[axis] < cells[axis] and owners[tuple(beside)] != rank:
                    expected.add((number, owners[tuple(beside)]))
        pairs = list(zip(*cells_beyond(cells, ranks, part), strict=True))
        assert set(pairs) == expected and len(pairs) == len(expected)


def test_hexahedra_have_the_vertices_of_their_box():
    cells = (3, 4, 5)
    part = lattice_part(cells, 3, 1)
    corners = node_planes(cells, lattice_cells(cells, part, hexahedra=True).ravel())
    corners = corners.reshape(-1, 8, 3)
    np.testing.assert_array_equal(corners[:, 0], list(itertools.product(*part)))
    # x runs first, then y, then z
    steps = [(v % 2, v // 2 % 2, v // 4) for v in range(8)]
    np.testing.assert_array_equal(corners - corners[:, :1], np.broadcast_to(steps, corners.shape))


def test_tetrahedra_fill_their_boxes_and_meet_face_to_face():
    cells = (2, 3, 2)
    table = lattice_cells(cells, lattice_part(cells, 1, 0), hexahedra=False)
    corners = node_planes(cells, table.ravel()).reshape(-1, 4, 3)
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    np.testing.assert_allclose(volumes, 1.0 / 6.0, rtol=1e-12)  # round-off of a determinant
    boxes = corners.min(axis=1)
    assert (np.unique(boxes, axis=0, return_counts=True)[1] == 6).all()
    faces = np.concatenate([np.delete(np.sort(table, axis=1), k, axis=1) for k in range(4)])
    counts = np.unique(faces, axis=0, return_counts=True)[1]
    outer = 2 * 2 * (2 * 3 + 3 * 2 + 2 * 2)
    assert set(counts) == {1, 2} and (counts == 1).sum() == outer


@pytest.mark.parametrize("ranks", [1, 3, 100])
def test_shares_of_the_nodes_are_all_nodes_in_order(ranks):
    ticks = np.array([0.0, 0.1, 0.7]), np.array([-1.0, 2.0]), np.array([-3.0, -1.0, 0.0])
    shares = [node_share(ticks, ranks, rank) for rank in range(ranks)]
    assert max(map(len, shares)) - min(map(len, shares)) <= 1
    np.testing.assert_array_equal(np.concatenate(shares), list(itertools.product(*ticks)))


@pytest.mark.parametrize("cells, growth", [(1, 5.0), (4, 1.0), (4, 8.0), (3, 0.1)])
def test_segments_grow_geometrically(cells, growth):
    segment = Segment(start=-1.0, end=3.0, cells=cells, growth=growth)
    sizes = np.diff(segment.ticks)
    assert segment.ticks[0] == -1.0 and segment.ticks[-1] == 3.0 and len(sizes) == cells
    assert sizes[-1] / sizes[0] == pytest.approx(growth if cells > 1 else 1.0, rel=1e-12)
    ratio = growth ** (1.0 / max(cells - 1, 1))
    np.testing.assert_allclose(sizes[1:] / sizes[:-1], ratio, rtol=1e-12)
    assert segment.narrowest == pytest.approx(sizes.min(), rel=1e-12)
