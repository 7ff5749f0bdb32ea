"""Maxima of the interpolant in the closed rectangle."""

import numpy as np
import pytest

from geometry import Surface
from geometry.ascent import constrained_summits

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
    slope = Surface(heights=np.add.outer(x, x), lengths=(1.0, 1.0))  # no summit within a cell
    assert constrained_summits(slope, start) == pytest.approx(start)
    assert constrained_summits(slope, np.empty((0, 2))).shape == (0, 2)
