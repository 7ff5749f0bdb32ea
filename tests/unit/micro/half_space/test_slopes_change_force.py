"""Change of the force by finite slopes: homogeneity, origin of heights, free sides."""

import pytest
from helpers.slope_effect import slope_effect

from patchlaw.geometry import Spectrum, Surface, synthesise
from patchlaw.micro import FreeSides, HalfSpaceModel

NU, E_STAR = 0.3, 4000.0
SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=3), grid=(48, 40), lengths=(1.0, 0.9)
)


def effect(surface, approach, *, tilt=(0.0, 0.0), **options):
    model = HalfSpaceModel(surface, contact_modulus=E_STAR, **options)
    return slope_effect(model, approach, NU, tilt)


@pytest.mark.parametrize("periodic", [False, True], ids=["free", "periodic"])
def test_effect_is_of_first_order_at_small_heights(periodic):
    whole, tenth, hundredth = (
        effect(SURFACE.scaled(by), 8e-3 * by, periodic=periodic) for by in (1.0, 0.1, 0.01)
    )
    assert whole < -0.005
    assert 10.0 * hundredth == pytest.approx(tenth, rel=0.1)  # second order is 5 % there


def test_heights_count_from_anywhere():
    higher = Surface(heights=SURFACE.heights + 5.0, lengths=SURFACE.lengths)
    same = Surface(heights=SURFACE.heights, lengths=SURFACE.lengths)
    # both without periodicity, so that they share one interpolant
    assert effect(higher, 8e-3) == pytest.approx(effect(same, 8e-3), rel=1e-4)


def test_free_sides_yield_more():
    sides = FreeSides(lengths=SURFACE.lengths, poisson_ratio=NU, decay_length=0.5)
    assert effect(SURFACE, 8e-3, sides=sides) < 1.1 * effect(SURFACE, 8e-3)


def test_tilted_plane_at_no_approach():
    """The plane touches beside the middle, where the approach is zero."""
    found = effect(SURFACE, 0.0, tilt=(0.0, 0.05))
    assert -0.1 < found < 0.0
