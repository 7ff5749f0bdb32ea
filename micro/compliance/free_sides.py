"""What the free sides of a block add to the half-space near them.

Each side adds what it would add to a quarter-space, within a reach λ: waves along it longer than
2π λ count as waves of that length. What is left out so is smooth up to the very side, and so is
what the block does beyond its four quarter-spaces, but in its corners.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Partition
from geometry.errors import InputError
from micro.compliance.distance_nodes import distance_nodes, means_over, values_at
from micro.compliance.quarter_space import quarter_space
from micro.compliance.quarter_space_stresses import quarter_space_stresses

Array = NDArray[np.float64]

_SHORTEST = 24.0  # waves on the shortest rectangle along the side
_NEAREST = 1.0 / 256.0  # of the narrowest rectangle across it: the first node
_STRESS_REACH = 2.0
"""Reach of stresses over that of displacements.

With it the first-order effect of slopes on a smooth load at or beside a side differed by −0.7 to
2.3 % from that in meshed cubes and columns (ν 0 to 0.45), and by −2 to −6 % in blocks half or a
fifth as high as wide. In cubes, half the reach makes it −10 to 1 %, none 5 to 15 %.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeSides:
    """The four free sides of a rectangle on top of a block.

    Pressures continue periodically along a side, with twice its length as period; as the reach is
    less than that, it hardly matters.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        poisson_ratio: ν.
        decay_length: λ [mm].

    Raises:
        InputError: When a length is not positive, or ν out of its range.
    """

    lengths: tuple[float, float]
    poisson_ratio: float
    decay_length: float

    def __post_init__(self) -> None:
        given = (*self.lengths, self.decay_length)
        if not (np.all(np.isfinite(given)) and min(given) > 0.0):
            raise InputError(
                "lengths and decay length must be positive", value=given, allowed="> 0 mm"
            )
        if not -1.0 < self.poisson_ratio < 0.5:
            raise InputError(
                "Poisson's ratio is out of range", value=self.poisson_ratio, allowed="−1 < ν < ½"
            )

    def compliance(self, axis: int, distances: Array, waves: NDArray[np.intp]) -> Array:
        """Return what one side adds at distances by line loads at distances, for E* = 1.

        Args:
            axis: 0 for sides across x, 1 across y.
            distances: From the side, shape (n,) [mm].
            waves: Numbers of waves on twice the length of the side, shape (w,).

        Returns:
            Shape (w, n, n); symmetric.
        """
        space = quarter_space(self.poisson_ratio)
        numbers = self._wave_numbers(axis, waves, self.decay_length)
        return np.stack([space.compliance(distances, number) for number in numbers])

    def stresses(self, axis: int, distances: Array, waves: NDArray[np.intp]) -> Array:
        """Return the stresses that one side adds at distances by line loads at distances.

        They have twice the reach of displacements. At the side they cancel the half-space's
        stresses, which know of no reach.

        Args:
            axis: 0 for sides across x, 1 across y.
            distances: From the side, shape (n,) [mm].
            waves: Numbers of waves on twice the length of the side, shape (w,).

        Returns:
            Normal to the side, along it, and in shear, shape (3, w, n, n), the loads last [1/mm].
        """
        space = quarter_space_stresses(self.poisson_ratio)
        numbers = self._wave_numbers(axis, waves, _STRESS_REACH * self.decay_length)
        found = np.stack([space.stresses(distances, number) for number in numbers], axis=1)
        apart = np.add.outer(distances, distances)
        taken, due = (
            number[:, None, None] * np.exp(-np.multiply.outer(number, apart))
            for number in (numbers, np.pi * waves / self.lengths[1 - axis])
        )
        rest = (0.5 - self.poisson_ratio) * (taken - due)
        found[0] += rest
        found[2] -= rest
        return found

    def _wave_numbers(self, axis: int, waves: NDArray[np.intp], decay_length: float) -> Array:
        """Return the wave numbers along a side, those of waves beyond the reach raised to 1/λ."""
        numbers = np.pi * waves / self.lengths[1 - axis]
        larger, smaller = (
            np.maximum(numbers, 1.0 / decay_length),
            np.minimum(numbers, 1.0 / decay_length),
        )
        return np.asarray(larger * (1.0 + (smaller / larger) ** 4) ** 0.25)

    def top(self, x: Array, y: Array, loads: Partition) -> Array:
        """Return the displacement of points by unit pressure on rectangles, for E* = 1.

        Args:
            x: Abscissae, shape (nx,) [mm].
            y: Ordinates, shape (ny,) [mm].
            loads: M rectangles.

        Returns:
            Shape (nx, ny, M) [mm].
        """
        total = self._by_two(0, x, y, loads.borders_x, loads.borders_y)
        total += self._by_two(1, y, x, loads.borders_y, loads.borders_x).transpose(1, 0, 3, 2)
        return total.reshape(len(x), len(y), loads.count)

    def _by_two(self, axis: int, across: Array, along: Array, rows: Array, columns: Array) -> Array:
        """Return what two opposite sides add, shape (across, along, rows, columns)."""
        length, period = self.lengths[axis], 2.0 * self.lengths[1 - axis]
        waves = np.arange(int(np.ceil(_SHORTEST * period / float(np.diff(columns).min()))))
        nodes = distance_nodes(_NEAREST * float(np.diff(rows).min()), length)
        compliance = self.compliance(axis, nodes, waves)
        phase = _along(waves, period, along, columns)
        near = values_at(nodes, across).toarray(), means_over(nodes, rows).toarray()
        far = (
            values_at(nodes, length - across).toarray(),
            means_over(nodes, length - rows[::-1]).toarray()[::-1],
        )
        total = np.zeros((len(across), len(rows) - 1, *phase.shape[1:]))
        for seen, loaded in (near, far):
            lines = seen @ compliance @ (loaded * np.diff(rows)[:, None]).T
            total += np.tensordot(lines, phase, axes=(0, 0))
        return total.transpose(0, 2, 1, 3)


def _along(waves: NDArray[np.intp], period: float, points: Array, borders: Array) -> Array:
    """Return Fourier's coefficients of unit loads on intervals, times the waves at points.

    Shape (waves, points, intervals).
    """
    numbers = 2.0 * np.pi * waves / period
    widths, middles = np.diff(borders), 0.5 * (borders[1:] + borders[:-1])
    phase = np.cos(numbers[:, None, None] * np.subtract.outer(points, middles))
    phase *= (np.sinc(np.multiply.outer(waves / period, widths)) * widths)[:, None]
    phase *= 2.0 / period
    phase[0] *= 0.5
    return np.asarray(phase)
