import math

import numpy as np
import pytest

from patchlaw.geometry import Surface, power_spectrum, roughness
from patchlaw.geometry.statistics import mean_squares

AMPLITUDE, WAVES, LENGTHS = 0.3, 3, (2.0, 1.5)
Q = 2.0 * np.pi * WAVES / LENGTHS[0]
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2))


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
    assert statistics.ssk == pytest.approx(0.0, abs=1e-11)
    assert statistics.sku == pytest.approx(1.5, rel=1e-11)
    assert statistics.sa == pytest.approx(2.0 * AMPLITUDE / math.pi, rel=4e-3)


def test_single_cosine_extremes():
    # crest and trough on samples: half a cell is a phase of π/32
    assert roughness(cosine(phase=-math.pi / 32)).sz == pytest.approx(2 * AMPLITUDE, rel=1e-12)


def on_spline(count, waves, length, order):
    """Return what is left of the mean square of a derivative of a cosine on the spline through it.

    The cubic spline through samples of exp(iqx) is the sum over q_k = q + 2πk/d of exp(i q_k x)
    with weights as q_k⁻⁴ that sum to 1 (Unser 1999, doi 10.1109/79.799930). What is left out of
    these sums beyond k = 3000 is 2/(3 · 3000³) = 2.5e-11 of the wave with k = -1.
    """
    q, alias = 2 * np.pi * waves / length, 2 * np.pi * count / length
    k = np.arange(-3000, 3001)
    weight = (q / (q + alias * k)) ** 4
    return float(np.sum((weight / weight.sum()) ** 2 * (1 + alias * k / q) ** (2 * order)))


@pytest.mark.parametrize("cells", [7, 12, 96])
def test_moments_are_those_of_the_spline_through_whole_waves(cells):
    statistics = roughness(cosine(grid=(cells, 20)))
    m0, m2, m4 = (
        AMPLITUDE**2 * Q ** (2 * n) / 2.0 * on_spline(cells, WAVES, LENGTHS[0], n) for n in range(3)
    )
    # what the sums leave out, twice
    assert statistics.m0 == pytest.approx(m0, rel=1e-10)
    assert statistics.sdq == pytest.approx(math.sqrt(m2), rel=1e-10)
    assert statistics.m2_radial == pytest.approx(m2, rel=1e-10)
    assert statistics.m4_radial == pytest.approx(m4, rel=1e-10)
    assert statistics.m2 == pytest.approx(m2 / 2.0, rel=1e-10)  # profiles along y are flat
    assert statistics.m4 == pytest.approx(m4 / 2.0, rel=1e-10)
    assert statistics.nayak == pytest.approx(2.0 * m0 * m4 / m2**2, rel=1e-10)
    assert statistics.nayak_radial == pytest.approx(m0 * m4 / m2**2, rel=1e-10)
    # and neighbours differ by the cosine's chord
    chord = 2.0 * math.sin(Q * LENGTHS[0] / cells / 2.0) / (LENGTHS[0] / cells)
    x = LENGTHS[0] * np.arange(1, cells) / cells  # between them
    slopes = AMPLITUDE * chord * np.sin(Q * x + 0.4)
    assert statistics.sdq_differences == pytest.approx(np.sqrt(np.mean(slopes**2)), rel=1e-12)


def test_sums_of_cosines_of_two_directions():
    """Means of squares of an egg box and another wave are sums of products of both directions."""
    (nx, ny), (lx, ly) = (20, 14), (1.3, 0.9)
    x, y = 2 * np.pi * (np.arange(nx) + 0.5) / nx, 2 * np.pi * (np.arange(ny) + 0.5) / ny
    heights = (
        0.3 * np.outer(np.cos(5 * x + 1.0), np.cos(4 * y + 0.3)) + 0.1 * np.cos(2 * x)[:, None]
    )
    found = mean_squares(Surface(heights=heights, lengths=(lx, ly), periodic=True))
    p, q, r = 10 * np.pi / lx, 8 * np.pi / ly, 4 * np.pi / lx
    along = [on_spline(nx, 5, lx, n) * p ** (2 * n) for n in range(3)]
    across = [on_spline(ny, 4, ly, n) * q ** (2 * n) for n in range(3)]
    other = [0.5 * 0.01 * on_spline(nx, 2, lx, n) * r ** (2 * n) for n in range(3)]
    box = lambda i, j: 0.25 * 0.09 * along[i] * across[j]  # noqa: E731
    expected = [box(0, 0) + other[0], box(1, 0) + other[1], box(0, 1), box(2, 0) + other[2]]
    expected += [box(0, 2), box(2, 0) + 2 * box(1, 1) + box(0, 2) + other[2]]
    assert found == pytest.approx(expected, rel=1e-10)  # what the sums leave out


@pytest.mark.parametrize("periodic", [True, False])
def test_moments_are_those_of_the_surface_that_is_pressed(periodic):
    """The means of a dense sampling of it; white noise is what differences know least of."""
    heights = 1e-3 * np.random.default_rng(8).standard_normal((21, 16))
    surface = Surface(heights=heights, lengths=(1.1, 0.7), periodic=periodic)
    surfaces = [surface]
    if not periodic:
        surfaces.append(surface.piece((0.13, 0.71), (0.0, 0.39)))
    for one in surfaces:
        x, y = ((np.arange(700) + 0.5) / 700 * side for side in one.lengths)
        at = [one.interpolant(x[:, None], y[None], dx=i, dy=j) for i, j in ORDERS]
        means = [np.var(at[0]), *(np.mean(part**2) for part in (*at[1:], at[3] + at[4]))]
        # the midpoint rule errs by the square of a span's 33rd part, over 24, of bends of squares
        assert mean_squares(one) == pytest.approx(means, rel=1e-3)


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
