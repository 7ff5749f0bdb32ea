"""What rises above a level: volume and moments of every catchment, regions that hang together.

The samples of each catchment are sorted by depth below its peak and their moments are summed up
in that order, so that the sums above any level, another one for every catchment, take no more work
than there are peaks.
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
from micro.islands.watersheds import Passes, passes_between, sampled, watersheds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FEW = 32
_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
_ORDER = np.array([2.0, 2.5, 2.5, 3.0, 3.0, 3.0])[:, None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief:
    """The catchments of n peaks.

    Args:
        x: Abscissae of the peaks, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        z: Heights, shape (n,) [mm].
        passes: Highest passes between touching catchments.
        owner: Peak of every sample, by catchment and there by depth, shape (s,).
        sample: Flat indices of the samples, shape (s,).
        depth: Depths of the samples below their peak, shape (s,) [mm].
        moments: X^p Y^q of the samples from their peak for the six powers up to 2, (6, s).
        grid: Numbers of samples over the surface.
        cell: Area of a sample [mm²].
    """

    x: Array
    y: Array
    z: Array
    passes: Passes
    owner: Indices
    sample: Indices
    depth: Array
    moments: Array
    grid: tuple[int, int]
    cell: float

    @classmethod
    def of(
        cls,
        surface: Surface,
        *,
        lean: Surface | None = None,
        floor: float = -np.inf,
        ceiling: float = np.inf,
    ) -> Self:
        """Divide what rises above a floor into catchments, one for each summit.

        Args:
            surface: The surface; it ends at its border, also when it is periodic.
            lean: What adds to its heights, on the same cells; it need not be periodic.
            floor: Height below which no more is kept than the 33 highest samples of every peak
                that reaches it, which give its caps their shape [mm].
            ceiling: Height that no peak exceeds, for peaks higher by rounding [mm].
        """
        parts = [surface] if lean is None else [surface, lean]
        heights = np.sum([sampled(part) for part in parts], axis=0)
        side = np.array(surface.lengths) / heights.shape
        owner, peak = watersheds(heights)
        top = np.stack(np.unravel_index(peak, heights.shape), axis=1)
        summit = constrained_summits(surface, (top + 0.5) * side, lean)
        z = np.sum([part.height_at(*summit.T) for part in parts], axis=0)
        z = np.minimum(np.maximum(z, heights.flat[peak]), ceiling)
        # samples on one oblique ridge are peaks of their own, but not of the interpolant
        name = coincident(surface, summit)
        order = np.lexsort((-z, name))
        best = order[np.searchsorted(name[order], np.arange(name.max() + 1))]
        owner, summit, z = name[owner], summit[best], z[best]
        owner = np.where(_needed(heights.ravel(), owner, z, floor), owner, -1)
        return cls._sorted(heights, owner, summit, z, side)

    @classmethod
    def _sorted(cls, heights: Array, owner: Indices, summit: Array, z: Array, side: Array) -> Self:
        passes = passes_between(heights, owner.reshape(heights.shape))
        sample = np.flatnonzero(owner >= 0)
        depth = np.maximum(z[owner[sample]] - heights.flat[sample], 0.0)
        order = np.lexsort((depth, owner[sample]))
        sample, depth, owner = sample[order], depth[order], owner[sample][order]
        place = (np.stack(np.unravel_index(sample, heights.shape), axis=1) + 0.5) * side
        along, across = (place - summit[owner]).T
        return cls(
            x=summit[:, 0],
            y=summit[:, 1],
            z=z,
            passes=passes,
            owner=owner,
            sample=sample,
            depth=depth,
            moments=np.stack([along**p * across**q for p, q in _POWERS]),
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
        least = self._least_height
        taken = np.maximum(height, least)
        ends = np.searchsorted(self._key, np.arange(len(self)) + taken / self._deepest)
        ends = np.clip(ends, self._start[:-1], self._start[1:])
        sums, deep = (table[:, ends] - table[:, self._start[:-1]] for table in self._cumulated)
        shrunk = np.divide(height, taken, out=np.zeros_like(height), where=taken > 0.0)
        return self.cell * (taken * sums - deep) * shrunk**_ORDER

    def above(self, height: Array) -> tuple[Indices, Indices, Array]:
        """Return the samples within a height below each peak.

        Args:
            height: Heights of the caps, shape (n,) [mm].

        Returns:
            Their catchments, flat indices and heights above the base of the cap [mm].
        """
        over = height[self.owner] - self.depth
        taken = np.flatnonzero(over > 0.0)
        return self.owner[taken], self.sample[taken], over[taken]

    def regions(self, linked: NDArray[np.bool_]) -> Indices:
        """Return a number for each catchment, the same for those that passes link, shape (n,).

        Args:
            linked: Which passes link, shape (m,).
        """
        first, second, _ = self.passes
        pairs = (np.ones(np.count_nonzero(linked)), (first[linked], second[linked]))
        graph = coo_array(pairs, shape=(len(self), len(self)))
        return connected_components(graph, directed=False)[1]

    def open_passes(self, level: Array) -> NDArray[np.bool_]:
        """Return which passes lie above the levels of both their catchments, shape (m,).

        Args:
            level: Level of each catchment, shape (n,) [mm].
        """
        first, second, height = self.passes
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
    def small(self) -> NDArray[np.bool_]:
        """Which catchments have no more than 32 samples, shape (n,)."""
        return np.diff(self._start) <= _FEW

    @cached_property
    def shaped(self) -> Array:
        """Heights of the caps with 32 samples, or all of a smaller catchment, shape (n,) [mm].

        Twice as high where all samples are as deep, for such a cap to have a volume; 0 where they
        are as high as the peak, or below the floor.
        """
        depth, start = np.append(self.depth, 0.0), self._start[:-1]
        last = np.minimum(start + _FEW, self._start[1:] - 1)
        some = last >= start
        first, last = (np.where(some, index, -1) for index in (start, last))
        return np.where(depth[last] > depth[first], 1.0, 2.0) * depth[last]

    @cached_property
    def _least_height(self) -> Array:
        """Height of the cap with 32 samples, 0 where there are not so many."""
        last = self._start[:-1] + _FEW
        many = last < self._start[1:]
        least: Array = np.zeros(len(self))
        least[many] = self.depth[last[many]]
        return least

    @cached_property
    def _cumulated(self) -> tuple[Array, Array]:
        nothing = np.zeros((len(_POWERS), 1))
        moments, deep = (
            np.concatenate([nothing, np.cumsum(part, axis=1)], axis=1)
            for part in (self.moments, self.moments * self.depth)
        )
        return moments, deep


def _needed(heights: Array, owner: Indices, z: Array, floor: float) -> NDArray[np.bool_]:
    """Mark the samples above a floor and the highest ones of each peak that reaches it."""
    kept = heights > floor
    count = np.bincount(owner[kept], minlength=len(z))
    wanting = (z >= floor) & (count <= _FEW)
    rest = np.flatnonzero(wanting[owner] & ~kept)
    rest = rest[np.lexsort((-heights[rest], owner[rest]))]
    of = owner[rest]
    rank = np.arange(len(rest)) - np.searchsorted(of, of)
    kept[rest[rank + count[of] <= _FEW]] = True
    return kept
