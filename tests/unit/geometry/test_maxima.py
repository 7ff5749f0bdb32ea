import numpy as np
import pytest

from geometry.maxima import grid_maxima


def flooded(heights, periodic):
    """Flood every plateau and look at all its neighbours: slow and obviously right."""
    nx, ny = heights.shape
    seen, found = set(), []

    def around(cell):
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                i, j = cell[0] + di, cell[1] + dj
                if periodic:
                    yield i % nx, j % ny
                elif 0 <= i < nx and 0 <= j < ny:
                    yield i, j

    for start in np.ndindex(nx, ny):
        if start in seen:
            continue
        plateau, todo, highest = {start}, [start], True
        while todo:
            for other in around(todo.pop()):
                if heights[other] > heights[start]:
                    highest = False
                if heights[other] == heights[start] and other not in plateau:
                    plateau.add(other)
                    todo.append(other)
        seen |= plateau
        edge = any(i in (0, nx - 1) or j in (0, ny - 1) for i, j in plateau)
        if highest:
            found.append((start, len(plateau), edge and not periodic))
    return found


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("levels", [2, 3, 6, 1000])
@pytest.mark.parametrize("seed", range(3))
def test_maxima_and_plateaus_against_flooding(levels, seed, periodic):
    heights = np.random.default_rng(seed).integers(0, levels, (11, 8)).astype(float)
    expected = flooded(heights, periodic)
    maxima = grid_maxima(heights, periodic=periodic)
    assert len(maxima.height) == len(expected) > 0
    np.testing.assert_array_equal(maxima.height, [heights[start] for start, _, _ in expected])
    np.testing.assert_array_equal(maxima.on_border, [edge for _, _, edge in expected])
    alone = np.array([size == 1 for _, size, _ in expected])
    cells = np.array([start for start, _, _ in expected])
    np.testing.assert_array_equal(maxima.position[alone], cells[alone])


def test_a_plateau_counts_once_in_its_middle():
    heights = np.zeros((8, 9))
    heights[2:4, 3:6] = 1.0
    maxima = grid_maxima(heights, periodic=False)
    np.testing.assert_allclose(maxima.position, [[2.5, 4.0]])


def test_a_plateau_across_a_periodic_border_counts_once():
    heights = np.zeros((8, 9))
    heights[[0, 0, -1, -1], [0, -1, 0, -1]] = 1.0
    maxima = grid_maxima(heights, periodic=True)
    assert maxima.position.shape == (1, 2) and not maxima.on_border[0]
    np.testing.assert_allclose(np.mod(maxima.position, (8, 9)), [[7.5, 8.5]])
    assert grid_maxima(heights, periodic=False).on_border.sum() == 4


def test_a_shoulder_is_no_maximum():
    heights = np.zeros((7, 7))
    heights[2:5, 2:5] = 1.0
    heights[4, 5] = 2.0  # touches the plateau's corner only
    assert grid_maxima(heights, periodic=False).height.tolist() == [2.0]


def test_a_flat_map_is_one_plateau():
    maxima = grid_maxima(np.zeros((6, 5)), periodic=False)
    assert maxima.height.tolist() == [0.0] and maxima.on_border.tolist() == [True]
    assert grid_maxima(np.zeros((6, 5)), periodic=True).on_border.tolist() == [False]
