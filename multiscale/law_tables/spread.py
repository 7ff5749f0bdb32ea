"""Where within the patches the contacts are, and what the block yields to them there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.partition import Partition
from geometry.patches import PatchGrid
from micro import Field

Array = NDArray[np.float64]


class Sinking(Protocol):
    """What the block sinks more than a half-space, for forces on small rectangles."""

    @property
    def loads(self) -> Partition:
        """The M rectangles."""

    def sag(self, forces: Array, /) -> Field:
        """Return the field of what it sinks by forces on the rectangles, shape (M,) [N]."""

    def patch_compliance(self, patches: Partition, /) -> Array:
        """Return its mean over patch i by unit pressure on patch j, shape (N, N) [mm/MPa]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactSpread:
    """Forces of the contacts on rectangles that divide the patches, along the local approach.

    A block yields to contacts where they are. A patch alone knows its mean pressure; the shares
    tell how it is spread.

    Args:
        patches: The N patches.
        loads: M rectangles that divide them.
        approach: Local approaches of every patch at K rows, never falling, shape (K, N) [mm].
        forces: Forces on the rectangles, shape (K, M) [N].
        correction: Mean of what the block sinks more than a half-space at rectangle m by unit
            force on rectangle n, shape (M, M) [mm/N].

    Raises:
        InputError: When the rectangles do not divide the patches or the shapes do not fit.
    """

    patches: PatchGrid
    loads: Partition
    approach: Array
    forces: Array
    correction: Array

    def __post_init__(self) -> None:
        if not divides(self.loads, self.patches):
            raise InputError(
                "the rectangles of the loads must divide the patches",
                value=self.loads.shape,
                allowed="grid lines on all borders of the patches",
            )
        rows, count, parts = len(self.approach), self.patches.count, self.loads.count
        shapes = self.approach.shape, self.forces.shape, self.correction.shape
        expected = (rows, count), (rows, parts), (parts, parts)
        if shapes != expected or not rows:
            raise InputError("the rows of a spread do not fit", value=shapes, allowed=str(expected))

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """Flat index of the patch that holds each rectangle, shape (M,)."""
        return self.patches.index_of(*self.loads.centres.T)

    def shares(self, local: Array) -> tuple[Array, Array]:
        """Return the shares of rectangles in their patch's force, and the derivatives.

        Forces are interpolated linearly between rows. Before its first row under load a patch has
        that row's shares, beyond the last row the last one's, and those of its area without any.

        Args:
            local: Local approaches of the patches, shape (N,) [mm].

        Returns:
            Shares, shape (M,), and derivatives over the local approach, shape (M,) [1/mm].
        """
        column, last = np.arange(self.patches.count), len(self.approach) - 1
        low = (local >= self.approach).sum(axis=0) - 1
        low = np.clip(low, self._first, np.maximum(last - 1, self._first))
        high = np.minimum(low + 1, last)
        start, end = self.approach[low, column], self.approach[high, column]
        width = np.where(end > start, end - start, 1.0)
        along = (local - start) / width
        rate = np.where((along >= 0.0) & (along <= 1.0) & (end > start), 1.0 / width, 0.0)
        rectangle = np.arange(self.loads.count)
        before, after = (self.forces[row[self.owner], rectangle] for row in (low, high))
        force = before + np.clip(along, 0.0, 1.0)[self.owner] * (after - before)
        slope = rate[self.owner] * (after - before)
        total, rise = (
            np.bincount(self.owner, values, minlength=len(column))[self.owner]
            for values in (force, slope)
        )
        none = total <= 0.0
        total = np.where(none, 1.0, total)
        share = np.where(none, self.loads.areas / self.patches.area, force / total)
        return share, np.where(none, 0.0, (slope - share * rise) / total)

    @cached_property
    def _first(self) -> NDArray[np.intp]:
        """First row under load of every patch, or the last, shape (N,)."""
        by_patch = np.zeros((self.patches.count, len(self.forces)))
        np.add.at(by_patch, self.owner, self.forces.T)
        loaded = by_patch > 0.0
        return np.where(loaded.any(axis=1), loaded.argmax(axis=1), len(self.approach) - 1)


def divides(loads: Partition, patches: PatchGrid) -> bool:
    """Tell whether rectangles divide patches: have grid lines on all of their borders.

    Args:
        loads: The rectangles.
        patches: The patches.
    """
    slack = 1e-9 * max(patches.lengths)
    for axis in ("borders_x", "borders_y"):
        borders, lines = getattr(patches, axis), getattr(loads, axis)
        away = np.abs(np.subtract.outer(borders, lines)).min(axis=1) > slack
        if away.any() or abs(lines[0] - borders[0]) + abs(lines[-1] - borders[-1]) > slack:
            return False
    return True
