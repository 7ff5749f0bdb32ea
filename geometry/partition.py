"""The division of a rectangle along grid lines, even or not."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]


class Partition:
    """Rectangles between grid lines; rectangle (ix, iy) has the flat index ix Ny + iy."""

    __slots__ = ()

    @property
    @abstractmethod
    def borders_x(self) -> Array:
        """Borders along x, ascending, shape (Nx + 1,) [mm]."""

    @property
    @abstractmethod
    def borders_y(self) -> Array:
        """Borders along y, ascending, shape (Ny + 1,) [mm]."""

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rectangles (Nx, Ny)."""
        return len(self.borders_x) - 1, len(self.borders_y) - 1

    @property
    def count(self) -> int:
        """Number of rectangles N."""
        nx, ny = self.shape
        return nx * ny

    @property
    def sides(self) -> tuple[float, float]:
        """Sides (Lx, Ly) of the divided rectangle [mm]."""
        x, y = self.borders_x, self.borders_y
        return float(x[-1] - x[0]), float(y[-1] - y[0])

    @property
    def areas(self) -> Array:
        """Areas in flat order, shape (N,) [mm²]."""
        return np.outer(np.diff(self.borders_x), np.diff(self.borders_y)).ravel()

    @property
    def middle(self) -> Array:
        """Middle of the divided rectangle, shape (2,) [mm]."""
        x, y = self.borders_x, self.borders_y
        return np.array([0.5 * (x[0] + x[-1]), 0.5 * (y[0] + y[-1])])

    def mean_approaches(self, approach: float, tilt: tuple[float, float]) -> Array:
        """Return the mean approach of a rigid plane over every patch, shape (N,) [mm].

        Args:
            approach: Approach at the middle of the rectangle [mm].
            tilt: Slopes of the approach along x and y, about the middle.
        """
        return approach + (self.centres - self.middle) @ np.asarray(tilt)

    @property
    def half_sides(self) -> Array:
        """Half-sides (a, b) in flat order, shape (N, 2) [mm]."""
        return self._paired(0.5 * np.diff(self.borders_x), 0.5 * np.diff(self.borders_y))

    @property
    def centres(self) -> Array:
        """Centres in flat order, shape (N, 2) [mm]."""
        x, y = self.borders_x, self.borders_y
        return self._paired(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))

    @staticmethod
    def _paired(along_x: Array, along_y: Array) -> Array:
        mesh = np.meshgrid(along_x, along_y, indexing="ij")
        return np.stack([part.ravel() for part in mesh], axis=1)

    def index_of(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.intp]:
        """Return the flat index of the rectangle that holds each point.

        A border belongs to the rectangle above it, the far border to the last one: every point of
        the closed rectangle is in exactly one.

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
        return ix * self.shape[1] + iy


@dataclass(frozen=True, slots=True, kw_only=True)
class UnevenPartition(Partition):
    """Rectangles between stated grid lines.

    Args:
        ticks_x: Grid lines across x, ascending [mm].
        ticks_y: Grid lines across y, ascending [mm].

    Raises:
        InputError: When an axis has fewer than two grid lines or they do not ascend.
    """

    ticks_x: tuple[float, ...]
    ticks_y: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("ticks_x", "ticks_y"):
            ticks = np.asarray(getattr(self, name), dtype=np.float64)
            rises = ticks.ndim == 1 and len(ticks) > 1 and np.all(np.diff(ticks) > 0.0)
            if not (rises and np.all(np.isfinite(ticks))):
                raise InputError(
                    "the grid lines of a partition must ascend",
                    value=ticks.tolist(),
                    allowed="two numbers or more, each above the one before, in mm",
                    key=name,
                )
            object.__setattr__(self, name, tuple(map(float, ticks)))

    @property
    def borders_x(self) -> Array:
        """Borders along x, shape (Nx + 1,) [mm]."""
        return np.array(self.ticks_x)

    @property
    def borders_y(self) -> Array:
        """Borders along y, shape (Ny + 1,) [mm]."""
        return np.array(self.ticks_y)


def _interval_of(value: Array, borders: Array, axis: str) -> NDArray[np.intp]:
    outside = ~((value >= borders[0]) & (value <= borders[-1]))
    if outside.any():
        raise InputError(
            f"{int(outside.sum())} points lie outside the patches",
            value=float(value[outside].flat[0]),
            allowed=f"{borders[0]} ≤ {axis} ≤ {borders[-1]} mm",
        )
    return np.searchsorted(borders[1:-1], value, side="right")
