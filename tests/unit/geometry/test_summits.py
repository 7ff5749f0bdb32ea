"""Maxima of the interpolant in the closed rectangle."""

import numpy as np
import pytest

from patchlaw.geometry import Surface
from patchlaw.geometry.asperities import coincident, constrained_summits, grid_maxima

N = 20


def dome(cx, cy):
    x = (np.arange(N) + 0.5) / N
    return Surface(heights=-((x[:, None] - cx) ** 2) - 2 * (x - cy) ** 2, lengths=(1.0, 1.0))


@pytest.mark.parametrize(
    ("centre", "expected"),
    [
        ((0.52, 0.48), (0.52, 0.48)),  # inside
        ((-0.3, 0.48), (0.0, 0.48)),  # falls from the edge inward: maximum along the edge
        ((0.52, 1.4), (0.52, 1.0)),
        ((-0.3, 1.4), (0.0, 1.0)),  # corner
    ],
)
def test_quadratic_is_climbed_exactly(centre, expected):
    start = np.clip(np.floor(np.array(expected) * N), 0, N - 1)
    found = constrained_summits(dome(*centre), (start[None] + 0.5) / N)
    assert found[0] == pytest.approx(expected, abs=1e-12)  # the spline is the quadratic


def test_convex_flank_ends_on_the_edge():
    x = (np.arange(N) + 0.5) / N
    ridge = Surface(heights=(x[:, None] - 0.9) ** 2 - (x - 0.5) ** 2, lengths=(1.0, 1.0))
    assert constrained_summits(ridge, np.array([[0.025, 0.525]]))[0] == pytest.approx(
        (0.0, 0.5), abs=1e-12
    )


def test_stays_where_nothing_is_gained():
    x = (np.arange(N) + 0.5) / N
    saddle = Surface(heights=(x[:, None] - 0.5) ** 2 - (x - 0.5) ** 2, lengths=(1.0, 1.0))
    start = np.array([[0.5, 0.5]])
    assert constrained_summits(saddle, start) == pytest.approx(start)
    flat = Surface(heights=np.full((N, N), 3.0), lengths=(1.0, 1.0))
    assert constrained_summits(flat, start) == pytest.approx(start)
    assert constrained_summits(flat, np.empty((0, 2))).shape == (0, 2)


def test_climbs_slopes_and_oblique_ridges_to_their_end():
    """Samples on such a ridge are higher than their neighbours, many cells from the summit."""
    x = (np.arange(N) + 0.5) / N
    slope = Surface(heights=np.add.outer(x, x), lengths=(1.0, 1.0))
    assert constrained_summits(slope, np.array([[0.5, 0.5]]))[0] == pytest.approx((1.0, 1.0))
    u, v = np.add.outer(x, -x), np.add.outer(x, x) - 1.04
    ridge = Surface(heights=-10.0 * (u - 0.1) ** 2 - 0.01 * v**2, lengths=(1.0, 1.0))
    starts = np.array([[0.225, 0.125], [0.875, 0.775]])
    found = constrained_summits(ridge, starts)
    np.testing.assert_allclose(found, 2 * [[0.57, 0.47]], atol=1e-10)
    assert len(np.unique(coincident(ridge, found))) == 1
    assert len(np.unique(coincident(ridge, starts))) == 2


def flooded(heights):
    """Flood every plateau and look at all its neighbours: slow and obviously right."""
    nx, ny = heights.shape
    seen, found = set(), []

    def around(cell):
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                i, j = cell[0] + di, cell[1] + dj
                if 0 <= i < nx and 0 <= j < ny:
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
            found.append((start, len(plateau), edge))
    return found


@pytest.mark.parametrize("levels", [2, 3, 6, 1000])
@pytest.mark.parametrize("seed", range(3))
def test_maxima_and_plateaus_against_flooding(levels, seed):
    heights = np.random.default_rng(seed).integers(0, levels, (11, 8)).astype(float)
    expected = flooded(heights)
    maxima = grid_maxima(heights)
    assert len(maxima.height) == len(expected) > 0
    np.testing.assert_array_equal(maxima.height, [heights[start] for start, _, _ in expected])
    np.testing.assert_array_equal(maxima.on_border, [edge for _, _, edge in expected])
    alone = np.array([size == 1 for _, size, _ in expected])
    cells = np.array([start for start, _, _ in expected])
    np.testing.assert_array_equal(maxima.position[alone], cells[alone])


def test_a_plateau_counts_once_in_its_middle():
    heights = np.zeros((8, 9))
    heights[2:4, 3:6] = 1.0
    maxima = grid_maxima(heights)
    np.testing.assert_allclose(maxima.position, [[2.5, 4.0]])


def test_a_shoulder_is_no_maximum():
    heights = np.zeros((7, 7))
    heights[2:5, 2:5] = 1.0
    heights[4, 5] = 2.0  # touches the plateau's corner only
    assert grid_maxima(heights).height.tolist() == [2.0]


def test_a_flat_map_is_one_plateau():
    maxima = grid_maxima(np.zeros((6, 5)))
    assert maxima.height.tolist() == [0.0] and maxima.on_border.tolist() == [True]
