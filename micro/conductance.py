"""Thermal and electrical conductance of contacts, by Barber's analogy with their stiffness.

The temperature of a conducting half-space under the heat flow through its contacts obeys the same
potential problem as its displacement under an increment of load. Contacts between half-spaces of
the conductivities k₁ and k₂ therefore conduct

    G = 2 / (1/k₁ + 1/k₂) · (dF/dδ) / E*,

and per area h = 2 / (1/k₁ + 1/k₂) · (dp/dc) / E*. A body that conducts far better than the other
drops out of the sum. A circular spot of radius a on an isothermal plane, dF/dδ = 2 E* a, conducts
4 k a. The analogy is exact for spots on half-spaces, whatever their shape and mutual distance.

Source:
    Barber 2003, Proc. R. Soc. A 459, 53-66, doi 10.1098/rspa.2002.1038.

Theory: demos/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Number = TypeVar("Number", float, NDArray[np.float64])

STEFAN_BOLTZMANN = 5.670374419e-8
"""Constant of heat radiation [W/m²/K⁴]; CODATA 2018."""
_MM_PER_M = 1e3


def pair_conductivity(conductivities: Sequence[float]) -> float:
    """Return 1/(1/k₁ + 1/k₂), or k of the one body that resists.

    Args:
        conductivities: Of both bodies, or of the one on a body that conducts far better
            [W/m/K or S/m].

    Raises:
        InputError: When there are not one or two, or one is not positive.
    """
    values = [float(value) for value in conductivities]
    if len(values) not in (1, 2) or not all(np.isfinite(k) and k > 0.0 for k in values):
        raise InputError(
            "the conductivities of a contact do not fit",
            value=values,
            allowed="one or two, each > 0",
        )
    return 1.0 / sum(1.0 / k for k in values)


def total_conductance(stiffness: Number, contact_modulus: float, conductivity: float) -> Number:
    """Return the conductance of contacts [W/K or S].

    Args:
        stiffness: Interfacial stiffness dF/dδ on half-spaces [N/mm].
        contact_modulus: E* [MPa].
        conductivity: See `pair_conductivity` [W/m/K or S/m].
    """
    return 2.0 * conductivity / contact_modulus * stiffness / _MM_PER_M


def conductance_per_area(stiffness: Number, contact_modulus: float, conductivity: float) -> Number:
    """Return the conductance per area of an interface with a law [W/m²/K or S/m²].

    Args:
        stiffness: Stiffness dp/dc of the law [MPa/mm].
        contact_modulus: E* [MPa].
        conductivity: See `pair_conductivity` [W/m/K or S/m].
    """
    return 2.0 * conductivity / contact_modulus * stiffness * _MM_PER_M


def gap_conductance(
    separation: Number, conductivity: float = 0.0, temperature: float = 0.0, emissivity: float = 0.0
) -> Number:
    """Return the conductance per area of the gas in a gap, and of radiation across it [W/m²/K].

    The gas conducts as a layer as thick as the mean gap; a mean free path comparable to the gap,
    and contacts, are left out. Radiation is linearised at a temperature, ε 4 σ T³.

    Args:
        separation: Mean gap > 0 [mm].
        conductivity: Of the gas [W/m/K].
        temperature: Absolute temperature [K].
        emissivity: Effective emissivity ε of both faces, 1/(1/ε₁ + 1/ε₂ − 1).
    """
    return (
        _MM_PER_M * conductivity / separation + 4.0 * emissivity * STEFAN_BOLTZMANN * temperature**3
    )
