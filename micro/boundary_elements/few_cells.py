"""The compliance of few cells of a surface as one matrix, finite slopes included.

Finite slopes are a matrix of their own up to what they have not been worked out for, and to the
share of their second order (`micro.boundary_elements.remembered_slopes`). A contact of these cells
is then a linear complementarity problem of a small matrix, which is corrected a few times.

Theory: docs/theory.md, section 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from micro.boundary_elements.compliance_matrix import ComplianceMatrix
from micro.boundary_elements.remembered_slopes import RememberedSlopes
from support.arrays import Array, Indices

_REST_OF_RATE = 2e-4
"""Rest of the derivative of the pressures by the approach. Its square, times the few per cent that
finite slopes add, is what the derivative of the force errs by."""


@dataclass(frozen=True, eq=False)
class FewCells:
    """Few cells that are loaded mostly; pressures on them have the shape (n,), and are over E*.

    Args:
        cells: Their flat indices, shape (n,).
        elastic: Their compliance without finite slopes.
        slopes: What finite slopes add, of each body.
        modulus: Contact modulus E* [MPa].
        rest: Rest of the pressures, over them, that finite slopes leave out in part. Forces of 10
            surfaces of the paper's recipe changed by 5e-10 with 1e-7, and largest pressures by
            8e-10; by 8e-10 and 2e-9 with 1e-6, with an eighth fewer evaluations.
    """

    cells: Indices
    elastic: ComplianceMatrix
    slopes: Sequence[RememberedSlopes]
    modulus: float
    rest: float

    def hold(self, pressure: Array) -> bool:
        """Return whether of all cells, shape (nx, ny), no others are loaded."""
        loaded = np.count_nonzero(pressure)
        return np.count_nonzero(pressure.ravel()[self.cells]) == loaded

    def learn(self, pressure: Array) -> None:
        """Work out what finite slopes add by pressures, where that is not known."""
        for each in self.slopes:
            each.learn(pressure * self.modulus, self.rest)

    @property
    def learnt(self) -> list[list[Array]]:
        """The pressures that the slopes of each body were worked out for, in order, (n,)."""
        return [list(each.learnt) for each in self.slopes]

    def relearn(self, learnt: list[list[Array]]) -> None:
        """Work out what finite slopes add by other pressures, see `learnt`, and forget the rest."""
        for each, pressures in zip(self.slopes, learnt, strict=True):
            each.relearn(pressures)

    def compliance(self, pressure: Array) -> ComplianceMatrix:
        """Return the compliance of the cells, finite slopes as under given pressures."""
        if not self.slopes:
            return self.elastic
        loaded = pressure * self.modulus
        columns = zip(*(each.columns(loaded) for each in self.slopes), strict=True)
        displacements, directions = (np.concatenate(each, axis=1) for each in columns)
        return self.elastic.with_added(self.modulus * displacements, directions)

    def slope_displacement(self, pressure: Array) -> Array | None:
        """Return what finite slopes add to the displacements of all cells, if any, (nx, ny)."""
        if not self.slopes:
            return None
        return np.sum([each.displacement(pressure * self.modulus) for each in self.slopes], axis=0)

    def rate(self, pressure: Array) -> Array:
        """Return how the pressures of the cells in contact change with the approach, (n,) [1/mm].

        Args:
            pressure: The pressures, which are positive in contact.
        """
        moving, rate = np.flatnonzero(pressure), np.zeros_like(pressure)
        loaded = pressure * self.modulus
        while True:
            self.learn(pressure)  # a memory that is full has begun anew with the rate
            matrix = self.compliance(pressure).of(moving)
            for each in self.slopes:
                moved, along = each.share_rate(loaded)
                matrix += self.modulus * np.outer(moved[moving], along[moving])
            rate[moving] = np.linalg.solve(matrix, np.ones(len(moving)))
            if not any([each.learn(rate, _REST_OF_RATE) for each in self.slopes]):
                return rate
