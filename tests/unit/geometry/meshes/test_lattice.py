"""The closed division of a lattice's cells among ranks."""

import itertools

import numpy as np
import pytest

from patchlaw.geometry.meshes.block import cells_beyond, lattice_part

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
