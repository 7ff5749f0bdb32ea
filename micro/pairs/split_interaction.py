"""Interaction of many asperities: exact fields of close pairs, multipoles of the others.

`micro.pairs.interaction` evaluates Hertz's field for every pair at every step. Here only pairs
within a few semi-axes of a contact are; the others see moments of force that act through matrices
of the places alone (`micro.pairs.far_pairs`), or through a grid (`micro.pairs.far_mesh`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from micro.pairs.close_pairs import ClosePairs
from micro.pairs.interaction import MERGING_SLOPE, Interaction
from micro.pairs.multipoles import moments

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class FarField(Protocol):
    """Displacements of n summits by moments of the n contacts, close pairs left out."""

    @property
    def terms(self) -> int:
        """Moments of a contact that count."""

    def displacement(self, moments: Array) -> Array:
        """Return the displacements by all moments (terms, n), shape (n,) [mm]."""

    def leading(self, moment: Array) -> Array:
        """Return those by point forces P/(π E*) (n,) alone; may be less accurate."""


class SplitLift(NamedTuple):
    """Displacement of n summits by the contacts of the others.

    Attributes:
        active: Indices of the asperities with positive indentation.
        displacement: Displacement of every summit by the others, shape (n,) [mm].
        close: The close pairs.
        slope: dU_ki/dt_i of the close pairs.
        rate: Derivative of P/(π E*) with respect to the indentation, shape (n,) [mm].
        far: The far field.
    """

    active: Indices
    displacement: Array
    close: ClosePairs
    slope: Array
    rate: Array
    far: FarField

    @property
    def overlapping_contacts(self) -> int:
        """Number of ordered pairs (k, i) whose slope has reached c*."""
        return int(np.count_nonzero(self.slope >= MERGING_SLOPE * (1.0 - 1e-12)))

    def product(self, change: Array) -> Array:
        """Return the change of the displacements by one of the indentations, nearly [mm].

        Distant contacts act as point forces here.

        Args:
            change: Change of the indentations, shape (n,) [mm].
        """
        near = self.slope * change[self.close.column]
        return np.bincount(self.close.row, near, minlength=len(change)) + self.far.leading(
            self.rate * change
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplitInteraction:
    """The interaction of n asperities in two parts.

    Args:
        interaction: The asperities.
        close: Pairs that need the exact field at any indentation to come.
        far: All other pairs.
    """

    interaction: Interaction
    close: ClosePairs
    far: FarField

    def lift(self, indentation: Array) -> SplitLift:
        """Return the displacement of every summit by the other contacts.

        Args:
            indentation: Own indentations t, shape (n,) [mm]; only positive ones act.
        """
        t, all_of = np.maximum(indentation, 0.0), self.interaction
        near, slope = self.close.lift(t)
        moment = moments(t, all_of.size, all_of.integral, self.far.terms)
        rate = np.divide(1.5 * moment[0], t, out=np.zeros_like(t), where=t > 0.0)
        return SplitLift(
            active=np.flatnonzero(t > 0.0),
            displacement=near + self.far.displacement(moment),
            close=self.close,
            slope=slope,
            rate=rate,
            far=self.far,
        )
