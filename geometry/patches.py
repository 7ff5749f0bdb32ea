"""Divisions of a contact face: of a rectangle into equal patches, or of any face into `Regions`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry.surface import Surface
from patchlaw.support import (
    Array,
    Grid,
    Indices,
    InputError,
    Lengths,
    check_fields,
    checked,
    did_you_mean,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchGrid:
    """Nx × Ny equal rectangular patches; patch (ix, iy) has the flat index ix Ny + iy.

    Args:
        grid: Numbers of patches (Nx, Ny).
        lengths: Sides (Lx, Ly) of the divided rectangle [mm].
        origin: Its lower corner [mm].

    Raises:
        InputError: When a number of patches is not whole and positive, a length not positive, or
            the origin not finite.
    """

    grid: Grid
    lengths: Lengths
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def count(self) -> int:
        """Number of patches N."""
        return self.grid[0] * self.grid[1]

    @property
    def size(self) -> tuple[float, float]:
        """Sides (sx, sy) of a patch [mm]."""
        return self.lengths[0] / self.grid[0], self.lengths[1] / self.grid[1]

    @property
    def half_sizes(self) -> tuple[float, float]:
        """Half sides (a, b) of a patch [mm], as Love's solution takes them."""
        return 0.5 * self.size[0], 0.5 * self.size[1]

    @property
    def area(self) -> float:
        """Area of one patch [mm²]."""
        return self.size[0] * self.size[1]

    @property
    def borders_x(self) -> Array:
        """Borders along x, ascending, shape (Nx + 1,) [mm]."""
        return _borders(self.origin[0], self.lengths[0], self.grid[0])

    @property
    def borders_y(self) -> Array:
        """Borders along y, ascending, shape (Ny + 1,) [mm]."""
        return _borders(self.origin[1], self.lengths[1], self.grid[1])

    @property
    def areas(self) -> Array:
        """Areas of the patches between their borders in flat order, shape (N,) [mm²]."""
        return np.outer(np.diff(self.borders_x), np.diff(self.borders_y)).ravel()

    @property
    def middle(self) -> Array:
        """Middle of the divided rectangle, shape (2,) [mm]."""
        return np.array([0.5 * (at[0] + at[-1]) for at in (self.borders_x, self.borders_y)])

    @property
    def centres(self) -> Array:
        """Centres in flat order, shape (N, 2) [mm]."""
        x, y = (0.5 * (at[1:] + at[:-1]) for at in (self.borders_x, self.borders_y))
        return np.stack([np.repeat(x, len(y)), np.tile(y, len(x))], axis=1)

    @checked
    def index_of(self, x: ArrayLike, y: ArrayLike) -> Indices:
        """Return the flat index of the patch that holds each point.

        A border belongs to the patch above it, the far border to the last one: every point of the
        closed rectangle is in exactly one.

        Args:
            x: Abscissae [mm]; broadcast against ``y``.
            y: Ordinates [mm].

        Returns:
            Flat indices of the broadcast shape.

        Raises:
            InputError: When a point lies outside the rectangle.
        """
        ix = _interval_of(np.asarray(x, dtype=np.float64), self.borders_x, "x")
        iy = _interval_of(np.asarray(y, dtype=np.float64), self.borders_y, "y")
        return ix * self.grid[1] + iy

    @checked
    def unravel(self, i: int) -> tuple[int, int]:
        """Return (ix, iy) of the patch with flat index ``i``.

        Raises:
            InputError: When there is no such patch.
        """
        if not 0 <= i < self.count:
            raise InputError("there is no such patch", value=i, allowed=f"0 … {self.count - 1}")
        return divmod(int(i), self.grid[1])

    @checked
    def bounds(self, i: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return ((x0, x1), (y0, y1)) of patch ``i`` [mm].

        Raises:
            InputError: When there is no such patch.
        """
        ix, iy = self.unravel(i)
        (x0, x1), (y0, y1) = self.borders_x[ix : ix + 2], self.borders_y[iy : iy + 2]
        return (float(x0), float(x1)), (float(y0), float(y1))

    @checked
    def single(self, i: int) -> PatchGrid:
        """Return the grid that holds patch ``i`` alone, at its place.

        Raises:
            InputError: When there is no such patch.
        """
        (x0, x1), (y0, y1) = self.bounds(i)
        return PatchGrid(grid=(1, 1), lengths=(x1 - x0, y1 - y0), origin=(x0, y0))


def _interval_of(value: Array, borders: Array, axis: str) -> Indices:
    outside = ~((value >= borders[0]) & (value <= borders[-1]))
    if outside.any():
        raise InputError(
            f"{int(outside.sum())} points lie outside the patches",
            value=float(value[outside].flat[0]),
            allowed=f"{borders[0]} ≤ {axis} ≤ {borders[-1]} mm",
        )
    return np.searchsorted(borders[1:-1], value, side="right")


@dataclass(frozen=True, slots=True)
class Regions:
    """Named parts of a face of any outline; what `PatchGrid` is to the patches of a rectangle.

    Args:
        names: Their names, in the order of their laws. A face in one piece is one region.

    Raises:
        InputError: When there is no name, an empty one, or one twice.
    """

    names: tuple[str, ...]

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "names", tuple(map(str, self.names)))
        if not self.names or not all(self.names) or len(set(self.names)) < len(self.names):
            raise InputError(
                "the regions of a face need names",
                value=list(self.names),
                allowed="one name or more, each once",
            )

    @property
    def count(self) -> int:
        """Number of regions N."""
        return len(self.names)

    def index(self, name: str) -> int:
        """Return the index of a region, and so of its law.

        Args:
            name: Its name.

        Raises:
            InputError: When there is no such region.
        """
        if name not in self.names:
            problem = f"there is no such region{did_you_mean(name, self.names)}"
            raise InputError(problem, value=name, allowed=", ".join(self.names))
        return self.names.index(name)


@lru_cache(maxsize=64)
def _borders(origin: float, length: float, count: int) -> Array:
    """Return the borders of equal intervals, not to be written to, shape (count + 1,) [mm]."""
    borders = origin + np.linspace(0.0, length, count + 1)
    borders.flags.writeable = False
    return borders


def patch_means(surface: Surface, patches: PatchGrid) -> Array:
    """Average the heights over every patch; cells that straddle a border are shared by area.

    Args:
        surface: Heights, constant on every cell here.
        patches: Patches inside the surface's rectangle.

    Returns:
        Mean heights in flat order, shape (N,) [mm].

    Raises:
        InputError: When a patch reaches beyond the surface.
    """
    return field_means(surface.heights, surface.lengths, patches)


def field_means(field: Array, lengths: tuple[float, float], patches: PatchGrid) -> Array:
    """Average a field on the cells of a rectangle over every patch; see `patch_means`.

    Args:
        field: The field, constant on every cell, shape (nx, ny).
        lengths: Sides of the rectangle [mm].
        patches: Patches inside the rectangle.

    Returns:
        Means in flat order, shape (N,).

    Raises:
        InputError: When a patch reaches beyond the rectangle.
    """
    shares_x, shares_y = mean_shares(patches, lengths, field.shape)
    return (shares_x @ field @ shares_y.T).ravel()


def mean_shares(
    patches: PatchGrid, lengths: tuple[float, float], grid: tuple[int, ...]
) -> tuple[Array, Array]:
    """Return the shares of rows of cells in the means over rows of patches, and of columns.

    Args:
        patches: Nx × Ny patches inside a rectangle.
        lengths: Sides of the rectangle, which equal cells divide [mm].
        grid: Their numbers (nx, ny).

    Returns:
        Shapes (Nx, nx) and (Ny, ny).

    Raises:
        InputError: When a patch reaches beyond the rectangle.
    """
    shares_x = _shares(tuple(patches.borders_x), lengths[0], grid[0], "x")
    return shares_x, _shares(tuple(patches.borders_y), lengths[1], grid[1], "y")


def overlaps(
    patches: PatchGrid, lengths: tuple[float, float], grid: tuple[int, int]
) -> tuple[Array, Array]:
    """Return the length of every row of cells in every row of patches, and of columns likewise.

    What lies beyond the outer borders counts for the nearest patch.

    Args:
        patches: Nx × Ny patches.
        lengths: Sides of a rectangle that equal cells divide [mm].
        grid: Their numbers (nx, ny).

    Returns:
        Shapes (Nx, nx) and (Ny, ny), not to be written to [mm].
    """
    along_x = _overlaps(tuple(patches.borders_x), lengths[0], grid[0])
    return along_x, _overlaps(tuple(patches.borders_y), lengths[1], grid[1])


@lru_cache(maxsize=64)
def _overlaps(borders: tuple[float, ...], length: float, cells: int) -> Array:
    """Return the length of every cell in every interval, shape (intervals, cells) [mm]."""
    endless = np.array([-np.inf, *borders[1:-1], np.inf])
    overlap = interval_overlaps(endless, np.linspace(0.0, length, cells + 1))
    overlap.flags.writeable = False
    return overlap


def interval_overlaps(first: Array, second: Array) -> Array:
    """Return the length that intervals of two divisions have in common, shape (n, m) [mm].

    Args:
        first: Ends of n adjoining intervals, ascending, shape (n + 1,) [mm].
        second: Ends of m others, shape (m + 1,) [mm].
    """
    upper = np.minimum(first[1:, None], second[1:])
    lower = np.maximum(first[:-1, None], second[:-1])
    return np.clip(upper - lower, 0.0, None)


@lru_cache(maxsize=64)
def _shares(borders: tuple[float, ...], length: float, cells: int, axis: str) -> Array:
    """Return the share of every cell in every interval's mean, shape (intervals, cells)."""
    slack = 1e-9 * length  # rounding of borders that were computed from an origin
    if borders[0] < -slack or borders[-1] > length + slack:
        raise InputError(
            f"the patches reach beyond the surface along {axis}",
            value=(float(borders[0]), float(borders[-1])),
            allowed=f"0 … {length} mm",
        )
    overlap = interval_overlaps(np.array(borders), np.linspace(0.0, length, cells + 1))
    return overlap / overlap.sum(axis=1, keepdims=True)
