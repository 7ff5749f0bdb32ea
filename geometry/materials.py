"""Linear elastic materials, the contact modulus of two bodies, and equivalent stresses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from patchlaw.support import Array, Density, Limits, PositivePressure, check_fields

PoissonRatio = Annotated[float, Limits(gt=-1, lt=0.5)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Elastic constants of a linear, isotropic material.

    Args:
        young_modulus: Young's modulus E [MPa].
        poisson_ratio: Poisson's ratio ν.
        density: Mass per volume, which vibrations ask for [t/mm³].

    Raises:
        InputError: When a constant is outside its range.
    """

    young_modulus: PositivePressure
    poisson_ratio: PoissonRatio
    density: Density | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def surface_compliance(self) -> float:
        """(1 − ν²) / E, of the body's surface under pressure [1/MPa]."""
        return (1.0 - self.poisson_ratio**2) / self.young_modulus

    @property
    def contact_modulus(self) -> float:
        """E* against a rigid plane [MPa]; see `MaterialPair`."""
        return MaterialPair(first=self).contact_modulus

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + ν)) [MPa]."""
        return self.young_modulus / (2.0 * (1.0 + self.poisson_ratio))

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's constants (λ, μ) [MPa]."""
        e, nu = self.young_modulus, self.poisson_ratio
        return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), self.shear_modulus

    @property
    def confined_modulus(self) -> float:
        """E (1 − ν) / ((1 + ν)(1 − 2ν)) = λ + 2μ: stress over strain without side strain [MPa]."""
        first, shear = self.lame
        return first + 2.0 * shear


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialPair:
    """Materials of two bodies in contact.

    Args:
        first: Material of the rough body.
        second: Material of the other body; None when it is rigid.
    """

    first: Material
    second: Material | None = None

    @property
    def contact_modulus(self) -> float:
        """E* with 1/E* = (1 − ν1²)/E1 + (1 − ν2²)/E2 [MPa].

        Source:
            Johnson, Contact Mechanics (1985), eq. 3.36.
        """
        compliance = self.first.surface_compliance
        if self.second is not None:
            compliance += self.second.surface_compliance
        return 1.0 / compliance

    @property
    def tangential_poisson_ratio(self) -> float:
        """Poisson's ratio of one body whose tangential compliance is that of the pair.

        Against a rigid plane this body has the contact modulus E* of the pair, too. It is the mean
        of both ratios, weighted by the compliances 1/G.
        """
        bodies = [body for body in (self.first, self.second) if body is not None]
        weights = [1.0 / body.shear_modulus for body in bodies]
        return float(np.average([body.poisson_ratio for body in bodies], weights=weights))

    @property
    def stiffness_ratio(self) -> float:
        """Mindlin's ratio of the normal to the tangential stiffness of contacts of the pair."""
        return mindlin_ratio(self.tangential_poisson_ratio)

    @property
    def dundurs_beta(self) -> float:
        """Dundurs' β: pressures displace the two surfaces by different amounts along each other.

        It is 0 for like bodies and (1 − 2ν)/(2 (1 − ν)) against a rigid plane.

        Source:
            Johnson, Contact Mechanics (1985), eq. 5.3.
        """
        own, other = self.first, self.second
        along = (1.0 - 2.0 * own.poisson_ratio) / own.shear_modulus
        if other is not None:
            along -= (1.0 - 2.0 * other.poisson_ratio) / other.shear_modulus
        return 0.25 * along * self.contact_modulus


def mindlin_ratio(poisson_ratio: float) -> float:
    """Return (2 − ν)/(2 (1 − ν)), the ratio of normal to tangential stiffness of a contact.

    Args:
        poisson_ratio: ν, of two bodies that of `MaterialPair.tangential_poisson_ratio`.

    Source:
        Johnson, Contact Mechanics (1985), eq. 7.43.
    """
    return (2.0 - poisson_ratio) / (2.0 * (1.0 - poisson_ratio))


def von_mises(stress: Array) -> Array:
    """Return von Mises' equivalent of stresses, shape (..., 3, 3) [MPa]."""
    trace = np.trace(stress, axis1=-2, axis2=-1)
    deviator = stress - trace[..., None, None] * np.eye(3) / 3.0
    return np.sqrt(1.5 * np.square(deviator).sum(axis=(-2, -1)))
