"""Results of the asperity models at one approach, asperity by asperity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from micro.closed_forms.hertz import HertzContact

Array = NDArray[np.float64]


class HertzCoefficients(NamedTuple):
    """Hertz's results of n asperities at an indentation of 1 mm; all are powers of it.

    Attributes:
        force: P ∝ t^(3/2) [N].
        area: π a b ∝ t [mm²].
        semi_axes: (a, b) ∝ t^(1/2), shape (n, 2) [mm].
        peak_pressure: p0 ∝ t^(1/2) [MPa].
    """

    force: Array
    area: Array
    semi_axes: Array
    peak_pressure: Array

    @classmethod
    def of(cls, contact: HertzContact) -> Self:
        """Evaluate contacts whose indentation is 1 mm."""
        axes = np.stack([contact.semi_major, contact.semi_minor], axis=-1)
        return cls(contact.force, contact.area, axes, contact.peak_pressure)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AsperityState:
    """Contact of all n asperities at one approach.

    Args:
        approach: Rigid approach δ at the centre [mm].
        required: Displacements d_k that the plane requires, shape (n,) [mm].
        displacement: Displacements w_k of the summits by all contacts, shape (n,) [mm].
        indentation: Part of w_k by the summit's own contact, shape (n,) [mm].
        semi_axes: Semi-axes (a, b) of the contacts, shape (n, 2) [mm].
        contact_area: Areas π a b, shape (n,) [mm²].
        force: Forces P_k, shape (n,) [N].
        peak_pressure: Pressures at the centres of the contacts, shape (n,) [MPa].
        overlapping_contacts: Number of ordered pairs (k, i) of summits below the plane in which
            contact i has come so close to summit k that `micro.pairs.interaction` limits its
            kernel.
        iterations: Linear systems solved; 0 for the models without interaction.
        residual: Largest complementarity error relative to the largest d_k.
    """

    approach: float
    required: Array
    displacement: Array
    indentation: Array
    semi_axes: Array
    contact_area: Array
    force: Array
    peak_pressure: Array
    overlapping_contacts: int
    iterations: int
    residual: float

    @property
    def in_contact(self) -> NDArray[np.bool_]:
        """Which asperities carry a force, shape (n,)."""
        return self.indentation > 0.0
