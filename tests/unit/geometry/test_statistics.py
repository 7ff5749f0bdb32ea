import math

import numpy as np
import pytest

from geometry import Surface, power_spectrum, roughness

AMPLITUDE, WAVES, LENGTHS = 0.3, 3, (2.0, 1.5)
Q = 2.0 * np.pi * WAVES / LENGTHS[0]


def cosine(grid=(96, 20), periodic=True, phase=0.4):
    x = (np.arange(grid[0]) + 0.5) / grid[0]
    heights = 7.0 + AMPLITUDE * np.cos(2.0 * np.pi * WAVES * x + phase)
    return Surface(
        heights=np.repeat(heights[:, None], grid[1], axis=1), lengths=LENGTHS, periodic=periodic
    )


def test_single_cosine_heights():
    statistics = roughness(cosine())
    # even moments of at most 2·4 waves are exact on 32 samples per wave; |h| is a midpoint rule
    # over its kinks: relative error (π/32)²/6 ≈ 1.6e-3
    assert statistics.sq == pytest.approx(AMPLITUDE / math.sqrt(2.0), rel=1e-12)
    assert statistics.m0 == pytest.approx(AMPLITUDE**2 / 2.0, rel=1e-12)
    assert statistics.ssk == pytest.approx(0.0, abs=1e-11)
    assert statistics.sku == pytest.approx(1.5, rel=1e-11)
    assert statistics.sa == pytest.approx(2.0 * AMPLITUDE / math.pi, rel=4e-3)


def test_single_cosine_extremes():
    # crest and trough on samples: half a cell is a phase of π/32
    assert roughness(cosine(phase=-math.pi / 32)).sz == pytest.approx(2 * AMPLITUDE, rel=1e-12)


def test_single_cosine_moments_when_periodic():
    statistics = roughness(cosine())
    # derivatives are spectral: exact to rounding; profiles along y are flat, hence the halves
    assert statistics.sdq == pytest.approx(AMPLITUDE * Q / math.sqrt(2.0), rel=1e-12)
    assert statistics.m2_radial == pytest.approx(AMPLITUDE**2 * Q**2 / 2.0, rel=1e-12)
    assert statistics.m4_radial == pytest.approx(AMPLITUDE**2 * Q**4 / 2.0, rel=1e-12)
    assert statistics.m2 == pytest.approx(statistics.m2_radial / 2.0, rel=1e-12)
    assert statistics.m4 == pytest.approx(statistics.m4_radial / 2.0, rel=1e-12)
    assert statistics.nayak == pytest.approx(2.0, rel=1e-12)
    assert statistics.nayak_radial == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("cells", [32, 100])
def test_moments_of_a_surface_that_is_not_periodic_are_central_differences(cells):
    surface = cosine(grid=(cells, 8), periodic=False)
    statistics, d = roughness(surface), surface.spacing[0]
    # central differences of a cosine have the factors sin(Qd)/d and (2 − 2 cos Qd)/d²
    angle = (Q * surface.x + 0.4)[1:-1]
    slope = AMPLITUDE * np.sin(angle) * np.sin(Q * d) / d
    bend = AMPLITUDE * np.cos(angle) * (2.0 - 2.0 * np.cos(Q * d)) / d**2
    assert statistics.m2_radial == pytest.approx(np.mean(slope**2), rel=1e-11)
    assert statistics.m2 == pytest.approx(statistics.m2_radial / 2.0, rel=1e-12)
    assert statistics.sdq == pytest.approx(math.sqrt(statistics.m2_radial), rel=1e-12)
    # second differences of 7 ± 0.3 lose 7/0.3 (Nd)⁻² ~ 1e4 units of rounding
    assert statistics.m4_radial == pytest.approx(np.mean(bend**2), rel=1e-10)
    assert statistics.m4 == pytest.approx(statistics.m4_radial / 2.0, rel=1e-10)


def test_egg_box_tells_the_radial_moments_from_those_of_profiles():
    x, y = (np.arange(32) + 0.5) / 32, (np.arange(40) + 0.5) / 40
    heights = np.outer(np.cos(4 * np.pi * x), np.cos(6 * np.pi * y))
    statistics = roughness(Surface(heights=heights, lengths=(1.0, 1.0), periodic=True))
    p, q = (4 * np.pi) ** 2, (6 * np.pi) ** 2
    # <h²> = 1/4; every derivative multiplies by its wavenumber; exact to rounding
    assert statistics.m0 == pytest.approx(0.25, rel=1e-12)
    assert statistics.m2 == pytest.approx(0.25 * (p + q) / 2, rel=1e-12)
    assert statistics.m2_radial == pytest.approx(0.25 * (p + q), rel=1e-12)
    assert statistics.m4 == pytest.approx(0.25 * (p**2 + q**2) / 2, rel=1e-12)
    assert statistics.m4_radial == pytest.approx(0.25 * (p + q) ** 2, rel=1e-12)
    assert statistics.sku == pytest.approx(1.5**2, rel=1e-11)


def test_skewness_has_the_sign_of_peaks():
    x = (np.arange(32) + 0.5) / 32
    heights = np.exp(3.0 * np.cos(2 * np.pi * x))[:, None] * np.ones(8)
    peaks = Surface(heights=heights, lengths=(1.0, 1.0), periodic=True)
    h = heights - heights.mean()
    assert roughness(peaks).ssk == pytest.approx((h**3).mean() / h.std() ** 3, rel=1e-12)
    assert roughness(peaks).ssk > 1.0
    assert roughness(peaks.scaled(-1.0)).ssk == pytest.approx(-roughness(peaks).ssk, rel=1e-12)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("level", [0.0, 5.3])
def test_a_flat_surface_has_no_shape_parameters(periodic, level):
    flat = Surface(heights=np.full((8, 8), level), lengths=(1.0, 1.0), periodic=periodic)
    statistics = roughness(flat)
    assert statistics.sq == pytest.approx(0.0, abs=1e-14)  # rounding of the mean
    assert math.isnan(statistics.ssk) and math.isnan(statistics.sku)
    assert math.isnan(statistics.nayak) and math.isnan(statistics.nayak_radial)


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (2.0, 0.7)])
@pytest.mark.parametrize("grid", [(16, 16), (15, 22)])
def test_power_spectrum_keeps_the_variance(grid, lengths):
    heights = 5.0 + np.random.default_rng(0).normal(size=grid)
    surface = Surface(heights=heights, lengths=lengths, periodic=True)
    spectrum = power_spectrum(surface)
    # Parseval's theorem, to rounding; every wave but q = 0 is in exactly one ring
    assert spectrum.variance == pytest.approx(np.var(heights), rel=1e-12)
    assert spectrum.waves.sum() == heights.size - 1
    assert spectrum.cell == pytest.approx(4.0 * np.pi**2 / surface.area, rel=1e-14)
    assert np.all(np.diff(spectrum.wavenumber) > 0.0) and np.all(spectrum.waves > 0)


def test_power_spectrum_of_a_cosine_is_one_ring():
    surface = cosine(grid=(48, 36))
    spectrum = power_spectrum(surface)
    ring = int(np.argmax(spectrum.density))
    share = spectrum.density[ring] * spectrum.waves[ring] * spectrum.cell
    assert share == pytest.approx(AMPLITUDE**2 / 2.0, rel=1e-12)  # exact on whole waves
    # rings are one wave of the shorter side wide
    assert abs(spectrum.wavenumber[ring] - Q) <= np.pi / min(LENGTHS)


def test_hann_window_suppresses_the_jump_at_the_border():
    x = (np.arange(64) + 0.5) / 64
    heights = np.cos(2 * np.pi * 4.5 * x)[:, None] * np.ones(64)  # half a wave too many
    high = {}
    for window in ("none", "hann"):
        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=window == "none")
        spectrum = power_spectrum(surface)
        far = spectrum.wavenumber > 2 * np.pi * 12
        high[window] = np.sum(spectrum.density[far] * spectrum.waves[far]) * spectrum.cell
        # scaled to unit mean square: the variance of a short record is kept within some percent
        assert spectrum.variance == pytest.approx(np.var(heights), rel=0.05)
    # leakage of a window falls as q⁻⁶ instead of q⁻²
    assert high["hann"] < 1e-2 * high["none"]
