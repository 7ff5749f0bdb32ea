"""Which planes of a rectangular lattice stay on every coarser grid of a multigrid.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kept = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]

_SLACK = 1.5
"""Longest merged interval relative to the target length; 1.2 and 2 took more iterations."""

_LEAST = 1.2
"""Smallest factor by which a coarser grid has fewer nodes; less would not repay its cost."""

COARSEST = 1500
"""Number of unknowns at which coarsening ends; the coarsest grid is solved by a factorisation."""


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The planes of a lattice across one axis.

    Args:
        ticks: Their coordinates, ascending, shape (n,) [mm].
        middle: Whether a plane holds the middle nodes of elements of degree 2, shape (n,). It
            cannot be kept without both of its neighbours.
    """

    ticks: Array
    middle: NDArray[np.bool_]

    @classmethod
    def of_elements(cls, ticks: Array, degree: int) -> Lines:
        """Return the planes through the nodes of elements of degree 1 or 2 between grid planes."""
        count = degree * (len(ticks) - 1) + 1
        finer = np.interp(np.arange(count) / degree, np.arange(len(ticks)), ticks)
        return cls(finer, np.arange(count) % degree > 0)

    def __len__(self) -> int:
        return len(self.ticks)

    def only(self, kept: NDArray[np.intp]) -> Lines:
        """Return some of the planes."""
        return Lines(self.ticks[kept], self.middle[kept])

    def merged(self, longest: float) -> NDArray[np.intp]:
        """Return the planes that are kept when pairs of intervals merge, from the last one down.

        Args:
            longest: Largest length of a merged pair [mm].
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
            kept: Indices of the planes to interpolate from.

        Returns:
            For every plane the last kept plane at or before it, as an index into ``kept``, and the
            weight of the next kept plane, exactly 0 on a kept plane; shapes (n,).
        """
        before = np.searchsorted(kept, np.arange(len(self)), side="right") - 1
        after = np.minimum(before + 1, len(kept) - 1)
        start, end = self.ticks[kept[before]], self.ticks[kept[after]]
        length = np.where(after > before, end - start, 1.0)
        return before, (self.ticks - start) / length


def coarsenings(grid: Sequence[Lines], coarsest: int = COARSEST) -> list[Kept]:
    """Coarsen a lattice where its planes are close, until few unknowns are left.

    Unknowns are coupled most strongly along the shortest edges, and pointwise smoothing removes
    errors along those edges only. So a target length doubles from grid to grid, and intervals merge
    only where they are shorter than it: flat cells become thick first, and graded layers become
    even. After that all cells grow in all directions.

    Args:
        grid: The planes across x, y and z.
        coarsest: Number of unknowns, three per node, at which coarsening ends.

    Returns:
        The kept planes of every grid but the coarsest. There is at least one coarser grid unless
        all nodes are corners of the block.
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
