"""Random-midpoint surfaces as MIRCO draws them, with the random numbers of GNU's C++ library.

Random-midpoint displacement (Fournier, Fussell & Carpenter 1982, doi 10.1145/358523.358553) on
2^n + 1 heights a side: every generation fills the middles of squares with the mean of their four
corners, then the middles of sides with the mean of their neighbours (three on the border), plus a
normal deviate whose standard deviation falls by 2^(H/2) before each of the two but the first.
"""

import numpy as np

MODULUS, FACTOR = 2**31 - 1, 16807
"""Lewis, Goodman & Miller's generator, `default_random_engine` of GNU's C++ library."""


def normal_deviates(seed):
    """Yield standard normal deviates by Marsaglia's polar method, the second of a pair first."""
    uniform = uniform_deviates(seed)
    while True:
        x, y = (2.0 * next(uniform) - 1.0 for _ in range(2))
        square = x * x + y * y
        if 0.0 < square <= 1.0:
            scale = np.sqrt(-2.0 * np.log(square) / square)
            yield y * scale
            yield x * scale


def uniform_deviates(seed):
    """Yield numbers in [0, 1) with 53 random bits, the low ones drawn first."""
    state, span = seed, MODULUS - 1
    while True:
        state = state * FACTOR % MODULUS
        low, state = state - 1, state * FACTOR % MODULUS
        yield (low + (state - 1) * span) / span**2


def random_midpoint(generations, *, hurst, deviation, seed):
    """Return heights of 2^generations + 1 a side, whose corners are 0 and whose lowest is not."""
    end = 2**generations
    heights, normal = np.zeros((end + 1, end + 1)), normal_deviates(seed)

    def displaced(mean):
        drawn = np.fromiter(normal, dtype=float, count=mean.size).reshape(mean.shape)
        return mean + deviation * drawn

    for generation in range(generations):
        step = end >> generation
        half = step // 2
        deviation *= 2.0 ** (-0.5 * hurst) if generation else 1.0
        corners, middles = np.s_[::step], np.s_[half::step]
        known = heights[corners, corners]
        heights[middles, middles] = displaced(
            (known[1:, 1:] + known[1:, :-1] + known[:-1, 1:] + known[:-1, :-1]) / 4.0
        )
        deviation *= 2.0 ** (-0.5 * hurst)
        centres = heights[middles, middles]
        # along the border, one height of each side in turn
        border = [known[:, 0], known[:, -1], known[0], known[-1]]
        within = [centres[:, 0], centres[:, -1], centres[0], centres[-1]]
        around = [line[1:] + line[:-1] + near for line, near in zip(border, within, strict=True)]
        sides = displaced(np.stack(around, axis=1) / 3.0).T
        heights[middles, 0], heights[middles, end], heights[0, middles], heights[end, middles] = (
            sides
        )
        inner = np.s_[step:end:step]
        heights[middles, inner] = displaced(
            (known[1:, 1:-1] + known[:-1, 1:-1] + centres[:, 1:] + centres[:, :-1]) / 4.0
        )
        heights[inner, middles] = displaced(
            (known[1:-1, 1:] + known[1:-1, :-1] + centres[1:] + centres[:-1]) / 4.0
        )
    return heights
