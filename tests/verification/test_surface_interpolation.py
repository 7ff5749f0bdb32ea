"""The interpolant converges at its rates up to the border, and its top is the surface's top."""

import numpy as np
import pytest

from patchlaw.geometry import Spectrum, Surface, synthesise
from patchlaw.geometry.spectrum import random_waves
from patchlaw.geometry.surface import Zero

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
