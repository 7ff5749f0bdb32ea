"""Surfaces made from others: the sum of two that face each other, mirror images."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Surface, facing, laid_on, mirrored, turned_over


def surface(heights, lengths=(2.0, 1.0), **kwargs):
    return Surface(heights=heights, lengths=lengths, **kwargs)


RANDOM = np.random.default_rng(1).normal(scale=0.05, size=(8, 4))
SQUARE = np.random.default_rng(2).normal(scale=0.05, size=(8, 8))


def test_a_surface_turned_over_has_its_heights_at_the_mirrored_place():
    first, second = surface(0.0 * RANDOM), surface(RANDOM, notes=("few heights",))
    whole = facing(first, turned_over(second))
    x, y = np.array([0.3, 1.7]), np.array([0.2, 0.6])
    # the same spline, mirrored
    assert whole.height_at(x, y) == pytest.approx(second.height_at(2.0 - x, y), rel=1e-12)
    assert whole.notes == ("counter-surface: few heights",)


def test_a_mirror_image_doubles_the_heights():
    one = surface(RANDOM, periodic=True)
    both = facing(one, turned_over(surface(RANDOM[::-1], periodic=True)))
    assert np.array_equal(both.heights, 2.0 * one.heights) and both.periodic


@pytest.mark.parametrize(
    ("other", "text"),
    [
        (surface(RANDOM[:6]), r"\[6, 4\]: has not the heights .*allowed: \[8, 4\]"),
        (surface(RANDOM, (2.0, 1.1)), r"\[2.0, 1.1\]: has not the sides .*\[2.0, 1.0\] mm"),
    ],
)
def test_surfaces_that_do_not_fit_are_refused(other, text):
    with pytest.raises(InputError, match=text):
        facing(surface(RANDOM), other)


def test_quarters_of_a_turn_and_whole_cells_are_exact():
    one = surface(SQUARE[:6, :6], periodic=True, lengths=(1.0, 1.0))
    for turns in range(-4, 5):
        turned = laid_on(one, one, angle=90.0 * turns)
        np.testing.assert_array_equal(turned.heights, np.rot90(one.heights, turns))
        assert turned.periodic
    moved = laid_on(one, one, shift=(2 / 6, -1 / 6))
    np.testing.assert_array_equal(moved.heights, np.roll(one.heights, (2, -1), axis=(0, 1)))
    # a point at (x, y) from the middle comes to (−y, x)
    turned = laid_on(one, one, angle=90.0)
    at = np.array([0.13, -0.21])
    assert turned.height_at(0.5 - at[1], 0.5 + at[0]) == pytest.approx(
        float(one.height_at(*(0.5 + at))), abs=1e-12
    )


def test_other_turns_and_shifts_are_those_of_the_interpolant():
    """A plane wave in closed form, turned by 30 degrees and moved by parts of a cell."""
    x = (np.arange(96) + 0.5) / 96
    wave = surface(np.cos(2 * np.pi * x)[:, None] * np.ones(96), periodic=True, lengths=(1.0, 1.0))
    small = surface(np.zeros((8, 8)), lengths=(0.4, 0.4))
    angle, shift = np.radians(30.0), (0.031, -0.017)
    found = laid_on(small, wave, shift=shift, angle=30.0)
    dx, dy = small.x[:, None] - 0.2 - shift[0], small.y - 0.2 - shift[1]
    along = np.cos(angle) * dx + np.sin(angle) * dy
    np.testing.assert_allclose(found.heights, np.cos(2 * np.pi * (along + 0.5)), atol=1e-6)
    assert found.lengths == small.lengths
    assert not found.periodic


def test_a_larger_map_is_cut_where_it_lies():
    large = surface(SQUARE, lengths=(1.0, 1.0))
    small = surface(np.zeros((4, 4)), lengths=(0.5, 0.5))
    found = laid_on(small, large, shift=(1 / 8, -2 / 8))
    np.testing.assert_allclose(found.heights, large.heights[1:5, 4:8], atol=1e-12)
    with pytest.raises(InputError):
        laid_on(small, large, shift=(3 / 8, 0.0))


def test_mirrored_heights():
    surface = Surface(
        heights=np.arange(24.0).reshape(4, 6), lengths=(2.0, 3.0), source="map", notes=("a gap",)
    )
    whole = mirrored(surface)
    assert (whole.grid, whole.lengths, whole.periodic) == ((8, 12), (4.0, 6.0), True)
    assert whole.spacing == surface.spacing
    assert (whole.source, whole.notes) == ("map, mirrored", ("a gap",))
    np.testing.assert_array_equal(whole.heights[:4, :6], surface.heights)
    np.testing.assert_array_equal(whole.heights, whole.heights[::-1])
    np.testing.assert_array_equal(whole.heights, whole.heights[:, ::-1])
    assert whole.mean_height == surface.mean_height


def test_a_mirrored_slope_has_a_crease_and_no_step():
    surface = Surface(heights=np.outer(np.arange(8.0), np.ones(4)), lengths=(8.0, 4.0))
    around = np.append(mirrored(surface).heights[:, 0], 0.0)
    assert np.abs(np.diff(around)).max() == 1.0
