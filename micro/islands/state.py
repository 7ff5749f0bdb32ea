"""Results of the model `islands` at one approach, island by island."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_AREA_FRACTION = 0.08
"""Contact area fraction up to which the model is within its stated error."""

GROWN_AREA_FRACTION = 0.04
LARGEST_SHARE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IslandState:
    """Contacts of m islands at one approach.

    Args:
        approach: Rigid approach δ at the centre [mm].
        x: Abscissae of the contacts, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
        indentation: Depths w of the islands below the plane, less what the others displace, (m,)
            [mm].
        semi_axes: Semi-axes (a, b) of the contacts, shape (m, 2) [mm].
        contact_area: Areas π a b, shape (m,) [mm²].
        force: Forces, shape (m,) [N].
        merged: Number of peaks that belong to an island with a higher peak.
        nominal_area: Area of the surface [mm²].
        iterations: Passes made.
        residual: Last change of a displacement relative to the greatest required one.
    """

    approach: float
    x: Array
    y: Array
    angle: Array
    indentation: Array
    semi_axes: Array
    contact_area: Array
    force: Array
    merged: int
    nominal_area: float
    iterations: int
    residual: float

    @property
    def warning(self) -> str:
        """Why the result lies outside the model's range of validity; empty within it.

        Outside means a contact area above 8 % of the nominal one, or above 4 % with more than
        half of it in one island: the regions then grow together across the surface, the force
        may be tens of per cent low and the area as much too large.
        """
        total = float(self.contact_area.sum())
        fraction = total / self.nominal_area
        share = float(self.contact_area.max(initial=0.0)) / (total or 1.0)
        grown = fraction > GROWN_AREA_FRACTION and share > LARGEST_SHARE
        if fraction <= LARGEST_AREA_FRACTION and not grown:
            return ""
        return (
            f"at an approach of {self.approach:.4g} mm the islands cover {fraction:.1%} of the"
            f" surface, the largest {share:.0%} of it: they grow together, and the model islands"
            f" stands for up to {LARGEST_AREA_FRACTION:.0%}"
            f" ({GROWN_AREA_FRACTION:.0%} when one holds more than half)"
        )
