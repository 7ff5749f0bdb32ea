"""A rough surface: heights on a grid, their smooth interpolant, and what approaches count from.

Models, laws and load steps count from first touch, the highest point of the interpolant. What is
prescribed of them and what is shown of them counts from the zero, by one number: its depth.
"""

from __future__ import annotations

import gc
import math
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry.filters import levelled
from patchlaw.geometry.interpolant import Interpolant, bordered, cell_centres
from patchlaw.support import Array, Heights, Indices, InputError, Lengths, check_fields, checked
from patchlaw.support.checks import LARGEST, frozen_array, is_level
from patchlaw.support.readable import Displayed, Table


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Surface(Displayed):
    """Heights at the centres of nx × ny equal cells of a rectangle.

    The sample [ix, iy] lies at x = (ix + ½) Lx/nx, y = (iy + ½) Ly/ny.

    Args:
        heights: Heights, shape (nx, ny) [mm]; kept as a read-only float64 copy. Masked ones are
            not a number. Heights that differ by rounding alone become one height.
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        periodic: Whether the heights continue periodically in both directions.
        source: Where the heights came from and what was done to them, for reports.
        notes: What a user should know of the heights before they are pressed.

    Raises:
        InputError: When the heights are not a finite array of at least 4 × 4 or a length is not
            positive.
    """

    HOW: ClassVar[str] = "read_surface, synthesise or Surface(heights=…, lengths=…)"
    """How users make one, for errors."""

    heights: Array
    lengths: Lengths
    periodic: bool = False
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "heights", _checked_heights(self.heights))

    def displayed(self) -> tuple[str, Table]:
        """Return grid and size in a line, and a table of what is known of the heights."""
        line = "Surface of {} × {} heights on {:.6g} × {:.6g} mm".format(*self.grid, *self.lengths)
        rows = [
            ("spacing", "{:.4g} × {:.4g} µm".format(*(1e3 * side for side in self.spacing))),
            ("rms height", f"{1e3 * self.heights.std():.4g} µm"),
            ("lowest to highest", f"{1e3 * np.ptp(self.heights):.4g} µm"),
            ("periodic", "yes" if self.periodic else "no"),
            *((("source", self.source),) if self.source else ()),
        ]
        return line, (("", "heights"), rows)

    @property
    def grid(self) -> tuple[int, int]:
        """Numbers of cells (nx, ny)."""
        nx, ny = self.heights.shape
        return nx, ny

    @property
    def spacing(self) -> tuple[float, float]:
        """Sides (dx, dy) of a cell [mm]."""
        return self.lengths[0] / self.grid[0], self.lengths[1] / self.grid[1]

    @property
    def area(self) -> float:
        """Nominal area Lx Ly [mm²]."""
        return self.lengths[0] * self.lengths[1]

    @property
    def x(self) -> Array:
        """Cell centres along x, shape (nx,) [mm]."""
        return cell_centres(self.lengths[0], self.grid[0])

    @property
    def y(self) -> Array:
        """Cell centres along y, shape (ny,) [mm]."""
        return cell_centres(self.lengths[1], self.grid[1])

    @property
    def mean_height(self) -> float:
        """Mean of the heights [mm]."""
        return float(self.heights.mean())

    @cached_property
    def interpolant(self) -> Interpolant:
        """The smooth surface through the heights that every coupling sees."""
        return Interpolant(self.heights, self.lengths, periodic=self.periodic)

    @property
    def highest(self) -> float:
        """Height z_M of the highest point of the interpolant [mm]; approach counts from it."""
        return self._summit[2]

    @property
    def highest_point(self) -> tuple[float, float]:
        """Position (x, y) of the highest point of the interpolant [mm]."""
        return self._summit[:2]

    @cached_property
    def _summit(self) -> tuple[float, float, float]:
        return self._of_interpolant[0] if self._is_large else self.interpolant.maximum()

    @cached_property
    def mean_squares(self) -> list[float]:
        """Squares of the interpolant and its derivatives, see `Interpolant.mean_squares`."""
        return self._of_interpolant[1] if self._is_large else self.interpolant.mean_squares()

    @property
    def _is_large(self) -> bool:
        """Whether the interpolant, three times as large as the heights, is not kept."""
        return self.heights.size > 2**20 and "interpolant" not in vars(self)

    @cached_property
    def _of_interpolant(self) -> tuple[tuple[float, float, float], list[float]]:
        """Highest point and mean squares of the interpolant of a large surface."""
        spline = Interpolant(self.heights, self.lengths, periodic=self.periodic)
        found = spline.maximum(), [] if self.periodic else spline.mean_squares()
        del spline
        gc.collect()  # what scipy minimised refers to itself, and would keep the interpolant
        return found

    @checked
    def height_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Evaluate the interpolant at any points, up to and on the border.

        Args:
            x: Abscissae [mm]; broadcast against ``y``.
            y: Ordinates [mm].

        Returns:
            Heights of the broadcast shape [mm].

        Raises:
            InputError: When a point lies outside a surface that is not periodic.
        """
        return self.interpolant(x, y)

    @checked
    def detrended(self, order: int = 1) -> Surface:
        """Subtract the least-squares polynomial of total degree ``order``.

        A plane or a quadratic does not continue periodically, so the result is periodic only for
        order 0. Where only rounding remains, the result is exactly level.

        Args:
            order: 0 mean, 1 mean plane, 2 mean quadratic.

        Raises:
            InputError: For another order.
        """
        heights = levelled(self.heights, order)
        return replace(self, heights=heights, periodic=self.periodic and order == 0)

    @checked
    def piece(self, x: tuple[float, float], y: tuple[float, float]) -> Surface:
        """Return what lies in a rectangle, with the interpolant of the whole.

        It ends exactly at these coordinates and rises nowhere above the whole, whereas a spline
        through the heights of the rectangle alone may do so by micrometres. Its cells are those of
        the whole where they fill the rectangle, otherwise a little smaller; there are at least
        4 × 4.

        Args:
            x: Interval (lo, hi) along x [mm].
            y: Interval (lo, hi) along y [mm].

        Returns:
            A surface that is not periodic, whose origin is the rectangle's lower corner.

        Raises:
            InputError: When an interval is empty or leaves the surface.
        """
        (x0, x1), (y0, y1) = map(_within, (x, y), self.lengths, "xy")
        lengths = x1 - x0, y1 - y0
        # rounding alone makes no further cell
        cells = (max(ceil(a / b - 1e-6), 4) for a, b in zip(lengths, self.spacing, strict=True))
        at_x, at_y = map(cell_centres, lengths, cells)
        interpolant = self.interpolant.window((x0, y0), lengths)
        heights = interpolant(at_x[:, None], at_y[None])
        part = replace(self, heights=heights, lengths=lengths, periodic=False)
        # not a field: `replace` must not pass the interpolant on with other heights
        vars(part)["interpolant"] = interpolant
        return part

    @checked
    def on_grid(self, grid: tuple[Heights, Heights]) -> Surface:
        """Return the interpolant on other cells of the same rectangle.

        Args:
            grid: Cells in x and y.
        """
        if grid == self.grid:
            return self
        x, y = map(cell_centres, self.lengths, grid)
        return replace(self, heights=self.height_at(x[:, None], y[None]))

    @checked
    def shifted(self, i: int, j: int) -> Surface:
        """Move a periodic surface by whole cells.

        Args:
            i: Cells along x; the height at cell (0, 0) moves to (i, j).
            j: Cells along y.

        Raises:
            InputError: When the surface is not periodic.
        """
        if not self.periodic:
            raise InputError("only a periodic surface can be shifted")
        return replace(self, heights=np.roll(self.heights, (i, j), axis=(0, 1)))

    @checked
    def scaled(self, factor: float) -> Surface:
        """Multiply all heights by ``factor``."""
        return replace(self, heights=self.heights * factor)


def _checked_heights(heights: ArrayLike) -> Array:
    array = frozen_array(heights)
    if array.ndim != 2 or min(array.shape) < 4:
        raise InputError(
            "a surface needs at least 4 × 4 heights on a two-dimensional grid",
            value=array.shape,
            allowed="shape (nx, ny) with nx, ny ≥ 4",
        )
    bad = np.argwhere(~(np.abs(array) <= LARGEST))
    if len(bad):
        first = tuple(int(index) for index in bad[0])
        raise InputError(
            f"{len(bad)} of {array.size} heights are masked, not finite or of no scale, the first "
            f"at index {first}",
            value=float(array[first]),
            allowed=f"finite heights in mm, within ±{LARGEST:g}",
        )
    if is_level(array):  # summits of rounding are none
        return frozen_array(np.full(array.shape, array[0, 0]))
    return array


def _within(interval: tuple[float, float], length: float, axis: str) -> tuple[float, float]:
    """Return an interval, cut to the surface where rounding alone takes it beyond."""
    low, high = map(float, interval)
    slack = 1e-9 * length  # of coordinates that were computed from an origin
    if not -slack <= low < high <= length + slack:
        raise InputError(
            f"the piece along {axis} does not lie within the surface or is empty",
            value=(low, high),
            allowed=f"0 ≤ lo < hi ≤ {length} mm",
        )
    return max(low, 0.0), min(high, length)


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

    def error(self, surfaces: Sequence[Surface]) -> float:
        """Return the error of the zero's height, as far as the heights' cells decide it [mm].

        That of first touch is what another interpolant, and the surface without its outer half
        cells, changes; those of a mean and of a quantile are what they are on every second cell.
        Any of some samples may truly be the highest.

        Args:
            surfaces: The surface, or samples of it, whose mean planes are one plane.
        """
        if self.name == FIRST_TOUCH:
            tops = [one.highest - one.mean_height for one in surfaces]
            return max(
                top - max(tops) + _error_of_top(one)
                for top, one in zip(tops, surfaces, strict=True)
            )
        return float(np.mean([self._error_of(one) for one in surfaces]))

    def _error_of(self, surface: Surface) -> float:
        """Return the error of a mean's or quantile's height above the mean plane [mm]."""
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
