"""Watersheds, saddles and caps against cell-by-cell computations."""

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.spatial import cKDTree

from geometry import Spectrum, Surface, synthesise
from micro.islands.division import divided, saddles_between, sampled
from micro.islands.watersheds import Watersheds

EIGHT = np.ones((3, 3))


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.5, waves=(1, 7), rms_slope=0.2, seed=3)
    return synthesise(spectrum, grid=(48, 40), lengths=(1.2, 1.0))


@pytest.fixture(scope="module")
def sheds(surface):
    return Watersheds.of(surface)


def climb(heights, cell):
    """Walk to the highest neighbour until there is none."""
    while True:
        ix, iy = cell
        around = [
            (i, j)
            for i in range(max(ix - 1, 0), min(ix + 2, heights.shape[0]))
            for j in range(max(iy - 1, 0), min(iy + 2, heights.shape[1]))
        ]
        best = max(around, key=lambda c: (heights[c], c))
        if best == cell:
            return cell
        cell = best


@pytest.mark.parametrize("levels", [0, 3])  # 3: whole numbers, full of ties
def test_watersheds(levels):
    heights = np.random.default_rng(1).random((13, 9))
    heights = np.floor(levels * heights) if levels else heights
    owner, peak = divided(heights)
    for flat, cell in enumerate(np.ndindex(heights.shape)):
        assert np.unravel_index(peak[owner[flat]], heights.shape) == climb(heights, cell)


def test_flat_surface_has_one_watershed():
    owner, peak = divided(np.zeros((5, 7)))
    assert peak.tolist() == [34] and not owner.any()


@pytest.mark.parametrize("levels", [0, 4])
def test_regions_are_those_of_an_image(levels):
    heights = np.random.default_rng(2).random((21, 17))
    heights = np.floor(levels * heights) if levels else heights
    owner, peak = divided(heights)
    saddles = saddles_between(heights, owner.reshape(heights.shape))
    assert np.all(saddles.first < saddles.second)
    pairs = set(zip(saddles.first.tolist(), saddles.second.tolist(), strict=True))
    assert len(pairs) == len(saddles.height)  # each once
    for level in (0.2, 0.5, 0.8, 1.5):
        image, count = label(heights > level, structure=EIGHT)
        linked = saddles.height > level
        up = heights.flat[peak] > level
        group = np.arange(len(peak))
        for first, second in zip(saddles.first[linked], saddles.second[linked], strict=True):
            group[group == group[second]] = group[first]
        assert len(set(group[up])) == count
        cells = heights.ravel() > level
        both = set(zip(group[owner[cells]], image.ravel()[cells], strict=True))
        assert len(both) == count


def test_sampling_divides_cells(surface):
    fine = sampled(surface)
    assert fine.shape == (8 * 48, 8 * 40)
    x, y = (np.arange(384) + 0.5) * 1.2 / 384, (np.arange(320) + 0.5) / 320
    assert fine == pytest.approx(surface.height_at(x[:, None], y), abs=1e-15)
    large = Surface(heights=np.zeros((512, 600)), lengths=(1.0, 1.0))
    assert sampled(large) is large.heights


def test_caps_are_sums_over_cells(surface, sheds):
    heights, rng = sampled(surface), np.random.default_rng(4)
    owner, _ = divided(heights)
    x = np.stack(np.meshgrid(*((np.arange(n) + 0.5) / n for n in heights.shape), indexing="ij"))
    x = x.reshape(2, -1) * np.array([[1.2], [1.0]])
    height = rng.uniform(0.3, 1.0, len(sheds)) * np.ptp(heights)
    caps = sheds.caps(height)
    for k in range(len(sheds)):
        volume = np.where(owner == k, heights.ravel() - (sheds.z[k] - height[k]), 0.0)
        volume = np.maximum(volume, 0.0) * 1.2 / heights.size
        dx, dy = x[0] - sheds.x[k], x[1] - sheds.y[k]
        powers = (np.ones_like(dx), dx, dy, dx**2, dx * dy, dy**2)
        slow = [np.sum(volume * power) for power in powers]
        # Differences of sums over all watersheds lose some digits.
        assert caps[:, k] == pytest.approx(slow, rel=1e-9, abs=1e-12 * slow[0])


def test_small_caps_shrink_as_paraboloids(sheds):
    few = sheds.caps(np.full(len(sheds), 1e-9))
    fewer = sheds.caps(np.full(len(sheds), 1e-11))
    for power, order in zip(range(6), (2.0, 2.5, 2.5, 3.0, 3.0, 3.0), strict=True):
        assert fewer[power] == pytest.approx(few[power] * 1e-2**order, rel=1e-9)
    assert np.all(sheds.caps(np.zeros(len(sheds))) == 0.0)


def test_caps_are_continuous(sheds):
    height = sheds.least_height
    below, above = sheds.caps(height * (1 - 1e-9)), sheds.caps(height * (1 + 1e-9))
    assert np.all(height > 0.0)
    assert above == pytest.approx(below, rel=1e-6, abs=1e-6 * below[3].max())


def test_peaks_are_maxima_of_the_interpolant(surface, sheds):
    assert sheds.z.max() == pytest.approx(surface.highest, abs=1e-12)
    rng = np.random.default_rng(0)
    for _ in range(50):
        px = np.clip(sheds.x + 1e-4 * rng.normal(size=len(sheds)), 0.0, 1.2)
        py = np.clip(sheds.y + 1e-4 * rng.normal(size=len(sheds)), 0.0, 1.0)
        assert np.all(surface.height_at(px, py) <= sheds.z + 1e-12)


def test_floor_keeps_what_rises_above(surface, sheds):
    floor = float(np.quantile(surface.heights, 0.8))
    cut = Watersheds.of(surface, floor=floor)
    level = np.full(len(sheds), floor)
    height = np.maximum(sheds.z - level, 0.0)
    big = height > 2.0 * sheds.least_height
    assert big.sum() > 5
    whole, kept = sheds.caps(height)[:, big], cut.caps(np.maximum(cut.z - floor, 0.0))[:, big]
    assert kept == pytest.approx(whole, rel=1e-9, abs=1e-12 * whole[0].max())
    assert np.sum(cut.open_saddles(level)) == np.sum(sheds.open_saddles(level)) > 0


@pytest.mark.parametrize("depth", [0.0, 1e-7, 1e-3])
def test_a_floor_leaves_the_caps_above_it_as_they_are(surface, sheds, depth):
    top = sheds.z.max()
    cut = Watersheds.of(surface, floor=top - depth)
    assert len(cut.depth) < len(sheds.depth)
    height = np.maximum(cut.z - (top - max(depth, 1e-9)), 0.0)
    # differences of sums over few samples instead of all
    np.testing.assert_allclose(cut.caps(height)[0], sheds.caps(height)[0], rtol=1e-7)


def test_nothing_reaches_a_floor_above_all(surface):
    empty = Watersheds.of(surface, floor=1.0)
    assert not empty.caps(np.zeros(len(empty))).any()


@pytest.mark.parametrize(("grid", "seed"), [((48, 480), 1), ((64, 256), 11), ((256, 256), 8)])
def test_every_summit_has_one_watershed(grid, seed):
    """Samples on ridges oblique to the grid climb nowhere, though the interpolant does."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.2, seed=seed)
    surface = synthesise(spectrum, grid=grid, lengths=(1.0, 1.0))
    found = Watersheds.of(surface)
    place, size = np.stack([found.x, found.y], axis=1), np.array(surface.lengths)
    slope = surface.gradient_at(found.x, found.y)
    held = ((place <= 0.0) & (slope < 0.0)) | ((place >= size) & (slope > 0.0))
    assert np.abs(np.where(held, 0.0, slope)).max() < 1e-9  # of 0.2
    distance = cKDTree(place / surface.spacing).query(place / surface.spacing, k=2)[0][:, 1]
    assert distance.min() > 0.5
    assert np.bincount(found.owner, minlength=len(found)).min() > 0
    assert len(found.owner) == np.prod(found.grid)
