"""The height that approaches count from: first touch, the mean plane or a quantile of the heights.

Models, laws and load steps count from first touch, the highest point of the interpolant. What is
prescribed of them and what is shown of them counts from the zero, by one number: its depth.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from patchlaw.geometry.interpolant import bordered
from patchlaw.geometry.surface import Surface
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.errors import InputError

Axis = tuple[Indices, Array, Array]

FIRST_TOUCH, MEAN_PLANE = "first touch", "mean plane"
ALLOWED = "'first touch', 'mean plane', or 'quantile 0.001' with any number between 0 and 1"
_QUANTILE = re.compile(r"quantile\s+((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)", re.ASCII)


@dataclass(frozen=True, slots=True)
class Zero:
    """What approaches count from.

    Args:
        name: ``"first touch"``, ``"mean plane"``, or ``"quantile Q"``: the height that a share Q of
            the area exceeds.

    Raises:
        InputError: When the name is another.
    """

    name: str = FIRST_TOUCH

    def __post_init__(self) -> None:
        if self.name not in (FIRST_TOUCH, MEAN_PLANE) and not 0.0 < self.share < 1.0:
            raise InputError("is no height that approaches count from", allowed=ALLOWED)

    @property
    def share(self) -> float:
        """Share of the area that lies higher than a quantile; NaN where there is none."""
        quantile = _QUANTILE.fullmatch(self.name)
        return float(quantile[1]) if quantile else math.nan

    def depth(self, surfaces: Sequence[Surface]) -> float:
        """Return how far the zero lies below the highest point [mm].

        Args:
            surfaces: The surface, or samples of it, whose mean planes are one plane.

        Raises:
            InputError: When the quantile is exceeded by less than a cell.
        """
        if self.name == FIRST_TOUCH:
            return 0.0
        top = max(one.highest - one.mean_height for one in surfaces)
        return top - self._height(surfaces)

    def error(self, surface: Surface) -> float:
        """Return the error of the zero's height, as far as the heights' cells decide it [mm].

        That of first touch is what another interpolant, and the surface without its outer half
        cells, changes; those of a mean and of a quantile are what they are on every second cell.
        """
        if self.name == FIRST_TOUCH:
            return _error_of_top(surface)
        heights = surface.heights - surface.mean_height
        parts = [heights[i::2, j::2].ravel() for i in range(2) for j in range(2)]
        if self.name == MEAN_PLANE:  # opposite quarters, so that an inclination has none
            return abs(float(parts[0].mean() + parts[3].mean() - parts[1].mean() - parts[2].mean()))
        known = _exceeded_by(heights.ravel(), self.share)
        return float(np.mean([abs(_exceeded_by(part, self.share) - known) for part in parts]))

    def _height(self, surfaces: Sequence[Surface]) -> float:
        """Return the height of the zero above the mean plane [mm]."""
        if self.name == MEAN_PLANE:
            return 0.0
        heights = np.concatenate([(one.heights - one.mean_height).ravel() for one in surfaces])
        if self.share * heights.size < 1.0:
            raise InputError(
                f"less than one of {heights.size} heights is above this quantile",
                value=self.name,
                allowed=f"at least quantile {1.0 / heights.size:.2g}",
            )
        return _exceeded_by(heights, self.share)


def _exceeded_by(heights: Array, share: float) -> float:
    """Return the height that a share of equal cells exceeds; the next lower one between two."""
    above = min(int(share * heights.size * (1.0 + 1e-12)), heights.size - 1)
    return float(np.partition(heights, heights.size - 1 - above)[heights.size - 1 - above])


def _error_of_top(surface: Surface) -> float:
    """Return by how much the height of the highest point may be off [mm].

    Quintic splines show the cubic one's error where the surface is smooth. Akima's local cubics
    hardly overshoot at the edges of grooves; they end at the outermost samples. They depend on the
    order of the axes, so that the mean of both orders counts.
    """
    samples = surface.heights if surface.periodic else bordered(surface.heights)
    top = np.floor(np.divide(surface.highest_point, surface.spacing)).astype(int)
    quintic, axes_of, windows = -np.inf, {}, defaultdict[Any, list[Array]](list)
    for cell in {(int(i), int(j)) for i, j in (*_highest_cells(surface.heights), top)}:
        axes = [_axis(surface, axis, cell[axis]) for axis in range(2)]
        (rows, columns), (u, v), (x, y) = zip(*axes, strict=True)
        window = samples[np.ix_(rows, columns)] - surface.highest
        degrees = {"kx": min(5, len(u) - 1), "ky": min(5, len(v) - 1)}
        spline = scipy.interpolate.RectBivariateSpline(u, v, window, s=0, **degrees)
        quintic = max(quintic, float(spline(x, y).max()))
        if not surface.periodic:
            (ins, u, x), (within, v, y) = (
                _without_border(surface, axis, one) for axis, one in enumerate(axes)
            )
            window = window[np.ix_(ins, within)]
        # cells that have as many others around them are interpolated together
        lowest = np.divide((u[0], v[0]), surface.spacing).astype(int)
        around = (*(lowest - cell), *window.shape)
        axes_of[around] = u, v, x, y
        windows[around].append(window)
    akima = -np.inf
    for around, (u, v, x, y) in axes_of.items():
        stack = np.stack(windows[around], axis=-1)
        turned = _akima(v, u, stack.swapaxes(0, 1), y, x).swapaxes(0, 1)
        akima = max(akima, float((0.5 * (_akima(u, v, stack, x, y) + turned)).max()))
    # Beyond 1.5 times this error are one of 24 plateau-honed surfaces of 8 to 16 heights per wave,
    # and one of 36 self-affine ones of 3 heights and more; with 2 in place of 8 seven and two.
    return float(max(8.0 * abs(quintic), abs(akima)))


def _highest_cells(heights: Array) -> Indices:
    """Return the indices of the twelve highest cells, without equal ones beyond, shape (n, 2)."""
    least = np.partition(heights, -12, axis=None)[-12]
    highest = np.argwhere(heights >= least)
    return highest if len(highest) <= 2 * 12 else np.argwhere(heights > least)


def _akima(u: Array, v: Array, samples: Array, x: Array, y: Array) -> Array:
    """Return Akima's cubics along the first axis, and along the second one through these.

    Samples have the shape (u, v, n), and the values (x, y, n).
    """
    lines = scipy.interpolate.Akima1DInterpolator(u, samples)(x)
    return np.asarray(scipy.interpolate.Akima1DInterpolator(v, lines, axis=1)(y))


def _axis(surface: Surface, axis: int, cell: int) -> Axis:
    """Return rows of samples around a cell, where they are, and points near the cell [mm]."""
    count, step, length = surface.grid[axis], surface.spacing[axis], surface.lengths[axis]
    near = step * (cell + 0.5 + np.linspace(-1.5, 1.5, 73))
    # the influence of a sample on a quintic spline falls by 0.43 a cell
    rows = np.arange(cell - 10, cell + 11)
    if surface.periodic:
        return rows % count, step * (rows + 0.5), near
    rows = rows[(rows >= -1) & (rows <= count)]
    places = np.clip(step * (rows + 0.5), 0.0, length)
    return rows + 1, places, near[(near >= 0.0) & (near <= length)]


def _without_border(surface: Surface, axis: int, given: Axis) -> Axis:
    """Return which rows of `_axis` are no border, where they are, and the points among them."""
    rows, places, near = given
    inner = np.flatnonzero((rows >= 1) & (rows <= surface.grid[axis]))
    places = places[inner]
    return inner, places, near[(near >= places[0]) & (near <= places[-1])]
