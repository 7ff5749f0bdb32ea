"""Surfaces: statistics of their spectrum, rates of the interpolant, summits of analytic ones."""

import math

import numpy as np
import pytest

from patchlaw.geometry import (
    Spectrum,
    Surface,
    find_asperities,
    power_spectrum,
    roughness,
    synthesise,
)
from patchlaw.geometry.spectrum import random_waves
from patchlaw.geometry.surface import Zero

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


LENGTHS = (1.3, 0.9)
GRIDS = (32, 64, 128)
RNG = np.random.default_rng(0)
# points everywhere, in the outer half cells, on the sides and in the corners
X = np.concatenate([RNG.uniform(0.0, 1.3, 400), np.full(50, 0.0), np.full(50, 1.3), [0.0, 1.3]])
Y = np.concatenate([RNG.uniform(0.0, 0.9, 500), [0.9, 0.0]])


def wavy(x, y):
    return np.sin(5.0 * x + 3.0 * y) * np.exp(0.5 * x) + np.cos(7.0 * y - 2.0 * x)


def wavy_slopes(x, y):
    sine, cosine, growth = np.sin(5.0 * x + 3.0 * y), np.cos(5.0 * x + 3.0 * y), np.exp(0.5 * x)
    other = np.sin(7.0 * y - 2.0 * x)
    return (5.0 * cosine + 0.5 * sine) * growth + 2.0 * other, 3.0 * cosine * growth - 7.0 * other


def periodic(x, y):
    return np.cos(2 * np.pi * (2 * x / 1.3 + y / 0.9)) + np.sin(2 * np.pi * 3 * y / 0.9 + 1.0)


def periodic_slopes(x, y):
    first = -np.sin(2 * np.pi * (2 * x / 1.3 + y / 0.9))
    second = np.cos(2 * np.pi * 3 * y / 0.9 + 1.0)
    return 4 * np.pi / 1.3 * first, 2 * np.pi / 0.9 * first + 6 * np.pi / 0.9 * second


def sampled(function, grid, *, wraps):
    blank = Surface(heights=np.zeros(grid), lengths=LENGTHS)
    heights = function(*np.meshgrid(blank.x, blank.y, indexing="ij"))
    return Surface(heights=heights, lengths=LENGTHS, periodic=wraps)


INNER = (np.abs(X / 1.3 - 0.5) < 0.25) & (np.abs(Y / 0.9 - 0.5) < 0.25)


@pytest.mark.parametrize(
    ("function", "slopes", "wraps", "where", "order", "least"),
    [
        (wavy, wavy_slopes, False, INNER, 4.0, 2e-6),
        (wavy, wavy_slopes, False, slice(None), 2.0, 2e-4),
        (periodic, periodic_slopes, True, slice(None), 4.0, 2e-5),
    ],
    ids=["inside", "to the border", "periodic"],
)
def test_value_and_gradient_converge(function, slopes, wraps, where, order, least):
    values, gradients, (x, y) = [], [], (X[where], Y[where])
    for n in GRIDS:
        surface = sampled(function, (n, n + 5), wraps=wraps)
        values.append(np.abs(surface.height_at(x, y) - function(x, y)).max())
        exact = np.stack(slopes(x, y), axis=-1)
        found = [surface.interpolant(x, y, dx=1), surface.interpolant(x, y, dy=1)]
        gradients.append(np.abs(np.stack(found, axis=-1) - exact).max())
    # cubic splines: fourth order in the value, third in the slope (de Boor, A Practical Guide to
    # Splines, ch. 5); two less where heights on the border end at a straight line; 0.3 for grids
    # that are not yet in the limit
    assert np.all(-np.diff(np.log2(values)) > order - 0.3)
    assert np.all(-np.diff(np.log2(gradients)) > order - 1.3)
    assert values[-1] < least  # of heights of 2 mm


def dense_maximum(waves, lengths):
    """Return the largest value of a cosine sum: a dense grid, then ever finer ones at its top."""

    def heights(x, y):
        along_x = np.exp(2j * np.pi * np.outer(x, waves.kx) / lengths[0])
        along_y = np.exp(2j * np.pi * np.outer(waves.ky, y) / lengths[1])
        weight = 2.0 * waves.amplitude * np.exp(1j * waves.phase)
        return (along_x * weight @ along_y).real

    x, y = np.linspace(0.0, lengths[0], 801), np.linspace(0.0, lengths[1], 801)
    for _ in range(6):
        z = heights(x, y)
        i, j = np.unravel_index(np.argmax(z), z.shape)
        dx, dy = x[1] - x[0], y[1] - y[0]
        x = np.clip(np.linspace(x[i] - dx, x[i] + dx, 21), 0.0, lengths[0])
        y = np.clip(np.linspace(y[j] - dy, y[j] + dy, 21), 0.0, lengths[1])
    return z.max()


@pytest.mark.parametrize("seed", range(5))
def test_highest_point_against_the_cosine_sum(seed):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    exact = dense_maximum(random_waves(spectrum, (1.0, 1.0)), (1.0, 1.0))
    errors = []
    for n in (64, 128, 256):
        surface = synthesise(spectrum, grid=(n, n), lengths=(1.0, 1.0))
        errors.append(abs(surface.highest - exact))
        # the sampled maximum would be ten to thousands of times worse
        assert errors[-1] < 0.1 * abs(surface.heights.max() - exact) + 1e-9
    # 1e-7 mm of an approach of 8e-3 mm; the error falls with the fourth power of the spacing,
    # with a factor that depends on where the top lies between the samples
    assert errors[2] < 1e-7
    assert errors[0] / errors[2] > 20.0


@pytest.mark.parametrize("seed", range(5))
def test_highest_point_of_a_cut_surface_may_lie_on_its_border(seed):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    whole = synthesise(spectrum, grid=(256, 256), lengths=(1.0, 1.0))
    part = Surface(heights=whole.heights[64:128, :64], lengths=(0.25, 0.25))
    t = np.linspace(0.0, 0.25, 801)
    dense = whole.height_at(0.25 + t[:, None], t[None, :]).max()
    # the dense grid misses the top by 0.1 nm, a curvature of 3 /mm over half its spacing; the
    # heights of the part do not tell those of its border beyond the stated error, 20 nm at most
    assert part.highest == pytest.approx(dense, abs=min(1.5 * Zero().error([part]) + 1e-7, 2e-5))


FINE_GRIDS = (48, 96, 192)


def bump(x, y, place, radii, angle):
    """Return a summit that is no paraboloid and not symmetric, with known radii."""
    u = np.cos(angle) * (x - place[0]) + np.sin(angle) * (y - place[1])
    v = -np.sin(angle) * (x - place[0]) + np.cos(angle) * (y - place[1])
    shape = u**2 / radii[0] + v**2 / radii[1]
    return np.exp(-0.5 * shape) + 20.0 * u * v**2 * np.exp(-shape) + 15.0 * u**3 * np.exp(-shape)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.6, 2.5])
def test_place_height_radii_and_direction_converge(angle, periodic):
    place, radii = (0.5123, 0.4789), (0.012, 0.007)
    errors = {"place": [], "height": [], "radii": [], "direction": []}
    for n in FINE_GRIDS:
        x = (np.arange(n) + 0.5) / n
        heights = bump(x[:, None], x[None, :], place, radii, angle)
        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=periodic)
        asperities = find_asperities(surface)
        top = asperities.subset(np.argmax(asperities.z)[None])
        errors["place"].append(np.hypot(top.x[0] - place[0], top.y[0] - place[1]))
        errors["height"].append(abs(top.z[0] - 1.0))
        found = np.array([top.radius_major[0], top.radius_minor[0]])
        errors["radii"].append(np.abs(found / radii - 1.0).max())
        errors["direction"].append(abs(np.sin(top.angle[0] - angle)))
    rate = {name: np.log2(error[0] / error[-1]) / 2.0 for name, error in errors.items()}
    # spline: third order in the slope, so in the place, fourth in the height (the exact rates
    # depend on where the summit lies between samples); differences of one cell: second order
    assert rate["place"] > 2.5 and errors["place"][-1] < 1e-2 / FINE_GRIDS[-1]
    assert rate["height"] > 3.3 and errors["height"][-1] < 1e-6
    assert rate["radii"] == pytest.approx(2.0, abs=0.3) and errors["radii"][-1] < 0.01
    assert errors["direction"][-1] < 0.01
    if angle:  # on the axes the direction is exact by symmetry of the differences
        assert rate["direction"] > 1.7


def test_summits_of_a_random_surface_are_stationary_points_of_the_cosine_sum():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=4)
    waves = random_waves(spectrum, (1.0, 1.0))
    surface = synthesise(spectrum, grid=(256, 256), lengths=(1.0, 1.0))
    asperities = find_asperities(surface)
    q = 2.0 * np.pi * np.stack([waves.kx, waves.ky])
    angle = np.stack([asperities.x, asperities.y], axis=1) @ q + waves.phase
    weight = 2.0 * waves.amplitude
    z = np.cos(angle) @ weight
    slope = -np.einsum("kw,sw,w->sk", q, np.sin(angle), weight)
    hessian = -np.einsum("iw,jw,sw,w->sij", q, q, np.cos(angle), weight)
    curvature = -np.linalg.eigvalsh(hessian)[:, ::-1]
    # spline: (Q dx)⁴ with Q dx ≤ 0.25 at the shortest wave; 1e-7 mm of heights of 1e-2 mm
    np.testing.assert_allclose(asperities.z, z, atol=1e-7)
    assert np.abs(np.linalg.solve(hessian, slope[..., None])).max() < 1e-2 / 256  # of a cell
    # differences over one cell: (Q dx)²/12 = 0.5 % where the shortest waves bear the curvature,
    # relative to the sharper one
    found = np.stack([1.0 / asperities.radius_major, 1.0 / asperities.radius_minor], axis=1)
    assert np.all(np.abs(found - curvature) < 0.01 * curvature[:, 1:])
    assert np.all(found > 0.0)
