"""Radius of a typical contact against Hertz', and where there is none."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Spectrum, Surface, suggested_fine, synthesise
from patchlaw.geometry.meshes.refined_block import contact_radius

ROUGH = synthesise(
    Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1),
    grid=(128, 128),
    lengths=(1.0, 1.0),
)
FLAT = Surface(heights=np.zeros((16, 16)), lengths=(1.0, 0.6))
RADIUS = 0.8


def sphere(n=129):
    x = (np.arange(n) + 0.5) / n - 0.5
    return Surface(heights=-(x[:, None] ** 2 + x**2) / (2.0 * RADIUS), lengths=(1.0, 1.0))


@pytest.mark.parametrize("approach", [2e-3, 8e-3])
def test_radius_is_that_of_hertz(approach):
    # distances from pixels of 1/258 outside: a sixth of a pixel, three times, in 0.04 and 0.08
    assert contact_radius(sphere(), approach) == pytest.approx(np.sqrt(RADIUS * approach), rel=0.04)


def test_radius_under_a_tilted_plane():
    tilt = (0.1, -0.05)
    # −r²/2R + t·r has its highest point R t²/2 above the middle
    depth = 2e-3 + 0.5 * RADIUS * np.dot(tilt, tilt)
    found = contact_radius(sphere(), 2e-3, tilt=tilt)
    assert found == pytest.approx(np.sqrt(RADIUS * depth), rel=0.04)


def test_merging_contacts_do_not_coarsen_the_mesh():
    x, y = (ROUGH.x[:, None], ROUGH.y[None, :])
    crowd = Surface(heights=0.01 * np.cos(8 * np.pi * x) * np.cos(8 * np.pi * y), lengths=(1, 1))
    assert contact_radius(crowd, 0.019) == pytest.approx(contact_radius(crowd, 0.012), rel=1e-3)
    assert contact_radius(crowd, 0.012) < 0.125 / 4  # a quarter of the distance of the summits
    assert contact_radius(crowd, 1e-4) < contact_radius(crowd, 1e-3) < contact_radius(crowd, 0.012)


def test_surfaces_without_summits():
    assert contact_radius(FLAT, 1e-3) == 0.3  # contact of all of it
    assert contact_radius(ROUGH, -1e-3) == ROUGH.spacing[0]


@pytest.mark.parametrize("edges", [0.0, -1.0, np.inf])
def test_impossible_numbers_of_edges_are_refused(edges):
    with pytest.raises(InputError, match=f"edges = {edges}: must be"):
        suggested_fine(ROUGH, 8e-3, edges=edges)
