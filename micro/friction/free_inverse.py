"""Approximate inverse of the compliance of tractions that are partly free, a preconditioner.

Cells that stick bear any traction, cells that slip one across their slip alone, on a spring of the
compliance D = |s|/g in series with the half-space (`micro.friction.stick_slip`). Their common
inverse is the least energy

    ½ U·C⁻¹ U + ½ Σ (r − U)²/D

of all displacements U of the whole surface that are r on cells that stick; on cells that slip only
the part across the slip counts. Any U that depends linearly on r makes an approximate inverse that
is symmetric and positive. Here it is the extension of `micro.boundary_elements.extension`, in which
a cell that slips knows the share c/(c + D) of its displacement across, c being the compliance of a
cell, and nothing of that along the slip.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

import numpy as np

from micro.boundary_elements.extension import Extension
from micro.boundary_elements.half_space_grid import Cells
from micro.friction.tangential_grid import BodyGrid, TangentialGrid
from support.arrays import Array


def across(normal: Array, vectors: Array) -> Array:
    """Return the part of vectors across some directions, shape (2, n).

    Args:
        normal: Unit vectors of these directions, or zeros, shape (2, n).
        vectors: Shape (2, n).
    """
    return np.asarray(vectors - normal * (normal * vectors).sum(axis=0))


class FreeInverse:
    """Approximate inverse of the compliance of free tractions; a `ContactInverse`.

    Args:
        grid: Tangential compliance.
        cells: The n cells.
        normal: Directions in which tractions stay as they are, unit vectors of the cells that slip
            and zeros of those that stick, shape (2, n).
        stiffness: Compliance D that slip adds across these directions, shape (n,) [mm].
    """

    accurate = True

    def __init__(
        self, grid: TangentialGrid | BodyGrid, cells: Cells, normal: Array, stiffness: Array
    ) -> None:
        self._normal, self._inverse = normal, grid.inverse
        slips, own = normal.any(axis=0), grid.self_compliance
        self._known = np.where(slips, own / (own + stiffness), 1.0)
        self._spring = np.where(slips, 1.0 / (own + stiffness), 0.0)
        period = grid.inverse.grid
        self._extensions = [
            Extension(cells, period, self._known * (1.0 - along**2)) for along in normal
        ]
        self._place = self._extensions[0].place

    def __call__(self, displacement: Array) -> Array:
        """Return roughly the free change that displaces the cells, both flat."""
        scale = float(np.abs(displacement).max(initial=0.0)) or 1.0  # single precision: 1e-38
        wanted = across(self._normal, displacement.reshape(2, -1) / scale)
        fields, known = self._inverse.fields(), self._known * wanted
        for extension, values, field in zip(self._extensions, known, fields, strict=True):
            extension.interpolated(values, field)
        between = across(self._normal, self._of_cells(fields))
        for field, change in zip(fields, known - self._known * between, strict=True):
            field[self._place] += change
        by_springs = self._spring * (wanted - between)
        self._inverse(fields)
        return scale * across(self._normal, self._gathered(fields, by_springs)).ravel()

    def _gathered(self, fields: Array, by_springs: Array) -> Array:
        """Return the tractions of the cells by those of all cells and of the springs, (2, n)."""
        own = self._of_cells(fields) - by_springs
        known = self._known * across(self._normal, own)
        for field, values in zip(fields, own - known, strict=True):
            field[self._place] = values
        for extension, field, part in zip(self._extensions, fields, known, strict=True):
            part += extension.collected(field) * self._known
        return known + by_springs

    def _of_cells(self, fields: Array) -> Array:
        """Return the values of two fields on the cells, shape (2, n)."""
        return np.stack([field[self._place] for field in fields]).astype(float)
