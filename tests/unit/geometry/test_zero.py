"""Heights that approaches count from, and how well the cells of a surface tell them."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Surface
from patchlaw.geometry.surface import Zero

RNG = np.random.default_rng(28)
RATE = np.sqrt(2.0) * np.pi


def surface(shape=(40, 50), seed=0, **options):
    heights = np.random.default_rng(seed).normal(size=shape)
    return Surface(heights=heights, lengths=(RATE, 2.0), **options)


def test_depths_are_those_of_sorted_heights():
    rough = surface()
    assert Zero("first touch").depth([rough]) == 0.0
    mean = rough.highest - np.mean(rough.heights)
    assert Zero("mean plane").depth([rough]) == pytest.approx(mean, rel=1e-14)  # rounding
    for above in (1, 2, 7, 1999):
        share = above / rough.heights.size
        lower = np.sort(rough.heights.ravel())[-above - 1]
        depth = Zero(f"quantile {share!r}").depth([rough])
        assert depth == pytest.approx(rough.highest - lower, rel=1e-13)
        assert np.mean(rough.heights > rough.highest - depth + 1e-9) == pytest.approx(share)


def test_a_spike_moves_first_touch_and_no_quantile():
    rough = surface()
    heights = rough.heights.copy()
    heights.flat[np.argmax(heights)] += 100.0 * RATE
    spiked = Surface(heights=heights, lengths=rough.lengths)
    zero = Zero("quantile 0.001")
    before, after = (one.highest - zero.depth([one]) for one in (rough, spiked))
    # heights count from the mean, which the spike moves, so that rounding is that of 444 mm
    assert after == pytest.approx(before, abs=1e-12)
    assert spiked.highest > rough.highest + 100.0
    heights.flat[np.argmin(heights)] = 1e3  # where the surface was low: to the next height at most
    between = np.sort(rough.heights.ravel())[[-3, -2]]
    spiked = Surface(heights=heights, lengths=rough.lengths)
    assert between[0] - 1e-9 <= spiked.highest - zero.depth([spiked]) <= between[1] + 1e-9


def test_samples_have_one_mean_plane():
    samples = [surface(seed=seed) for seed in range(3)]
    moved = [Surface(heights=one.heights + RATE, lengths=one.lengths) for one in samples]
    for name in ("mean plane", "quantile 0.01"):
        assert Zero(name).depth(moved) == pytest.approx(Zero(name).depth(samples), rel=1e-12)
    top = max(one.highest - one.mean_height for one in samples)
    assert Zero("mean plane").depth(samples) == pytest.approx(top, rel=1e-14)


@pytest.mark.parametrize("name", ["", "mean", "quantile", "quantile 0", "quantile 1", "quantile -1",
                                  "quantile 1.2.3", "quantile nan", "Mean plane"])  # fmt: skip
def test_other_names_are_refused(name):
    with pytest.raises(InputError, match="between 0 and 1"):
        Zero(name)


def test_a_quantile_needs_a_cell_above_it():
    with pytest.raises(
        InputError, match=r"less than one of 2000 heights .* at least quantile 0.0005"
    ):
        Zero("quantile 0.0004").depth([surface()])


def waves(n, seed, shortest):
    """Return waves down to L/shortest on n × n cells [mm]."""
    rng = np.random.default_rng(seed)
    x = (np.arange(n) + 0.5) / n
    heights = np.zeros((n, n))
    for _ in range(60):
        k, t, phase = rng.uniform(1.0, shortest), *rng.uniform(0.0, 2.0 * np.pi, 2)
        inside = k * (np.cos(t) * x[:, None] + np.sin(t) * x)
        heights += np.cos(2.0 * np.pi * inside + phase) / k
    return 2e-3 * heights


def honed(n, seed, shortest=8):
    """Return a plateau of 0.15 µm rms with crossing grooves of 7 to 11 µm on n × n cells [mm]."""
    rng = np.random.default_rng(seed)
    x = (np.arange(n) + 0.5) / n
    grooves = np.zeros((n, n))
    for sign in (1.0, -1.0):
        angle = sign * np.radians(rng.uniform(20.0, 40.0))
        along = np.cos(angle) * x[:, None] + np.sin(angle) * x
        for place, deep in zip(rng.uniform(-0.3, 1.3, 5), rng.uniform(0.6, 1.0, 5), strict=True):
            u = (along - place) * shortest
            grooves = np.minimum(grooves, -deep * np.where(abs(u) < 0.5, np.cos(np.pi * u) ** 2, 0))
    plateau = waves(n, seed + 1000, shortest)
    return 11e-3 * grooves + 0.15e-3 * plateau / plateau.std()


@pytest.mark.long
@pytest.mark.parametrize(("make", "n"), [(waves, 80), (honed, 64)])
def test_the_stated_error_of_first_touch_holds(make, n):
    """Against five times as many cells a side, fresh seeds."""
    kept = []
    for seed in range(500, 515):
        coarse = Surface(heights=make(n, seed, 8), lengths=(1.0, 1.0))
        true = make(5 * n, seed, 8).max()
        # the finer cells miss the top by 5 nm at most: curvature 2 /mm over half a cell of 1.6 µm
        error = abs(coarse.highest - true) - 5e-6
        kept.append(error <= 1.5 * Zero().error([coarse]))
    assert sum(kept) >= 13  # 95 of 100, with what 15 scatter


@pytest.mark.long
@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("step", [0.0, 1e-3])  # rounded heights: many are equal
def test_the_error_of_first_touch_knows_no_order_of_the_axes(periodic, step):
    for seed in range(4):
        heights = waves(40, seed, 8)[:, :32]
        heights = np.round(heights / step) * step if step else heights
        one = Surface(heights=heights, lengths=(1.0, RATE), periodic=periodic)
        other = Surface(heights=heights.T, lengths=(RATE, 1.0), periodic=periodic)
        assert Zero().error([one]) == pytest.approx(Zero().error([other]), rel=1e-9)  # rounding


@pytest.mark.parametrize("n", [64, 80])
def test_grooves_that_meet_the_border_leave_no_ridge(n):
    """An extrapolated spline exceeds the plateau by 140 to 240 nm, at 80 on the last of these."""
    for seed in (0, 2, 3, 5):
        heights = honed(n, seed)
        rough = Surface(heights=heights, lengths=(1.0, 1.0))
        line, border = np.linspace(0.0, 1.0, 20 * n), np.array([0.0, 0.25 / n, 0.5 / n])
        strips = [border, 1.0 - border[::-1]]
        top = max(
            float(rough.height_at(*place).max())
            for strip in strips
            for place in ((strip[:, None], line), (line[:, None], strip))
        )
        assert top <= heights.max() + 60e-6  # a tenth of what the plateau varies by


@pytest.mark.parametrize("seed", range(5))
def test_heights_on_the_border_are_bounded_by_those_beside_it(seed):
    heights = np.random.default_rng(seed).standard_cauchy(size=(9, 12))  # as rough as heights are
    rough = Surface(heights=heights, lengths=(RATE, 2.0))
    edge = rough.height_at(0.0, rough.y)
    allowed = np.maximum(heights[1], heights[0] + 0.5 * (heights[0] - heights[1]))
    assert np.all(edge <= allowed + 1e-9)  # rounding of heights up to a thousand
    assert np.all(edge >= heights[0] - np.ptp(heights[:4], axis=0) - 1e-9)
    turned = Surface(heights=heights.T, lengths=(2.0, RATE))
    x, y = RNG.uniform(0.0, [RATE, 2.0], (50, 2)).T
    np.testing.assert_allclose(turned.height_at(y, x), rough.height_at(x, y), rtol=1e-9, atol=1e-9)


def test_any_sample_may_be_the_highest():
    samples = [surface(seed=seed) for seed in range(3)]
    tops = [one.highest - one.mean_height for one in samples]
    ends = [top + Zero().error([one]) for top, one in zip(tops, samples, strict=True)]
    assert Zero().error(samples) == pytest.approx(max(ends) - max(tops), rel=1e-12)
