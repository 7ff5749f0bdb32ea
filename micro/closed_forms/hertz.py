"""Hertz contact of one asperity with a rigid plane: force, area, pressure and displacement.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from micro.closed_forms.ellipse import ShapeFactors, shape_factors
from micro.closed_forms.hertz_field import elliptic_field

Array = NDArray[np.float64]


def checked_modulus(contact_modulus: float) -> None:
    """Refuse a contact modulus that is not positive and finite.

    Raises:
        InputError: When it is not.
    """
    if not (contact_modulus > 0.0 and np.isfinite(contact_modulus)):
        raise InputError(
            "the contact modulus must be positive",
            value=contact_modulus,
            allowed="finite E* > 0 MPa",
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class HertzContact:
    """Frictionless elliptic contacts of paraboloids, each alone on the half-space.

    The arrays broadcast against each other; every result has the broadcast shape.

    Args:
        contact_modulus: E* [MPa].
        radius_major: Larger principal radius R' of the summit [mm].
        radius_minor: Smaller principal radius R'' [mm].
        indentation: Approach w ≥ 0 of the summit's contact [mm].

    Raises:
        InputError: When the modulus or a radius is not positive, R' < R'', or w < 0.

    Source:
        Johnson, Contact Mechanics (1985), ch. 4; Waddad et al. 2016, eqs. 1–5 and 17,
        doi 10.1016/j.triboint.2015.12.023.
    """

    contact_modulus: float
    radius_major: ArrayLike
    radius_minor: ArrayLike
    indentation: ArrayLike

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)
        lowest = np.min(np.asarray(self.indentation, float), initial=0.0)
        if not lowest >= 0.0:  # also NaN
            raise InputError(
                "an indentation is negative or not a number", value=float(lowest), allowed="w ≥ 0"
            )
        _ = self.factors  # checks the radii

    @cached_property
    def factors(self) -> ShapeFactors:
        """Shape factors of the contact ellipses."""
        return shape_factors(self.radius_major, self.radius_minor)

    @cached_property
    def radius(self) -> Array:
        """Equivalent radius R = sqrt(R' R'') [mm]."""
        return np.sqrt(np.asarray(self.radius_major, float) * np.asarray(self.radius_minor, float))

    @property
    def semi_major(self) -> Array:
        """Major semi-axis a = (2 K F1/π) sqrt(R w) [mm]."""
        return self.factors.axis * np.sqrt(self.radius * self._depth)

    @property
    def semi_minor(self) -> Array:
        """Minor semi-axis b [mm]."""
        return self.semi_major * np.sqrt(self.factors.axis_ratio_squared)

    @property
    def force(self) -> Array:
        """Normal force P = 4/3 E* sqrt(R) F1 w^(3/2) [N]."""
        stiffness = 4.0 / 3.0 * self.contact_modulus * np.sqrt(self.radius) * self.factors.force
        return stiffness * self._depth**1.5

    @property
    def area(self) -> Array:
        """Contact area A = π R A1 w = π a b [mm²]."""
        return np.pi * self.radius * self.factors.area * self._depth

    @property
    def peak_pressure(self) -> Array:
        """Pressure at the centre, p0 = 3 P/(2 A) = E* w/(b K) [MPa], 0 without contact."""
        width = self.factors.axis * np.sqrt(self.factors.axis_ratio_squared) * self.factors.integral
        return self.contact_modulus * np.sqrt(self._depth / self.radius) / width

    @property
    def mean_pressure(self) -> Array:
        """Mean pressure over the contact, P/A = 2/3 p0 [MPa]."""
        return 2.0 / 3.0 * self.peak_pressure

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return p = p0 sqrt(1 − x²/a² − y²/b²) inside the ellipse and 0 outside [MPa].

        Args:
            x: Distance from the centre along the major axis [mm]; broadcasts.
            y: Distance along the minor axis [mm].

        Source:
            Waddad et al. 2016, eq. 4, doi 10.1016/j.triboint.2015.12.023.
        """
        major = np.where(self.semi_major > 0.0, self.semi_major, 1.0)
        minor = np.where(self.semi_minor > 0.0, self.semi_minor, 1.0)
        depth = 1.0 - np.square(x / major) - np.square(y / minor)
        return self.peak_pressure * np.sqrt(np.maximum(depth, 0.0))

    def displacement(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the normal displacement of the surface, inside and outside the ellipse [mm].

        Args:
            x: Distance from the centre along the major axis [mm]; broadcasts.
            y: Distance along the minor axis [mm].

        Source:
            Waddad et al. 2016, eq. 17, doi 10.1016/j.triboint.2015.12.023.
        """
        size = self.radius * self.factors.axis**2
        s = size * self._depth
        safe = np.where(s > 0.0, s, 1.0)
        beta = self.factors.axis_ratio_squared
        field, _ = elliptic_field(np.square(x), np.square(y), safe, beta)
        return np.where(s > 0.0, field / (size * self.factors.integral), 0.0)

    @property
    def _depth(self) -> Array:
        return np.asarray(self.indentation, float)
