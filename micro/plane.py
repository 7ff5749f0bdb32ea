"""The rigid plane that presses on a rough surface: approach, tilt and what the surface yields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Asperities, Partition, Surface
from geometry.errors import InputError

Array = NDArray[np.float64]
Field = Callable[[Array, Array], Array]
"""Smooth field on the surface: from abscissae and ordinates, which broadcast, to values."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidPlane:
    """Approach δ(x, y) = δ + tx (x − xc) + ty (y − yc) − D(x, y), from first touch when level.

    D is what the surface yields beyond the half-space, such as the rest of a finite block under
    the same load: to the contacts it is the same as a plane that has come less near.

    Args:
        approach: δ at the centre of the rectangle [mm].
        tilt: Slopes (tx, ty) [mm/mm].
        centre: Centre (xc, yc) of the rectangle [mm].
        sag: D, smooth over the distance between contacts [mm]; none when not given.

    Raises:
        InputError: When a number is not finite or the tilt is not a pair.
    """

    approach: float
    tilt: tuple[float, float]
    centre: tuple[float, float]
    sag: Field | None = None

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
        sag: Field | None = None,
    ) -> RigidPlane:
        """Return the plane that turns about the centre of a surface's rectangle."""
        lx, ly = rough.lengths
        return cls(approach=float(approach), tilt=tilt, centre=(0.5 * lx, 0.5 * ly), sag=sag)

    def at(self, x: Array, y: Array) -> Array:
        """Return the approach at points [mm]."""
        (tx, ty), (xc, yc) = self.tilt, self.centre
        level = self.approach + tx * (x - xc) + ty * (y - yc)
        return level if self.sag is None else level - self.sag(x, y)

    def means(self, patches: Partition) -> Array:
        """Return the mean approach over every patch, shape (N,) [mm].

        Exact but for the sag, which Gauss' rule integrates to degree 7.
        """
        if self.sag is None:
            return self.at(*patches.centres.T)
        centres, half = patches.centres[:, :, None, None], patches.half_sides[:, :, None, None]
        x = centres[:, 0] + half[:, 0] * _NODES[:, None]
        y = centres[:, 1] + half[:, 1] * _NODES
        values = self.at(*np.broadcast_arrays(x, y))
        return np.asarray(0.25 * np.einsum("nij,i,j->n", values, _WEIGHTS, _WEIGHTS))

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
