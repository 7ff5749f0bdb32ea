"""Mirrored surfaces continue without a step, and keep their heights."""

import numpy as np

from geometry import Surface, mirrored


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
