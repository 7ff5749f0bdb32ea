"""Which planes of a rectangular lattice stay on every coarser grid of a multigrid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kept = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]

_SLACK = 1.5
"""Longest merged interval, in lengths that the grid wants; 1.2 and 2 cost more iterations."""

_LEAST = 1.2
"""A coarser grid has at least this factor fewer nodes, lest it cost more than it gives."""

COARSEST = 1500
"""Unknowns that are solved for directly."""


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The planes of a lattice across one axis.

    Args:
        ticks: Their coordinates, ascending, shape (n,) [mm].
        middle: Whether they hold nodes amid the elements, of shape functions of degree 2, which
            cannot stay when a neighbour goes; shape (n,).
    """

    ticks: Array
    middle: NDArray[np.bool_]

    @classmethod
    def of_elements(cls, ticks: Array, degree: int) -> Lines:
        """Return the planes of the nodes of degree 1 or 2 of elements between some planes."""
        count = degree * (len(ticks) - 1) + 1
        finer = np.interp(np.arange(count) / degree, np.arange(len(ticks)), ticks)
        return cls(finer, np.arange(count) % degree > 0)

    def __len__(self) -> int:
        return len(self.ticks)

    def only(self, kept: NDArray[np.intp]) -> Lines:
        """Return some of the planes."""
        return Lines(self.ticks[kept], self.middle[kept])

    def merged(self, longest: float) -> NDArray[np.intp]:
        """Return what stays when pairs of intervals merge, from the last down.

        Args:
            longest: Length that a pair must not exceed [mm].
        """
        kept = [len(self) - 1]
        while kept[-1] > 0:
            end = kept[-1]
            pair = (
                end > 1
                and self.ticks[end] - self.ticks[end - 2] <= longest
                and not (self.middle[end] or self.middle[end - 2])
            )
            kept.append(end - (2 if pair else 1))
        return np.array(kept[::-1])

    def shares(self, kept: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array]:
        """Interpolate linearly from some planes to all.

        Args:
            kept: The planes from which.

        Returns:
            For every plane the last kept one at or before it, counted among the kept, and the
            weight of the next one, exactly 0 on a kept plane; shapes (n,).
        """
        before = np.searchsorted(kept, np.arange(len(self)), side="right") - 1
        after = np.minimum(before + 1, len(kept) - 1)
        start, end = self.ticks[kept[before]], self.ticks[kept[after]]
        length = np.where(after > before, end - start, 1.0)
        return before, (self.ticks - start) / length


def coarsenings(grid: Sequence[Lines], coarsest: int = COARSEST) -> list[Kept]:
    """Coarsen a lattice where its planes are close, until few unknowns are left.

    Unknowns couple most strongly along the shortest edges, and pointwise smoothing leaves errors
    that are smooth along them only. So the length that a grid wants doubles from grid to grid, and
    intervals merge where, and only where, they are shorter than that: flat cells become thick
    first, graded layers become even. In the end all cells grow in all directions.

    Args:
        grid: The planes across x, y and z.
        coarsest: Unknowns, three per node, that need no coarser grid.

    Returns:
        Which planes of a grid stay on the next one, for every grid but the coarsest. At least one
        coarser grid where there are nodes between corners.
    """
    found: list[Kept] = []
    longest = _SLACK * (1.0 + 1e-6) * min(float(np.diff(lines.ticks).min()) for lines in grid)
    while any(len(lines) > 2 for lines in grid) and (not found or 3 * _size(grid) > coarsest):
        coarser, kept = list(grid), [np.arange(len(lines)) for lines in grid]
        while _size(coarser) * _LEAST > _size(grid) and any(len(lines) > 2 for lines in coarser):
            longest *= 2.0
            stay = [lines.merged(longest) for lines in coarser]
            kept = [of[which] for of, which in zip(kept, stay, strict=True)]
            coarser = [lines.only(which) for lines, which in zip(coarser, stay, strict=True)]
        found.append((kept[0], kept[1], kept[2]))
        grid = coarser
    return found


def _size(grid: Sequence[Lines]) -> int:
    return int(np.prod([len(lines) for lines in grid]))
