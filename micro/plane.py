"""The rigid plane that presses on a rough surface: its approach and its tilt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Asperities, Partition, Surface
from geometry.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidPlane:
    """Approach δ(x, y) = δ + tx (x − xc) + ty (y − yc), counted from first touch when level.

    Args:
        approach: δ at the centre of the rectangle [mm].
        tilt: Slopes (tx, ty) [mm/mm].
        centre: Centre (xc, yc) of the rectangle [mm].

    Raises:
        InputError: When a number is not finite or the tilt is not a pair.
    """

    approach: float
    tilt: tuple[float, float]
    centre: tuple[float, float]

    def __post_init__(self) -> None:
        if not np.isfinite(self.approach):
            raise InputError("the approach must be finite", value=self.approach, allowed="mm")
        if np.shape(self.tilt) != (2,) or not np.all(np.isfinite(self.tilt)):
            raise InputError(
                "the tilt must be two finite slopes", value=self.tilt, allowed="(tx, ty) in mm/mm"
            )

    @classmethod
    def above(
        cls,
        rough: Asperities | Surface,
        approach: float,
        tilt: tuple[float, float] = (0.0, 0.0),
    ) -> RigidPlane:
        """Return the plane that turns about the centre of a surface's rectangle."""
        lx, ly = rough.lengths
        return cls(approach=float(approach), tilt=tilt, centre=(0.5 * lx, 0.5 * ly))

    def at(self, x: Array, y: Array) -> Array:
        """Return the approach at points [mm]."""
        (tx, ty), (xc, yc) = self.tilt, self.centre
        return self.approach + tx * (x - xc) + ty * (y - yc)

    def means(self, patches: Partition) -> Array:
        """Return the mean approach over every patch, shape (N,) [mm]."""
        return self.at(*patches.centres.T)

    def moment(self, x: Array, y: Array, force: Array) -> tuple[float, float]:
        """Return the first moments of forces at points about the centre [N mm]."""
        (xc, yc), force = self.centre, np.asarray(force)
        return float(np.sum(force * (x - xc))), float(np.sum(force * (y - yc)))

    def overlap(self, asperities: Asperities) -> Array:
        """Return how far undisplaced summits would penetrate, negative below the plane [mm]."""
        return self.at(asperities.x, asperities.y) - (asperities.highest - asperities.z)

    def required(self, asperities: Asperities) -> Array:
        """Return the displacements d_k = <δ(x_k) − (z_M − z_k)> of the summits [mm].

        Source:
            Waddad et al. 2016, eq. 6, doi 10.1016/j.triboint.2015.12.023.
        """
        return np.maximum(self.overlap(asperities), 0.0)
