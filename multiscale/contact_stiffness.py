"""Stiffness of the contacts on rectangles of a rough surface, estimated and learnt from secants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from micro import Response
from micro.influence import influence_matrix

Array = NDArray[np.float64]
Secant = tuple[Array, Array]
"""Change of the local approaches [mm] and the change of the forces with it [N], (M,) each."""

_LEAST_OWN = 1.05  # of a rectangle's mean compliance: its contacts are softer than all of it
_INDEPENDENT = 1e-3  # part of a secant that the later ones must leave over for it to be heard


class ContactStiffness:
    """Change of the forces on M rectangles with the rigid approach over each.

    Every contact is taken for circular: dP/dδ = 2 E* sqrt(A/π) whatever the shape of the punch.
    The rectangles act on each other through the half-space.

    Args:
        loads: The M rectangles.
        contact_modulus: E* [MPa].

    Source:
        Pharr, Oliver & Brotzen 1992, doi 10.1557/JMR.1992.0613, eq. 4.
    """

    def __init__(self, loads: PatchGrid, contact_modulus: float) -> None:
        self._modulus = contact_modulus
        self._mutual = influence_matrix(loads) / (np.pi * contact_modulus * loads.area)

    def estimate(self, response: Response) -> Array:
        """Return the stiffness from the contact areas alone, shape (M, M) [N/mm].

        Args:
            response: One row, summed over the rectangles.
        """
        area = response.patch_contact_area[0]
        touching = np.flatnonzero(area > 0.0)
        many = np.maximum(response.patch_contacts[0][touching], 1)
        own = 0.5 / self._modulus * np.sqrt(np.pi / (area[touching] * many))
        compliance = self._mutual[np.ix_(touching, touching)].copy()
        diagonal = np.diagonal(compliance)
        np.fill_diagonal(compliance, np.maximum(own, _LEAST_OWN * diagonal))
        stiffness = np.zeros_like(self._mutual)
        stiffness[np.ix_(touching, touching)] = np.linalg.inv(compliance)
        return stiffness


def corrected(stiffness: Array, secants: Sequence[Secant]) -> Array:
    """Return the stiffness changed least so that it meets the secants, the latest first.

    A secant that hardly differs from a combination of later ones is left out.

    Args:
        stiffness: An estimate, shape (M, M) [N/mm].
        secants: Secants, the earliest first.

    Source:
        Fang & Saad 2009, doi 10.1002/nla.617, section 2 (multisecant updates).
    """
    result = stiffness.copy()
    basis: list[Array] = []
    for change, force in reversed(secants):
        rest = change - sum((b * (b @ change) for b in basis), np.zeros_like(change))
        rest -= sum((b * (b @ rest) for b in basis), np.zeros_like(change))
        if np.linalg.norm(rest) <= _INDEPENDENT * np.linalg.norm(change):
            continue
        result += np.outer(force - result @ change, rest) / (rest @ change)
        basis.append(rest / np.linalg.norm(rest))
    return result
