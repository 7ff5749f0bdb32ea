"""Linear elastic materials, the contact modulus of two bodies, and equivalent stresses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from support.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Linear, isotropic, elastic material.

    Args:
        young_modulus: Young's modulus E [MPa], positive and finite.
        poisson_ratio: Poisson's ratio ν, −1 < ν < 0.5.

    Raises:
        InputError: When a constant is outside its range.
    """

    young_modulus: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.young_modulus) and self.young_modulus > 0.0):
            raise InputError(
                "Young's modulus must be positive", value=self.young_modulus, allowed="E > 0 MPa"
            )
        if not -1.0 < self.poisson_ratio < 0.5:
            raise InputError(
                "Poisson's ratio is impossible", value=self.poisson_ratio, allowed="-1 < ν < 0.5"
            )

    @property
    def surface_compliance(self) -> float:
        """(1 − ν²) / E, by which the body's surface gives way under pressure [1/MPa]."""
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


def von_mises(stress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return von Mises' equivalent of stresses, shape (..., 3, 3) [MPa]."""
    trace = np.trace(stress, axis1=-2, axis2=-1)
    deviator = stress - trace[..., None, None] * np.eye(3) / 3.0
    return np.sqrt(1.5 * np.square(deviator).sum(axis=(-2, -1)))
