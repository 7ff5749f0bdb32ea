"""The half-space model against MIRCO (imcs-compsim/MIRCO, commit de05a25): sup7, sup9.

MIRCO solves the contact conditions by non-negative least squares on a dense matrix (Bonari et al.
2020, doi 10.1007/s00466-019-01791-3). Pressures and contact areas are those that its own tests
expect; shape factors those that it was given for a flat punch on n × n cells. The surfaces are
drawn anew by `random_midpoint`.
"""

from typing import NamedTuple

import numpy as np
import pytest

from patchlaw.geometry import Control, Surface
from patchlaw.micro import HalfSpaceModel

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
    """Return heights of 2^generations + 1 a side, whose corners are 0 and whose lowest is not.

    Random-midpoint displacement (Fournier, Fussell & Carpenter 1982, doi 10.1145/358523.358553) as
    MIRCO has it: every generation fills the middles of squares with the mean of their four corners,
    then those of sides with the mean of their neighbours (three on the border), plus a normal
    deviate whose standard deviation falls by 2^(H/2) before each of the two but the first.
    """
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


LENGTH, E_STAR = 1000.0, 1.0 / (2.0 * (1.0 - 0.3**2))
SHAPE_FACTORS = {
    8: 0.9037519877715218,
    32: 0.8770287405762021,
    129: 0.8701463093314787,
    513: 0.8684174965138375,
}


class Case(NamedTuple):
    """What sup7 and sup9 are given, and what is expected of them."""

    generations: int
    deviation: float
    approach: float
    pressure: float
    area_fraction: float


SUP7 = Case(7, 20.0, 10.0, 4.526213923013545e-4, 6.970734931794964e-3)
SUP9 = Case(9, 100.0, 40.0, 1.181045297945221e-3, 2.352100741348715e-3)


def shape_factor(cells):
    """Return E* δ L / F of a flat punch on n × n cells of pressure."""
    flat = Surface(heights=np.zeros((cells, cells)), lengths=(LENGTH, LENGTH))
    model = HalfSpaceModel(flat, contact_modulus=E_STAR, tolerance=1e-12)
    return E_STAR * LENGTH / model.press(Control(approach=1.0)).force


def pressed(case):
    """Return mean pressure and contact area fraction.

    The patch lies on a body: what its mean pressure indents a half-space by as a flat punch is
    added to the approach, until the force changes by less than one per cent.
    """
    heights = random_midpoint(case.generations, hurst=0.7, deviation=case.deviation, seed=95)
    surface = Surface(heights=heights, lengths=(LENGTH, LENGTH))
    model = HalfSpaceModel(surface, contact_modulus=E_STAR, highest=heights.max(), tolerance=1e-10)
    stiffness = LENGTH * E_STAR / SHAPE_FACTORS[len(heights)]
    state, change = model.press(Control(approach=case.approach)), np.inf
    while change > 0.01:
        before = state
        state = model.press(
            Control(approach=case.approach + before.force / stiffness), start=before.guess
        )
        change = abs(state.force - before.force) / state.force
    return state.force / surface.area, state.in_contact.mean()


# their numbers agree with ours to 3e-12; 1e-9 leaves room for other libraries' rounding
@pytest.mark.parametrize("case", [SUP7, pytest.param(SUP9, marks=pytest.mark.long)])
def test_rough_patches(case):
    pressure, area_fraction = pressed(case)
    assert pressure == pytest.approx(case.pressure, rel=1e-9)
    assert area_fraction == pytest.approx(case.area_fraction, rel=1e-12)  # the same cells


@pytest.mark.parametrize("cells", [8, 32, 129, pytest.param(513, marks=pytest.mark.long)])
def test_flat_punches(cells):
    # theirs is 1.2e-10 off on 513² cells, 5e-13 on fewer
    assert shape_factor(cells) == pytest.approx(SHAPE_FACTORS[cells], rel=5e-10)
