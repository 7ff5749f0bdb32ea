"""Transmissivity of a rough face over its mean separation, as a law of it has it.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import scipy

from support.arrays import Array
from support.errors import InputError

CAUSES = "grid", "rows", "samples"
"""Causes of the error of a transmissivity."""
_OF_ROWS = 3.0
"""Error by the rows over the change where every second one is left out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmissivity:
    """Transmissivity T along x and y over the mean separation.

    Between rows the hydraulic gap T^(1/3) is interpolated monotonically (PCHIP). Beyond the last
    row it grows as the separation, and below the first one it stays.

    Attributes:
        separation: Mean separations, rising, shape (m,) [mm].
        hydraulic_gap: T^(1/3) along x and y, 0 where closed, shape (m, 2) [mm].
        on_half: The same with half as many cells a side, shape (m, 2) [mm].
        scatter: Standard deviation of T among the samples of a law at the same mean pressure,
            shape (m, 2) [mm³]; 0 of one.

    Raises:
        InputError: When the columns do not fit each other, or separations do not rise.
    """

    separation: Array
    hydraulic_gap: Array
    on_half: Array
    scatter: Array

    def __post_init__(self) -> None:
        count = len(self.separation)
        for one in fields(self):
            values, shape = getattr(self, one.name), (count, 2)[: 1 + (one.name != "separation")]
            if not count or values.shape != shape or not np.isfinite(values).all():
                raise InputError(
                    f"a transmissivity needs a finite {one.name}",
                    value=values.shape,
                    allowed=f"{shape}",
                )
            if (values < 0.0).any():
                raise InputError(f"a transmissivity needs a {one.name} ≥ 0")
        if (np.diff(self.separation) <= 0.0).any():
            raise InputError("a transmissivity needs separations that rise")

    def at(self, separation: Array) -> Array:
        """Return the transmissivities along x and y at mean separations, shape (n, 2) [mm³].

        Args:
            separation: Mean separations, shape (n,) [mm].
        """
        return self._interpolated(separation, self.separation, self.hydraulic_gap)

    def varied(self, cause: str, separation: Array, samples: float = 0.0) -> Array:
        """Return the transmissivities with one cause of error varied, shape (n, 2) [mm³].

        Args:
            cause: One of `CAUSES`: half of the cells; rows left out; what the mean of the samples
                may be too low by.
            separation: Mean separations, shape (n,) [mm].
            samples: Error of the mean of samples over the standard deviation among them.
        """
        if cause == "grid":
            return self._interpolated(separation, self.separation, self.on_half)
        if cause == "samples":
            scatter = [np.interp(separation, self.separation, one) for one in self.scatter.T]
            return self.at(separation) + samples * np.stack(scatter, axis=1)
        closed = int((self.hydraulic_gap.max(axis=1) == 0.0).sum())
        kept = np.ones(len(self.separation), bool)
        kept[closed:-1:2] = False  # beginning with the last open one, next to closing
        fewer = self._interpolated(separation, self.separation[kept], self.hydraulic_gap[kept])
        whole = self.at(separation)
        return np.asarray(whole + _OF_ROWS * (fewer - whole))

    @staticmethod
    def _interpolated(separation: Array, rows: Array, gaps: Array) -> Array:
        first, last = rows[[0, -1]]
        within, beyond = np.clip(separation, first, last), np.maximum(separation - last, 0.0)
        if len(rows) == 1:
            return np.asarray((gaps + beyond[:, None]) ** 3)
        gap: Any = scipy.interpolate.PchipInterpolator(rows, gaps)(within)
        return np.asarray((np.maximum(gap, 0.0) + beyond[:, None]) ** 3)
