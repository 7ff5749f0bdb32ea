"""Contacts on many small blocks, which one or two threads work on."""

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.geometry.statistics import mean_squares
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.boundary_elements import half_space_grid, inverse
from patchlaw.support import parallel as cores
from patchlaw.support.parallel import allocated

HEIGHTS = synthesise(
    Spectrum(hurst=0.8, waves=(2, 40), rms_slope=0.1, seed=5), grid=(190, 193), lengths=(1.0, 1.0)
).heights


def small_blocks(monkeypatch):
    """Let work be done on blocks of a few rows or cells, as on grids that are far larger."""
    for owner in (cores, half_space_grid, inverse):
        monkeypatch.setattr(owner, "BLOCK", 2**14)


@pytest.mark.long
@pytest.mark.parametrize("hardness", [None, 0.03])
@pytest.mark.parametrize("periodic", [True, False])
def test_a_contact_does_not_depend_on_blocks_and_threads(monkeypatch, periodic, hardness):
    surface = Surface(heights=HEIGHTS, lengths=(1.0, 1.0), periodic=periodic)

    def pressed():
        model = HalfSpaceModel(
            surface=surface, contact_modulus=1.0, periodic=periodic, hardness=hardness
        )
        return model.press(Control(force=4e-3))

    whole = pressed()
    small_blocks(monkeypatch)
    found = []
    for threads in (1, 2):
        with allocated(threads):
            found.append(pressed())
    one, two = found
    assert np.array_equal(one.pressures, two.pressures) and one.moment == two.moment
    # both solve to a residual of 1e-8
    assert one.plane.approach == pytest.approx(whole.plane.approach, rel=3e-8)
    assert one.contact_area == pytest.approx(whole.contact_area, rel=1e-3)
    assert one.moment == pytest.approx(whole.moment, abs=1e-7 * whole.force)
    force, (x, y) = one.pressures / HEIGHTS.size, (surface.x[:, None] - 0.5, surface.y - 0.5)
    assert one.moment == pytest.approx((np.sum(force * x), np.sum(force * y)), abs=1e-15)


def test_mean_squares_do_not_depend_on_blocks(monkeypatch):
    surface = Surface(heights=HEIGHTS, lengths=(1.0, 1.0), periodic=True)
    expected = mean_squares(surface)
    small_blocks(monkeypatch)
    assert mean_squares(surface) == pytest.approx(expected, rel=1e-12)  # rounding
