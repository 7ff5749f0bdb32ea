"""Displacements of summits that a finite body adds to those of the half-space.

Contacts are small against the waves of the body's modes. So forces act and displacements are taken
at the centres of the contacts, and a contact's own force counts as well.

Theory: demos/theory.md, section 8, eq. 6.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from geometry import Partition
from geometry.legendre_modes import mode_values
from micro.compliance.body_modes import BodyModes

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyPoints:
    """Compliance of a body between n points of its contact face.

    Forces are given as P/(π E*) [mm²].

    Args:
        body: The compliance in modes.
        contact_modulus: E* [MPa].
        values: Modes at the points, shape (K², n).
    """

    body: BodyModes
    contact_modulus: float
    values: Array

    @classmethod
    def at(cls, body: BodyModes, x: Array, y: Array, contact_modulus: float) -> Self:
        """Evaluate the modes at points.

        Args:
            body: The compliance in modes.
            x: Abscissae, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
            contact_modulus: E* [MPa].
        """
        along_x, along_y = (
            mode_values(place, length, body.count)
            for place, length in zip((x, y), body.lengths, strict=True)
        )
        values = (along_x[:, None] * along_y).reshape(len(body.matrix), -1)
        return cls(body=body, contact_modulus=contact_modulus, values=values)

    def among(self, index: Indices) -> Self:
        """Return the compliance between some of the points."""
        return replace(self, values=self.values[:, index])

    def displacement(self, force: Array) -> Array:
        """Return the displacements of the points by forces on them, (n,) [mm].

        Args:
            force: P/(π E*), shape (n,) [mm²].
        """
        return np.asarray(self.values.T @ self._amplitudes(force))

    def by(self, loaded: BodyPoints) -> Array:
        """Return the displacements of the points by unit forces on m others, (n, m) [1/mm].

        Args:
            loaded: The points that the forces act on, on the same body.
        """
        return np.asarray(self.values.T @ (self._modulus * self.body.matrix @ loaded.values))

    def patch_means(self, patches: Partition, force: Array) -> Array:
        """Return the mean displacements of patches, shape (N,) [mm].

        Args:
            patches: N patches within the face.
            force: P/(π E*), shape (n,) [mm²].
        """
        cells = self.body.on(patches.borders_x, patches.borders_y)
        amplitudes = self._amplitudes(force).reshape(self.body.count, -1)
        return np.asarray((cells.means_x.T @ amplitudes @ cells.means_y).ravel())

    @property
    def _modulus(self) -> float:
        return float(np.pi * self.contact_modulus)

    def _amplitudes(self, force: Array) -> Array:
        return np.asarray(self._modulus * (self.body.matrix @ (self.values @ force)))
