"""How a block yields to pressures on its patches: what the condensed Newton needs to know of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from multiscale.law_tables.spread import ContactSpread

if TYPE_CHECKING:
    from multiscale.laws import LawPoint

Array = NDArray[np.float64]
Patches = NDArray[np.intp]


class Yielding(Protocol):
    """Mean displacements of N patches under contacts whose laws are at a point."""

    @property
    def count(self) -> int:
        """Number of patches N."""

    @property
    def own(self) -> Array:
        """What a patch moves by unit pressure on it, roughly, shape (N,) [mm/MPa]."""

    def displacement(self, local: Array, point: LawPoint, /) -> Array:
        """Return the displacements that the contacts see, shape (N,) [mm].

        Args:
            local: Local approaches of the patches, shape (N,) [mm].
            point: Their laws there.
        """

    def slope(self, local: Array, point: LawPoint, of: Patches, /) -> Array:
        """Return the derivatives over the local approaches of some patches, shape (N, L).

        Args:
            local: Local approaches of the patches, shape (N,) [mm].
            point: Their laws there.
            of: The patches, ascending, shape (L,).
        """


class UniformLoads:
    """Pressures uniform on each patch: displacements are C p.

    Args:
        compliance: C, mean displacement of patch i by unit pressure on patch j, (N, N) [mm/MPa].
    """

    def __init__(self, compliance: Array) -> None:
        self._compliance = compliance
        self.count, self.own = len(compliance), np.diagonal(compliance)

    def displacement(self, _local: Array, point: LawPoint) -> Array:
        """Return C p; see `Yielding.displacement`."""
        return np.asarray(self._compliance @ point.pressure)

    def slope(self, _local: Array, point: LawPoint, of: Patches) -> Array:
        """Return C dp/ds; see `Yielding.slope`."""
        return np.asarray(self._compliance[:, of] * point.dpressure[of])


class SpreadLoads:
    """The half-space under mean pressures, as the laws know it, and the rest where contacts are.

    The block yields by D more than the half-space. Its loads are the patches' forces, shared among
    small rectangles as the contacts share them; a patch sees the mean over its rectangles. With
    loads uniform on whole patches instead, a cube's force is up to 10 % off (Set 1).

    Args:
        half_space: Λ / (π E*), shape (N, N) [mm/MPa].
        spread: Shares of the rectangles, and D.
    """

    def __init__(self, half_space: Array, spread: ContactSpread) -> None:
        self._half_space, self._spread = half_space, spread
        self._area, self.count = spread.patches.area, len(half_space)
        self.own = np.diagonal(half_space)
        patches, owner = np.arange(self.count), spread.owner
        means = np.equal.outer(patches, owner) * spread.loads.areas / self._area
        # columns of one patch side by side: their sums are the bulk of a Newton step
        self._order = np.argsort(owner, kind="stable")
        self._starts = np.searchsorted(owner[self._order], patches)
        self._means = np.ascontiguousarray((means @ spread.correction)[:, self._order])

    def displacement(self, local: Array, point: LawPoint) -> Array:
        """Return Λ p / (π E*) + mean of D; see `Yielding.displacement`."""
        shares, _ = self._spread.shares(local)
        forces = self._area * shares * point.pressure[self._spread.owner]
        return self._half_space @ point.pressure + self._means @ forces[self._order]

    def slope(self, local: Array, point: LawPoint, of: Patches) -> Array:
        """Return the derivative; see `Yielding.slope`."""
        (shares, change), owner = self._spread.shares(local), self._spread.owner
        rise = self._area * (change * point.pressure[owner] + shares * point.dpressure[owner])
        parts, starts = self._parts_of(of)
        columns = self._means[:, parts] * rise[self._order[parts]]
        columns = np.add.reduceat(columns, starts, axis=1) if len(of) else columns
        return np.asarray(self._half_space[:, of] * point.dpressure[of] + columns)

    def _parts_of(self, patches: Patches) -> tuple[Patches, Patches]:
        """Return the rectangles of some patches among all in order, and where each patch begins."""
        counts = np.diff(self._starts, append=len(self._order))
        wanted = np.isin(np.arange(self.count), patches)
        starts = np.cumsum(counts[wanted]) - counts[wanted]
        return np.flatnonzero(np.repeat(wanted, counts)), starts
