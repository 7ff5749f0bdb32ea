"""Displacements of summits by each other's contacts and by the body under all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from micro.pairs.body_points import BodyPoints
from micro.pairs.interaction import Interaction, Lift
from micro.pairs.multipoles import moments
from micro.pairs.split_interaction import FarField

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyInteraction:
    """The interaction of n asperities on a finite body, pair by pair.

    Args:
        interaction: The asperities.
        interacting: Whether contacts displace each other's summits through the half-space too.
        body: Compliance of the body between the summits.
    """

    interaction: Interaction
    interacting: bool
    body: BodyPoints

    def lift(self, indentation: Array) -> Lift:
        """Return the displacement of every summit but that by its own contact's half-space.

        Args:
            indentation: Own indentations t, shape (n,) [mm]; only positive ones act.
        """
        active, found = np.flatnonzero(indentation > 0.0), None
        if self.interacting:
            found = self.interaction.lift(indentation)
        t, own = indentation[active], self.interaction.subset(active)
        moment = moments(t, own.size, own.integral, 1)[0]
        between = self.body.by(self.body.among(active))
        displacement, slope = between @ moment, np.zeros_like(between)
        if found is not None:
            displacement, slope = displacement + found.displacement, found.slope
        return Lift(active, displacement, slope, between * (1.5 * moment / t))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyFarField:
    """A far field, and the body's.

    Args:
        far: The far field of the half-space; None adds nothing to the body's.
        body: Compliance of the body between the summits.
    """

    far: FarField | None
    body: BodyPoints

    @property
    def terms(self) -> int:
        """Number of moments of a contact."""
        return 1 if self.far is None else self.far.terms

    def displacement(self, moments: Array) -> Array:
        """Return the displacements by all moments (terms, n), shape (n,) [mm]."""
        found = self.body.displacement(moments[0])
        return found if self.far is None else found + self.far.displacement(moments)

    def leading(self, moment: Array) -> Array:
        """Return those by point forces P/(π E*) (n,) alone; may be less accurate."""
        found = self.body.displacement(moment)
        return found if self.far is None else found + self.far.leading(moment)
