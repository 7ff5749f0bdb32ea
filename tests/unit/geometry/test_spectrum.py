import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Spectrum, roughness, synthesise
from patchlaw.geometry.spectrum import LARGEST_SEED, random_waves

RING = {"hurst": 0.8, "waves": (2, 6), "rms_slope": 0.2, "seed": 5}
BOX = {"hurst": 0.95, "waves_x": (2, 7), "waves_y": (2, 12), "rms_height": 0.01, "seed": 5}
FREE = {"hurst": 0.5, "waves_x": (0, 3), "waves_y": (2, 4), "rms_height": 0.01}


def cosine_sum(waves, lengths, x, y):
    """Add up the waves one by one: slow and obviously right."""
    height = np.zeros(np.broadcast(x, y).shape)
    for kx, ky, b, phase in zip(waves.kx, waves.ky, waves.amplitude, waves.phase, strict=True):
        for sign in (1, -1):  # φ(−k) = −φ(k)
            angle = 2.0 * np.pi * sign * (kx * x / lengths[0] + ky * y / lengths[1])
            height = height + b * np.cos(angle + sign * phase)
    return height


@pytest.mark.parametrize("options", [RING, BOX, FREE])
@pytest.mark.parametrize("lengths", [(1.0, 1.0), (2.0, 3.0), (3.0, 1.7)])
def test_synthesis_is_the_cosine_sum(options, lengths):
    spectrum = Spectrum(**options)
    surface = synthesise(spectrum, grid=(32, 41), lengths=lengths)
    waves = random_waves(spectrum, lengths)
    exact = cosine_sum(waves, lengths, surface.x[:, None], surface.y[None, :])
    np.testing.assert_allclose(surface.heights, exact, atol=1e-14)  # rounding of ~200 terms
    assert surface.periodic and surface.lengths == lengths
    assert "seed" in surface.source and "hurst" in surface.source


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (2.0, 3.0)])
@pytest.mark.parametrize("seed", range(3))
def test_rms_slope_and_height_are_met_by_every_surface(lengths, seed):
    by_slope = Spectrum(**{**RING, "seed": seed})
    by_height = Spectrum(**{**BOX, "seed": seed})
    # the spline's gradient errs by (θ⁴/720) of waves of θ radians a cell: 2e-8 at 100 and more
    statistics = roughness(synthesise(by_slope, grid=(600, 900), lengths=lengths))
    assert statistics.sdq == pytest.approx(0.2, rel=1e-7)
    statistics = roughness(synthesise(by_height, grid=(20, 30), lengths=lengths))
    assert statistics.sq == pytest.approx(0.01, rel=1e-12)


def test_s0_gives_the_sum_over_the_band():
    spectrum = Spectrum(hurst=0.6, waves=(3, 9), s0=2.5e-6)
    k = np.arange(-9, 10)
    squared = (k[:, None] ** 2 + k[None, :] ** 2).ravel()
    squared = squared[(squared >= 9) & (squared <= 81)]
    variance = np.sum(2.5e-6 * squared**-1.6) * (2.0 * np.pi) ** 2 / 4.0  # cell of q on 2 × 2 mm
    surface = synthesise(spectrum, grid=(32, 32), lengths=(2.0, 2.0))
    assert roughness(surface).sq ** 2 == pytest.approx(variance, rel=1e-12)  # rounding


def test_bands_hold_the_waves_they_say():
    ring = random_waves(Spectrum(**RING), (1.0, 1.0))
    size = np.hypot(ring.kx, ring.ky)
    assert size.min() == 2.0 and size.max() == 6.0  # both limits belong to the band
    box = random_waves(Spectrum(**BOX), (1.0, 1.0))
    assert np.abs(box.kx).max() == 7 and np.abs(box.ky).max() == 12
    assert np.hypot(box.kx, box.ky).min() == 2.0
    assert 2 * len(box.kx) == 15 * 25 - 9  # the box without 0, ±x, ±y, ±x±y
    free = random_waves(Spectrum(**FREE), (1.0, 1.0))
    # the ellipse with lo_x = 0 shuts only the line kx = 0 below lo_y
    assert 2 * len(free.kx) == 7 * 9 - 3


def test_a_ring_is_isotropic_on_a_rectangle():
    lengths = (1.0, 2.0)
    waves = random_waves(Spectrum(**RING), lengths)
    size = np.hypot(waves.kx / lengths[0], waves.ky / lengths[1]) * lengths[0]
    assert size.min() >= 2.0 - 1e-12 and size.max() <= 6.0 + 1e-12
    assert np.abs(waves.ky).max() == 12
    order = np.argsort(size)
    assert np.all(np.diff(waves.amplitude[order]) <= 1e-18)  # falls with |q| alone


@pytest.mark.parametrize(
    "wide",
    [{"waves": (2, 9)}, {"waves": (1, 6)}, {"waves": None, "waves_x": (1, 8), "waves_y": (1, 20)}],
)
def test_a_wider_band_keeps_the_phases(wide):
    narrow = random_waves(Spectrum(**RING), (1.0, 1.0))
    wider = random_waves(Spectrum(**{**RING, **wide}), (1.0, 1.0))
    places = zip(wider.kx, wider.ky, strict=True)
    phase = dict(zip(((int(a), int(b)) for a, b in places), wider.phase, strict=True))
    kept = [phase[int(a), int(b)] for a, b in zip(narrow.kx, narrow.ky, strict=True)]
    np.testing.assert_array_equal(kept, narrow.phase)


def test_phases_are_pinned():
    # PCG64 is reproducible across machines and releases: a change here breaks users' seeds
    waves = random_waves(Spectrum(hurst=0.5, waves=(1, 1), rms_height=1.0, seed=1), (1.0, 1.0))
    assert list(zip(waves.kx, waves.ky, strict=True)) == [(0, 1), (1, 0)]
    expected = 2.0 * np.pi * np.random.Generator(np.random.PCG64(1)).random(2)
    np.testing.assert_allclose(waves.phase, expected, rtol=1e-15)
    np.testing.assert_allclose(waves.phase, [3.21587011, 5.97193953], rtol=1e-8)


@pytest.mark.parametrize("grid", [(12, 40), (40, 12)])
def test_a_grid_that_cannot_carry_the_waves_is_refused(grid):
    with pytest.raises(InputError, match=r"too coarse .*at least 13 × 13 heights"):
        synthesise(Spectrum(**RING), grid=grid, lengths=(1.0, 1.0))


def test_an_empty_band_is_refused():
    spectrum = Spectrum(hurst=0.5, waves=(1.1, 1.2), rms_slope=0.1)
    with pytest.raises(InputError, match="no wave lies in the band"):
        synthesise(spectrum, grid=(8, 8), lengths=(1.0, 1.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hurst": 1.5}, "hurst = 1.5: must be less than or equal to 1"),
        ({"hurst": float("nan")}, "hurst = nan: must be a finite number"),
        ({"waves": None}, "needs exactly one band"),
        ({"waves_x": (1, 2)}, "needs exactly one band"),
        ({"waves": None, "waves_x": (1, 2)}, "waves, or waves_x and waves_y together"),
        ({"waves": (5, 2)}, r"waves = \(5.0, 2.0\): is not a band .allowed: 0 ≤ lo ≤ hi"),
        ({"waves": (-1, 2)}, r"waves = \(-1.0, 2.0\): is not a band"),
        ({"waves": (1, 2, 3)}, r"waves = \(1, 2, 3\): must be 2 numbers"),
        ({"rms_slope": None}, "exactly one amplitude.*rms_slope, rms_height, s0"),
        ({"s0": 1.0}, "needs exactly one amplitude, not rms_slope and s0"),
        ({"rms_slope": 0.0}, r"rms_slope = 0\.0: must be greater than 0"),
        ({"seed": -1}, "seed = -1: must be greater than or equal to 0"),
        ({"seed": 1.5}, "seed = 1.5: must be a whole number"),
    ],
)
def test_spectra_that_make_no_sense_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        Spectrum(**{**RING, **change})


@pytest.mark.parametrize("seed", [-1, 2**128, 10**5000, 1.0], ids=["-1", "2^128", "long", "1.0"])
def test_seeds_of_no_size_are_refused(seed):
    with pytest.raises(InputError, match=r"seed = .*: must be (a whole number|less|greater)"):
        Spectrum(**RING | {"seed": seed})


def test_largest_seed_makes_a_surface():
    spectrum = Spectrum(**RING | {"seed": LARGEST_SEED})
    assert str(LARGEST_SEED) in synthesise(spectrum, grid=(16, 16), lengths=(1.0, 1.0)).source


def test_a_spectrum_is_written_with_units_and_without_rounding():
    spectrum = Spectrum(hurst=0.8, waves=(2, 8), rms_height=8e-3 * 1e-3)  # "8 nm", in mm
    assert str(spectrum) == (
        "spectrum with hurst 0.8, waves (2.0, 8.0), rms_height 8e-06 mm, seed 0"
    )
