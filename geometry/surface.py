"""A rough surface: heights on a regular grid and the smooth interpolant through them."""

from __future__ import annotations

import gc
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry.filters import levelled
from patchlaw.geometry.interpolant import Interpolant, cell_centres
from patchlaw.support.arguments import Heights, check_fields, checked
from patchlaw.support.arrays import Array
from patchlaw.support.checks import LARGEST, frozen_array, is_level, positive_lengths
from patchlaw.support.displayed import Displayed, Table
from patchlaw.support.errors import InputError


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
    lengths: tuple[float, float]
    periodic: bool = False
    source: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "lengths", positive_lengths(self.lengths, "the surface"))
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
