"""Random surfaces have the statistics of their spectrum and of the paper's sets."""

import math

import numpy as np
import pytest

from patchlaw.geometry import Spectrum, find_asperities, power_spectrum, roughness, synthesise

SEEDS = range(24)


def paper_set(seed):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    return synthesise(spectrum, grid=(256, 256), lengths=(1.0, 1.0))


@pytest.fixture(scope="module")
def surfaces():
    return [paper_set(seed) for seed in SEEDS]


def test_set_1_of_the_paper(surfaces):
    statistics = [roughness(surface) for surface in surfaces]
    # rms height and Nayak's parameter are the same for every seed: phases alone are random
    for one in statistics:
        assert one.sq == pytest.approx(10.0e-3, rel=0.01)  # "about 10 µm"
        assert one.sdq == pytest.approx(0.215, rel=1e-5)  # on the spline, 25 heights a wave
        assert one.nayak == pytest.approx(3.75, rel=0.01)
        assert one.nayak_radial == pytest.approx(2.5, rel=0.01)
    counts = [len(find_asperities(surface)) for surface in surfaces]
    # Nayak's density of summits m4/(6π√3 m2) for an isotropic Gaussian surface [1/mm²]; the
    # mean over 24 seeds with a scatter of 3 each is good to 0.6, border cells cost a little
    expected = statistics[0].m4 / (6.0 * math.pi * math.sqrt(3.0) * statistics[0].m2)
    assert np.mean(counts) == pytest.approx(expected, abs=2.5)
    assert np.mean(counts) == pytest.approx(25.0, abs=2.0)


def test_heights_are_gaussian_in_the_mean_over_seeds(surfaces):
    statistics = [roughness(surface) for surface in surfaces]
    for values, gaussian in (
        ([one.ssk for one in statistics], 0.0),
        ([one.sku for one in statistics], 3.0),
        ([one.sa / one.sq for one in statistics], math.sqrt(2.0 / math.pi)),
    ):
        error = np.std(values, ddof=1) / math.sqrt(len(values))
        # four standard errors, and the kurtosis deficit of few waves, 3 <Σ B⁴>/<Σ B²>² ~ 0.1
        assert abs(np.mean(values) - gaussian) < 4.0 * error + 0.02 * max(gaussian, 1.0)


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (2.0, 1.0)])
def test_power_spectrum_is_the_spectrum(lengths):
    spectrum = Spectrum(hurst=0.7, waves=(4, 24), s0=3e-6, seed=1)
    surface = synthesise(spectrum, grid=(64, 64), lengths=lengths)
    found = power_spectrum(surface)
    k = found.wavenumber * lengths[0] / (2.0 * np.pi)
    inner, outer = (k > 6.0) & (k < 22.0), (k < 2.5) | (k > 26.0)
    # within a ring one wave wide the mean of k^(−2(H+1)) exceeds that at the mean k by
    # ~ (2H+2)(2H+3)/24 · (width/k)², and few waves fill it unevenly: 4 % at k = 6, less above
    width = lengths[0] / min(lengths)
    slack = 1.0 * (width / k[inner]) ** 2 + 0.01
    ratio = found.density[inner] / (3e-6 * k[inner] ** -3.4)
    assert np.all(np.abs(ratio - 1.0) < slack)
    assert found.density[outer].max() < 1e-25  # nothing outside the band but rounding
    assert found.variance == pytest.approx(roughness(surface).sq ** 2, rel=1e-12)


@pytest.mark.parametrize("hurst", [0.3, 0.8, 1.0])
def test_variance_and_slope_tend_to_the_integrals_of_the_spectrum(hurst):
    lo, hi, side = 20.0, 120.0, 2.0
    spectrum = Spectrum(hurst=hurst, waves=(lo, hi), s0=1e-6)
    statistics = roughness(synthesise(spectrum, grid=(768, 768), lengths=(side, side)))
    cell = (2.0 * np.pi / side) ** 2
    # ∫ S d²q = cell · 2π S0 ∫ k^(−2H−1) dk and the same with q² = cell · k²
    variance = cell * 2e-6 * np.pi * (lo ** (-2 * hurst) - hi ** (-2 * hurst)) / (2 * hurst)
    power = 2.0 - 2.0 * hurst
    integral = math.log(hi / lo) if hurst == 1.0 else (hi**power - lo**power) / power
    # lattice points in a ring fluctuate by ~ k^(2/3) of πk²: 1 % at k = 20
    assert statistics.m0 == pytest.approx(variance, rel=0.01)
    assert statistics.sdq**2 == pytest.approx(cell**2 * 2e-6 * np.pi * integral, rel=0.01)


def test_an_isotropic_band_has_equal_profiles_and_the_factor_of_two_thirds():
    spectrum = Spectrum(hurst=0.8, waves=(4, 30), rms_height=1e-3, seed=2)
    statistics = roughness(synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0)))
    # angular means over a ring: <cos⁴> = 3/8 against 1; the lattice keeps it within 2 %
    assert statistics.nayak_radial / statistics.nayak == pytest.approx(2.0 / 3.0, rel=0.02)
    assert statistics.m2_radial / statistics.m2 == pytest.approx(2.0, rel=1e-12)
