"""Elastic energy of contacts in closed form: Hertz, and full contact of a periodic surface."""

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel

MODULUS = 1000.0


def test_full_contact_of_a_periodic_surface():
    """Flattened waves u_q store E*/4 Σ q |u_q|² per area (Johnson 1985, 13.2: p = E* q u / 2)."""
    spectrum = Spectrum(hurst=0.8, waves=(1, 6), rms_slope=0.05, seed=3)
    surface = synthesise(spectrum, grid=(32, 40), lengths=(1.0, 1.5))
    model = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=True, tolerance=1e-12)
    state = model.press(Control(force=0.2 * MODULUS))
    assert state.in_contact.all()
    waves = np.fft.fft2(surface.heights) / surface.heights.size
    along = (
        2 * np.pi * np.fft.fftfreq(n, d) for n, d in zip(surface.grid, surface.spacing, strict=True)
    )
    wave_number = np.hypot(*np.meshgrid(*along, indexing="ij"))
    expected = 0.25 * MODULUS * surface.area * np.sum(wave_number * np.abs(waves) ** 2)
    assert state.elastic_energy == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(("cells", "bound"), [(48, 3e-3), pytest.param(192, 4e-4)])
def test_hertz(cells, bound):
    """The work of F = 4/3 E* √R δ^(3/2) is 2/5 F δ."""
    x = (np.arange(cells) + 0.5) / cells - 0.5
    radius, approach = 2.0, 2e-2
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2) / (2 * radius), lengths=(1.0, 1.0))
    state = HalfSpaceModel(sphere, contact_modulus=MODULUS, highest=0.0).press(
        Control(approach=approach)
    )
    force = 4 / 3 * MODULUS * np.sqrt(radius * approach**3)
    assert state.elastic_energy == pytest.approx(0.4 * force * approach, rel=bound)
