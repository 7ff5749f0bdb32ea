"""First-order effect of finite slopes: invariance, homogeneity, refusals."""

import numpy as np
import pytest

from geometry import InputError, Spectrum, Surface, synthesise
from micro import HalfSpace, HalfSpaceModel, finite_slope_effect
from micro.finite_slope import _density, _surface_stresses

NU = 0.3
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=3), grid=(48, 40), lengths=(1.0, 0.9)
)


def model_of(surface, **changes):
    return HalfSpaceModel(surface=surface, contact_modulus=4000.0, **changes)


def effect(surface, approach):
    return finite_slope_effect(model_of(surface), approach, poisson_ratio=NU)


def test_moving_the_whole_surface_changes_nothing():
    """The half-space is the same one millimetre lower: the density has no mean."""
    parts = []
    for cells in (64, 128):
        x = (np.arange(cells) + 0.5) / cells - 0.5
        sphere = Surface(heights=-(x[:, None] ** 2 + x**2), lengths=(1.0, 1.0))
        state = model_of(sphere).solve(5e-3)
        kernels = _surface_stresses(HalfSpace(4000.0, NU), sphere.grid, sphere.spacing)
        density = _density(HalfSpace(4000.0, NU), kernels, state)
        parts.append(abs(density.sum()) / np.abs(density).sum())
    # what cells of uniform pressure leave at the contact's rim, and the far field cut off
    assert parts[1] < 0.05
    assert parts[1] < 0.7 * parts[0]


def test_effect_is_of_first_order():
    assert effect(SURFACE, 8e-3) < -0.01
    assert effect(SURFACE.scaled(0.1), 8e-4) == pytest.approx(0.1 * effect(SURFACE, 8e-3), rel=1e-4)


def test_heights_count_from_anywhere():
    higher = Surface(heights=SURFACE.heights + 5.0, lengths=SURFACE.lengths)
    same = Surface(heights=SURFACE.heights, lengths=SURFACE.lengths)
    # both without periodicity, so that they share one interpolant
    assert effect(higher, 8e-3) == pytest.approx(effect(same, 8e-3), rel=1e-6)


def test_nothing_touches():
    with pytest.raises(InputError, match="no contact at this approach"):
        effect(SURFACE, -1e-3)


def test_periodic_surfaces_are_refused():
    with pytest.raises(InputError, match="finite slopes are estimated on a free border"):
        finite_slope_effect(model_of(SURFACE, periodic=True), 8e-3, poisson_ratio=NU)
