"""Measures of the contacts that a plane cuts off, on shapes whose measures are known."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import Surface
from micro.choice.expected_errors import contact_measures, grid_error


def paraboloid(centre=(0.5, 0.5), ratio=1.0, cells=160):
    x = (np.arange(cells) + 0.5) / cells
    heights = -((x[:, None] - centre[0]) ** 2) - ratio * (x - centre[1]) ** 2
    return Surface(heights=heights, lengths=(1.0, 1.0))


def test_one_cap():
    at = contact_measures(paraboloid(), 0.04)
    # Hertz: a² = R δ with R = 1/2 mm, so a = 0.1414 mm, 22.6 cells; pixels count to 2 %.
    assert at.cells_per_radius == pytest.approx(160 * np.sqrt(0.02), rel=0.02)
    assert at.contact_fraction == pytest.approx(np.pi * 0.02, rel=0.02)
    assert at.crowding == pytest.approx(np.sqrt(0.02), rel=0.02)  # one summit on 1 mm²
    assert (at.regions, at.border_share) == (1, 0.0)
    assert at.eccentricity == pytest.approx(0.0, abs=0.02)


def test_the_eccentricity_of_an_elliptic_cap():
    # Region x² + 4 y² < δ: semi-axes 2 to 1, e² = 3/4; its pixels give it to 1 %.
    at = contact_measures(paraboloid(ratio=4.0), 0.04)
    assert at.eccentricity == pytest.approx(np.sqrt(0.75), rel=0.01)


@pytest.mark.parametrize("shape", [(640, 40), (40, 640)])
def test_cells_that_are_not_square_change_no_contact(shape):
    x, y = ((np.arange(n) + 0.5) / n for n in shape)
    heights = -((x[:, None] - 0.5) ** 2) - (y - 0.5) ** 2
    at = contact_measures(Surface(heights=heights, lengths=(1.0, 1.0)), 0.04)
    assert at.eccentricity**2 < 0.03  # pixels of 1 : 16 err by 2 % in a moment
    assert at.crowding == pytest.approx(np.sqrt(0.02), rel=0.02)
    # 40 cells across the coarser way count; the ratio is that of contact radius and wavelength
    assert at.cells_per_radius == pytest.approx(40 * np.sqrt(0.02), rel=0.02)
    square = contact_measures(paraboloid(), 0.04)
    ratio = at.cells_per_radius / at.cells_per_wave
    assert ratio == pytest.approx(square.cells_per_radius / square.cells_per_wave, rel=0.05)


def test_the_border_cuts_a_cap():
    assert contact_measures(paraboloid(centre=(0.0, 0.5)), 0.04).border_share == 1.0


def test_the_cells_of_a_single_wave():
    x = (np.arange(96) + 0.5) / 96
    wave = Surface(
        heights=np.cos(8 * np.pi * x)[:, None] * np.ones(96), lengths=(1.0, 1.0), periodic=True
    )
    at = contact_measures(wave, 0.1)
    assert at.cells_per_wave == pytest.approx(24.0, rel=1e-9)


def test_no_wave_is_shorter_than_two_cells():
    squares = Surface(heights=np.indices((20, 20)).sum(axis=0) % 2 * 1e-2, lengths=(1.0, 1.0))
    at = contact_measures(squares, 3e-3)
    assert at.cells_per_wave == pytest.approx(2.0, rel=1e-12)
    assert np.isfinite(grid_error(at, 1.0))


def test_a_plane_between_the_samples_and_the_highest_point():
    surface = paraboloid(cells=16)  # its summit lies between four samples
    gap = surface.highest - surface.heights.max()
    at = contact_measures(surface, 0.5 * gap)
    assert at.regions == 0
    assert 0.0 < at.cells_per_radius < 1.0
