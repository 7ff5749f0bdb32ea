"""The Hertz contact equivalent to caps."""

import numpy as np
import pytest

from geometry import Surface
from micro import HertzContact
from micro.islands.shapes import islands
from micro.islands.watersheds import Watersheds


def bumps(*summits, grid=256):
    """Paraboloids (x, y, z, R', R'', angle) on a 1 mm square, the highest at every point."""
    x = (np.arange(grid) + 0.5) / grid
    heights = np.full((grid, grid), -np.inf)
    for px, py, z, major, minor, angle in summits:
        u = np.cos(angle) * (x[:, None] - px) + np.sin(angle) * (x - py)
        v = np.cos(angle) * (x - py) - np.sin(angle) * (x[:, None] - px)
        heights = np.maximum(heights, z - u**2 / (2 * major) - v**2 / (2 * minor))
    return Surface(heights=heights, lengths=(1.0, 1.0))


@pytest.mark.parametrize(("major", "angle"), [(0.3, 0.0), (1.2, 0.4), (3.0, 2.5)])
def test_single_cap_is_its_paraboloid(major, angle):
    sheds = Watersheds.of(bumps((0.49, 0.52, 0.0, major, 0.3, angle)))
    found = islands(sheds, np.array([8e-3]), np.zeros(1, dtype=int))
    hertz = HertzContact(
        contact_modulus=1.0, radius_major=major, radius_minor=0.3, indentation=8e-3
    )
    # Midpoint sums over more than 3000 samples.
    assert found.force == pytest.approx([hertz.force], rel=1e-3)
    assert found.semi_axes[0] == pytest.approx([hertz.semi_major, hertz.semi_minor], rel=3e-3)
    assert (found.x[0], found.y[0]) == pytest.approx((0.49, 0.52), abs=1e-5)
    if major > 0.3:
        assert np.sin(found.angle[0] - angle) == pytest.approx(0.0, abs=1e-2)


def test_merged_caps_add_volume():
    pair = bumps((0.42, 0.5, 0.0, 0.2, 0.2, 0.0), (0.58, 0.5, 0.0, 0.2, 0.2, 0.0))
    sheds = Watersheds.of(pair)
    height = np.where(sheds.z > -1e-6, 6e-3, -1.0)
    numbers = np.arange(len(sheds))
    two, one = islands(sheds, height, numbers), islands(sheds, height, 0 * numbers)
    assert len(two) == 2 and len(one) == 1
    # P = 4/3 √R F1 w^1.5 with twice the R and F1 > 1 for the slender shape of the pair.
    assert np.sqrt(2.0) < one.force[0] / two.force[0] < 2.0
    assert (one.x[0], one.y[0]) == pytest.approx((0.5, 0.5), abs=1e-4)
    assert abs(np.sin(one.angle[0])) < 1e-2


def test_displacements_leave_out_the_own_island():
    sheds = Watersheds.of(bumps((0.3, 0.5, 0.0, 0.2, 0.2, 0.0), (0.7, 0.5, 0.0, 0.2, 0.2, 0.0)))
    height = np.where(sheds.z > -1e-6, 2e-3, -1.0)
    found = islands(sheds, height, np.arange(len(sheds)))
    moved = (found.kernel(sheds.x, sheds.y) @ found.force)[height > 0.0]
    assert moved == pytest.approx(found.force / (np.pi * 0.4), rel=1e-4)
    # At its own centre an island displaces by its depth, no more.
    x, y = (np.full(len(sheds), place) for place in (found.x[0], found.y[0]))
    alone = found.kernel(x, y) @ found.force
    other = np.flatnonzero((height > 0.0) & (found.member == 1))
    beyond = alone[other][0]
    assert beyond == pytest.approx(found.depth[0], rel=1e-12)


def test_nothing_above():
    sheds = Watersheds.of(bumps((0.5, 0.5, 0.0, 0.2, 0.2, 0.0)))
    found = islands(sheds, np.full(len(sheds), -1.0), np.zeros(len(sheds), dtype=int))
    assert len(found) == 0
    assert found.kernel(sheds.x, sheds.y).shape == (len(sheds), 0)


def test_same_shapes_at_other_depths_carry_by_hertz():
    sheds = Watersheds.of(bumps((0.3, 0.5, 0.0, 0.2, 0.2, 0.0), (0.7, 0.5, 0.0, 0.2, 0.2, 0.0)))
    height = np.where(sheds.z > -1e-6, 2e-3, -1.0)
    found = islands(sheds, height, np.arange(len(sheds)))
    deeper = found.under(4.0 * found.depth)
    assert deeper.force == pytest.approx(8.0 * found.force, rel=1e-14)
    assert deeper.semi_axes == pytest.approx(2.0 * found.semi_axes, rel=1e-14)
    np.testing.assert_array_equal(found.depth[found.member[found.top]], height[found.top])
