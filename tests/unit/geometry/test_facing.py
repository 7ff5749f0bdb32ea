"""The sum of two rough surfaces that face each other."""

import numpy as np
import pytest

from geometry import InputError, Surface, facing, turned_over


def surface(heights, lengths=(2.0, 1.0), **kwargs):
    return Surface(heights=heights, lengths=lengths, **kwargs)


RANDOM = np.random.default_rng(1).normal(size=(8, 4))


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
