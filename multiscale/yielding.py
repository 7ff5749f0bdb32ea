"""How a block yields to pressures on its patches: what the condensed Newton needs to know of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from multiscale.spread import ContactSpread, Shares

if TYPE_CHECKING:
    from multiscale.laws import LawPoint

Array = NDArray[np.float64]


class Yielding(Protocol):
    """Mean displacements of N patches under contacts whose laws are at a point."""

    @property
    def count(self) -> int:
        """Number of patches N."""

    def displacement(self, local: Array, point: LawPoint, /) -> Array:
        """Return the displacements that the contacts see, shape (N,) [mm].

        Args:
            local: Local approaches of the patches, shape (N,) [mm].
            point: Their laws there.
        """

    def slope(self, local: Array, point: LawPoint, /) -> Array:
        """Return the derivatives over the local approaches, shape (N, N)."""


class UniformLoads:
    """Pressures uniform on each patch: displacements are C p.

    Args:
        compliance: C, mean displacement of patch i by unit pressure on patch j, (N, N) [mm/MPa].
    """

    def __init__(self, compliance: Array) -> None:
        self._compliance = compliance
        self.count = len(compliance)

    def displacement(self, _local: Array, point: LawPoint) -> Array:
        """Return C p; see `Yielding.displacement`."""
        return np.asarray(self._compliance @ point.pressure)

    def slope(self, _local: Array, point: LawPoint) -> Array:
        """Return C dp/ds; see `Yielding.slope`."""
        return np.asarray(self._compliance * point.dpressure)


class SpreadLoads:
    """The half-space under mean pressures, as the laws know it, and the rest where contacts are.

    The block yields by D more than the half-space. Its loads are the patches' forces, shared among
    small rectangles as the contacts share them; what a patch sees of it is the mean over its
    rectangles, weighted with their shares in the patch's stiffness: to first order that is the
    change of its force. Both follow the local approach. With D averaged over whole patches
    instead, a cube's force is up to 10 % off for one patch and 4 % for 4 × 4 (Set 1).

    Args:
        half_space: Λ / (π E*), shape (N, N) [mm/MPa].
        correction: D, mean displacement of rectangle m by unit force on n, shape (M, M) [mm/N].
        spread: Shares of the M rectangles.
    """

    def __init__(self, half_space: Array, correction: Array, spread: ContactSpread) -> None:
        self._half_space, self._correction, self._spread = half_space, correction, spread
        self._area = spread.patches.area
        self._at: tuple[Any, Any, Any, Any] = (None, None, None, None)
        patches = np.arange(len(half_space))
        self._belongs = np.equal.outer(spread.owner, patches).astype(float)
        # the columns of one patch side by side: their sums are the bulk of a Newton step
        self._order = np.argsort(spread.owner, kind="stable")
        self._by_owner = np.ascontiguousarray(correction[:, self._order])
        self._starts = np.searchsorted(spread.owner[self._order], patches)
        self.count = len(half_space)

    def displacement(self, local: Array, point: LawPoint) -> Array:
        """Return Λ p / (π E*) + weighted D; see `Yielding.displacement`."""
        shares, below = self._under(local, point)
        return self._half_space @ point.pressure + self._by_patch(shares.stiffness * below)

    def slope(self, local: Array, point: LawPoint) -> Array:
        """Return the derivative; see `Yielding.slope`."""
        (shares, sunk), owner = self._under(local, point), self._spread.owner
        rise = shares.dforce * point.pressure[owner] + shares.force * point.dpressure[owner]
        columns = self._by_owner * (self._area * rise[self._order])
        below = np.add.reduceat(columns, self._starts, axis=1)
        matrix = self._half_space * point.dpressure
        matrix += self._belongs.T @ (shares.stiffness[:, None] * below)
        own = self._by_patch(shares.dstiffness * sunk)
        matrix[np.diag_indices_from(matrix)] += own
        return matrix

    def _under(self, local: Array, point: LawPoint) -> tuple[Shares, Array]:
        """Return the shares, and what the rectangles sink by D, shape (M,) [mm].

        Newton's method asks for the slope where it has asked for the displacement.
        """
        if local is not self._at[0] or point is not self._at[1]:
            shares = self._spread.shares(local)
            forces = self._area * shares.force * point.pressure[self._spread.owner]
            self._at = (local, point, shares, np.asarray(self._correction @ forces))
        return self._at[2:]

    def _by_patch(self, values: Array) -> Array:
        return np.asarray(values @ self._belongs)
