"""Watersheds of a surface: the volumes and moments above any level, and connected regions.

The samples of each watershed are sorted by depth below its peak, and their moments are summed up
in that order. So the sums above a level, which may differ between watersheds, cost one search for
each peak.

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geometry import Surface
from geometry.summits import coincident, constrained_summits
from micro.islands.division import Saddles, divided, saddles_between, sampled

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MOST_WHOLE = 2**20
"""Cells of the largest surface whose watersheds are found as a whole, once for all planes."""

_MARGIN = 1.2
"""Depth of watersheds that are not found as a whole, in units of the approach."""
_FEW = 32  # samples of the smallest cap that has a shape of its own
_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
_ORDER = np.array([2.0, 2.5, 2.5, 3.0, 3.0, 3.0])[:, None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Watersheds:
    """The watersheds of n peaks.

    Args:
        x: Abscissae of the peaks, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        z: Heights, shape (n,) [mm].
        saddles: Highest saddles between touching watersheds.
        owner: Peak of every sample, by watershed and there by depth, shape (s,).
        sample: Flat indices of the samples, shape (s,).
        depth: Depths of the samples below their peak, shape (s,) [mm].
        sums: Sums over the samples before each, in their order, of X^p Y^q from their peak for the
            six powers up to 2, and of the same times the depths, shape (2, 6, s + 1).
        grid: Numbers of samples over the surface.
        cell: Area of a sample [mm²].
    """

    x: Array
    y: Array
    z: Array
    saddles: Saddles
    owner: Indices
    sample: Indices
    depth: Array
    sums: Array
    grid: tuple[int, int]
    cell: float

    @classmethod
    def of(
        cls,
        surface: Surface,
        *,
        tilt_offset: Surface | None = None,
        floor: float = -np.inf,
        ceiling: float = np.inf,
    ) -> Self:
        """Divide what rises above a floor into watersheds, one for each summit.

        Args:
            surface: The surface; it ends at its border, also when it is periodic.
            tilt_offset: What a tilt adds to its heights, on the same cells; it need not be
                periodic.
            floor: Height below which samples are left out [mm]. Every peak above the floor keeps
                its 33 highest samples all the same, which give its caps their shape.
            ceiling: Height that no peak exceeds, for peaks higher by rounding [mm].
        """
        parts = [surface] if tilt_offset is None else [surface, tilt_offset]
        heights = np.sum([sampled(part) for part in parts], axis=0)
        side = np.array(surface.lengths) / heights.shape
        owner, peak = divided(heights)
        top = np.stack(np.unravel_index(peak, heights.shape), axis=1)
        summit = constrained_summits(surface, (top + 0.5) * side, tilt_offset)
        z = np.sum([part.height_at(*summit.T) for part in parts], axis=0)
        z = np.minimum(np.maximum(z, heights.flat[peak]), ceiling)
        # Several samples on one oblique ridge can be peaks where the interpolant has one only.
        name = coincident(surface, summit)
        order = np.lexsort((-z, name))
        best = order[np.searchsorted(name[order], np.arange(name.max() + 1))]
        owner, summit, z = name[owner], summit[best], z[best]
        owner = np.where(_needed(heights.ravel(), owner, z, floor), owner, -1)
        return cls._sorted(heights, owner, summit, z, side)

    @classmethod
    def _sorted(cls, heights: Array, owner: Indices, summit: Array, z: Array, side: Array) -> Self:
        saddles = saddles_between(heights, owner.reshape(heights.shape))
        sample = np.flatnonzero(owner >= 0)
        depth = np.maximum(z[owner[sample]] - heights.flat[sample], 0.0)
        order = np.lexsort((depth, owner[sample]))
        sample, depth, owner = sample[order], depth[order], owner[sample][order]
        place = (np.stack(np.unravel_index(sample, heights.shape), axis=1) + 0.5) * side
        along, across = (place - summit[owner]).T
        moments = np.stack([along**p * across**q for p, q in _POWERS])
        sums: Array = np.zeros((2, len(_POWERS), len(depth) + 1))
        np.cumsum(moments, axis=1, out=sums[0, :, 1:])
        np.cumsum(moments * depth, axis=1, out=sums[1, :, 1:])
        return cls(
            x=summit[:, 0],
            y=summit[:, 1],
            z=z,
            saddles=saddles,
            owner=owner,
            sample=sample,
            depth=depth,
            sums=sums,
            grid=(heights.shape[0], heights.shape[1]),
            cell=float(side.prod()),
        )

    def __len__(self) -> int:
        return len(self.z)

    def caps(self, height: Array) -> Array:
        """Return ∫ X^p Y^q dV of what lies within a height below each peak, shape (6, n).

        The powers are 1, X, Y, X², XY, Y² from the peak [mm³ … mm⁵]. Where a cap holds fewer
        than 32 samples its shape is that of the larger cap that holds so many, a paraboloid (cut
        by the border, if need be) that shrinks towards its peak.

        Args:
            height: Heights of the caps, shape (n,) [mm].
        """
        least = self.least_height
        taken = np.maximum(height, least)
        ends = np.searchsorted(self._key, np.arange(len(self)) + taken / self._deepest)
        ends = np.clip(ends, self._start[:-1], self._start[1:])
        sums, deep = self.sums[:, :, ends] - self.sums[:, :, self._start[:-1]]
        shrunk = np.divide(height, taken, out=np.zeros_like(height), where=taken > 0.0)
        return self.cell * (taken * sums - deep) * shrunk**_ORDER

    def above(self, height: Array) -> tuple[Indices, Indices, Array]:
        """Return the samples within a height below each peak.

        Args:
            height: Heights of the caps, shape (n,) [mm].

        Returns:
            Their watersheds, flat indices and heights above the base of the cap [mm].
        """
        over = height[self.owner] - self.depth
        taken = np.flatnonzero(over > 0.0)
        return self.owner[taken], self.sample[taken], over[taken]

    def regions(self, linked: NDArray[np.bool_]) -> Indices:
        """Return a number for each watershed, the same for those that saddles link, shape (n,).

        Args:
            linked: Which saddles link, shape (m,).
        """
        first, second, _ = self.saddles
        pairs = (np.ones(np.count_nonzero(linked)), (first[linked], second[linked]))
        graph = coo_array(pairs, shape=(len(self), len(self)))
        return connected_components(graph, directed=False)[1]

    def open_saddles(self, level: Array) -> NDArray[np.bool_]:
        """Return which saddles lie above the levels of both their watersheds, shape (m,).

        Args:
            level: Level of each watershed, shape (n,) [mm].
        """
        first, second, height = self.saddles
        return height > np.maximum(level[first], level[second])

    @cached_property
    def _start(self) -> Indices:
        return np.searchsorted(self.owner, np.arange(len(self) + 1))

    @cached_property
    def _deepest(self) -> float:
        return 2.0 * float(self.depth.max(initial=0.0)) or 1.0

    @cached_property
    def _key(self) -> Array:
        return self.owner + self.depth / self._deepest

    @cached_property
    def whole_caps(self) -> Array:
        """Heights of the caps of all samples of watersheds with at most 32, else 0, (n,) [mm].

        Where all samples of such a watershed are equally deep the height is twice their depth,
        for the cap to have a volume. It is 0 where they are as high as the peak.
        """
        start, end = self._start[:-1], self._start[1:]
        small = np.flatnonzero((end > start) & (end - start <= _FEW))
        highest, lowest = self.depth[start[small]], self.depth[end[small] - 1]
        heights: Array = np.zeros(len(self))
        heights[small] = np.where(lowest > highest, lowest, 2.0 * lowest)
        return heights

    @cached_property
    def least_height(self) -> Array:
        """Heights of the caps with 32 samples, 0 for smaller watersheds, shape (n,) [mm]."""
        last = self._start[:-1] + _FEW
        many = last < self._start[1:]
        least: Array = np.zeros(len(self))
        least[many] = self.depth[last[many]]
        return least


def needed_depth(surface: Surface, approach: float, most_whole: int = MOST_WHOLE) -> float:
    """Return how far below the reference height watersheds must reach for an approach [mm].

    Small surfaces need one depth, the infinite one. Those of a large one are found as deep as
    needed, to a power of two, so that load steps that follow each other need the same.

    Args:
        surface: The surface.
        approach: The approach [mm].
        most_whole: Cells of the largest small surface.
    """
    if surface.heights.size <= most_whole:
        return np.inf
    least = 1e-9 * min(surface.spacing)
    return float(np.exp2(np.ceil(np.log2(max(_MARGIN * approach, least)))))


def _needed(heights: Array, owner: Indices, z: Array, floor: float) -> NDArray[np.bool_]:
    """Mark the samples above a floor, and the highest 33 of every peak above it."""
    needed = heights > floor
    count = np.bincount(owner[needed], minlength=len(z))
    wanting = (z >= floor) & (count <= _FEW)
    rest = np.flatnonzero(wanting[owner] & ~needed)
    rest = rest[np.lexsort((-heights[rest], owner[rest]))]
    of = owner[rest]
    rank = np.arange(len(rest)) - np.searchsorted(of, of)
    needed[rest[rank + count[of] <= _FEW]] = True
    return needed
