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

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from patchlaw.support.errors import InputError

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


def gas_conductance(gap: ArrayLike, conductivity: float, temperature_jump: float = 0.0) -> float:
    """Return the conductance per area of the gas in gaps, the mean of k/(g + M) [W/m²/K].

    Heat passes straight through the gas. Where there is no gap, contacts conduct by themselves.
    Gaps close as the power 3/2 of the distance from a contact: without a temperature jump the
    integral has no bound there, and the sum over cells grows with their number.

    Args:
        gap: Gaps g of equal parts of the area, of any shape, 0 in contact [mm].
        conductivity: k of the gas [W/m/K].
        temperature_jump: Length M that the jumps of temperature at both faces add to the gap, a few
            mean free paths [mm].

    Source:
        Yovanovich 2005, doi 10.1109/TCAPT.2005.848483.
    """
    gap = np.asarray(gap, float)
    added = np.divide(1.0, gap + temperature_jump, out=np.zeros(gap.shape), where=gap > 0.0)
    return _MM_PER_M * conductivity * float(added.mean())


def radiation_conductance(temperature: float, emissivity: float) -> float:
    """Return the conductance per area of radiation across a gap, 4 ε σ T³ [W/m²/K].

    Args:
        temperature: Absolute temperature of both faces T [K].
        emissivity: Effective emissivity ε of both faces, 1/(1/ε₁ + 1/ε₂ − 1).
    """
    return 4.0 * emissivity * STEFAN_BOLTZMANN * temperature**3
