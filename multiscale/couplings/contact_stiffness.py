"""Stiffness of the contacts on rectangles of a rough surface, estimated and learnt from secants."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.partition import Partition
from micro import Response
from micro.influence import influence_matrix

Array = NDArray[np.float64]
Secant = tuple[Array, Array]
"""Change of the local approaches [mm] and the change of the forces with it [N], (M,) each."""

_LEAST_OWN = 1.05  # of a rectangle's mean compliance: its contacts are softer than all of it
_LEAST_WORK = 1e-2  # of that expected, which a secant must do to be heard


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

    def __init__(self, loads: Partition, contact_modulus: float) -> None:
        self._modulus = contact_modulus
        self._mutual = influence_matrix(loads) / (np.pi * contact_modulus * loads.areas)

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
    """Return the stiffness changed to meet the latest secant, and the earlier ones nearly.

    The forces derive from a convex energy: the stiffness stays symmetric and semi-definite.

    Args:
        stiffness: An estimate, shape (M, M) [N/mm].
        secants: Secants, the earliest first.

    Source:
        Nocedal & Wright 2006, doi 10.1007/978-0-387-40065-5, eq. 6.19 (BFGS).
    """
    result = stiffness.copy()
    for change, force in secants:
        expected = result @ change
        before, now = float(change @ expected), float(change @ force)
        if before <= 0.0 or now <= _LEAST_WORK * before:
            continue
        near = np.flatnonzero((force != 0.0) | (expected != 0.0))
        force, expected = force[near], expected[near]
        part = np.outer(force, force) / now - np.outer(expected, expected) / before
        result[np.ix_(near, near)] += part
    return result
