import numpy as np
import pytest

from patchlaw.geometry.filters import regridded, smoothed

COUNT, STEP = 60, 0.1  # a side of 6 mm
X = (np.arange(COUNT) + 0.5) * STEP


def wave(length, x=X):
    return np.cos(2 * np.pi * x / length + 0.7)


@pytest.mark.parametrize("cut_off", [0.5, 1.0, 3.0])
def test_half_of_a_wave_passes_at_the_cut_off(cut_off):
    heights = np.outer(wave(cut_off), np.ones(COUNT))
    passed = smoothed(heights, (STEP, STEP), cut_off, periodic=True)
    np.testing.assert_allclose(passed, 0.5 * heights, atol=1e-14)  # rounding


@pytest.mark.parametrize("ratio", [0.5, 1.0, 2.0, 3.0])
def test_transmission_is_gaussian_in_any_direction(ratio):
    # waves along the diagonal are shorter by √2 than along the sides: 2^(−(λc/λ)²)
    length = 1.5
    diagonal = wave(length, X[:, None] + X)
    cut_off = length / np.sqrt(2.0) / ratio
    passed = smoothed(diagonal, (STEP, STEP), cut_off, periodic=True)
    np.testing.assert_allclose(passed, 2.0 ** -(ratio**-2) * diagonal, atol=1e-14)


def test_borders_neither_rise_nor_fall():
    heights = 7.0 + np.outer(wave(1.0), wave(2.0))
    passed = smoothed(heights, (STEP, STEP), 1.0)
    # the weights of what lies within, summed one by one
    alpha = np.sqrt(np.log(2.0) / np.pi)
    weight = np.exp(-np.pi * ((X[:, None] - X) / alpha) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    # the weight is cut at the cut-off, where 6e-7 of it is left
    np.testing.assert_allclose(passed, weight @ heights @ weight.T, atol=3e-6)
    np.testing.assert_allclose(smoothed(0 * heights + 7, (STEP, 2 * STEP), 1.0), 7.0, rtol=1e-14)


def test_fewer_cells_hold_means():
    heights = np.random.default_rng(0).normal(size=(12, 8))
    coarse = regridded(heights, (3.0, 2.0), (4, 4))
    np.testing.assert_allclose(coarse, heights.reshape(4, 3, 4, 2).mean(axis=(1, 3)), atol=1e-14)
    uneven = regridded(heights, (3.0, 2.0), (5, 7))
    assert uneven.mean() == pytest.approx(heights.mean(), rel=1e-12)  # volume is kept
    slope = np.outer(X, np.ones(8))
    middles = (np.arange(7) + 0.5) * 6.0 / 7
    # means of cells that are cut in parts lie off a slope by less than the old cell's half
    np.testing.assert_allclose(regridded(slope, (6.0, 1.0), (7, 8))[:, 0], middles, atol=STEP / 4)


def test_more_cells_lie_on_the_spline():
    heights = np.outer(X - X**2, np.ones(6))  # curved downwards: the spline is exact on the border
    fine = regridded(heights, (6.0, 1.0), (90, 4))
    x = (np.arange(90) + 0.5) * 6.0 / 90
    np.testing.assert_allclose(fine[:, 0], x - x**2, atol=1e-10 * 36)
