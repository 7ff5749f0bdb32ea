"""The compliance of few cells as one matrix, whose linear systems are solved by factors.

Where a rigid body can touch few cells of a large surface, the sum of all terms between these cells
is a small matrix. A product with it takes microseconds, and Cholesky's factors of the cells in
contact are an exact inverse for the conjugate gradients, which then end after a step or two.

Finite slopes are a matrix of their own up to what they have not been worked out for, and to the
share of their second order (`micro.boundary_elements.remembered_slopes`). A contact of these cells
is then a linear complementarity problem of a small matrix, which is corrected a few times.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.boundary_elements.remembered_slopes import RememberedSlopes
from patchlaw.support.arrays import Array, Indices

_REST_OF_RATE = 2e-4
"""Rest of the derivative of the pressures by the approach. Its square, times the few per cent that
finite slopes add, is what the derivative of the force errs by."""


class ComplianceMatrix:
    """Compliance of n cells, a column of them, by its matrix; see `GridCompliance`.

    Args:
        matrix: Displacements of the cells by unit pressures on them, shape (n, n) [mm/MPa].
        added: Columns a and b of a symmetric matrix a bᵀ + b aᵀ that is added to it, shape (n, m)
            both; None: none.

    Attributes:
        products: Products with pressures so far.
    """

    def __init__(self, matrix: Array, added: tuple[Array, Array] | None = None) -> None:
        self._matrix, self._added = matrix, added
        self._last: tuple[Cells, Array, tuple[Array, bool]] | None = None
        self.products = 0

    @property
    def nbytes(self) -> int:
        """Size of the matrix [B]."""
        return self._matrix.nbytes

    def with_added(self, first: Array, second: Array) -> ComplianceMatrix:
        """Return the compliance with columns a and b whose matrix a bᵀ + b aᵀ is added, (n, m)."""
        return ComplianceMatrix(self._matrix, (first, second))

    def displacement(self, pressure: Array, out: Array | None = None) -> Array:
        """Return the displacement by pressures on all cells, shape (n, 1) [mm].

        Args:
            pressure: The pressures, shape (n, 1) [MPa].
            out: Where the displacement is put; new memory if not given.
        """
        self.products += 1
        moved = np.matmul(self._matrix, pressure, out=out)
        if self._added is not None:
            moved += self.displacement_by_added(pressure)
        return moved

    def displacement_by_added(self, pressure: Array) -> Array | float:
        """Return the part of the displacement that the added matrix has, shape (n, 1) [mm]."""
        if self._added is None:
            return 0.0
        first, second = self._added
        return np.asarray(first @ (second.T @ pressure) + second @ (first.T @ pressure))

    def of(self, rows: Indices | slice) -> Array:
        """Return the matrix of some of the cells, by their indices: shape (m, m)."""
        one = self.among(rows)
        if one._added is None:
            return one._matrix
        half = one._added[0] @ one._added[1].T
        return np.asarray(one._matrix + half + half.T)

    def among(self, rows: Indices | slice) -> ComplianceMatrix:
        """Return the compliance of some of the cells, by their indices."""
        square = (rows, rows) if isinstance(rows, slice) else np.ix_(rows, rows)
        added = None if self._added is None else (self._added[0][rows], self._added[1][rows])
        return ComplianceMatrix(self._matrix[square], added)

    def apply_compliance(self, cells: Cells, pressure: Array) -> Array:
        """Return the displacements of some cells by pressures on them, shape (m,) [mm]."""
        self.products += 1
        return np.asarray(self._among(cells)[0] @ pressure)

    def inverse_on(self, cells: Cells) -> FactoredInverse:
        """Return the inverse of the compliance of some cells."""
        return FactoredInverse(self._among(cells)[1])

    def _among(self, cells: Cells) -> tuple[Array, tuple[Array, bool]]:
        """Return the matrix of some cells, and its factors."""
        if self._last is None or self._last[0] is not cells:
            part = self.of(cells.flat)
            try:
                factors = scipy.linalg.cho_factor(part, lower=True, check_finite=False)
            except np.linalg.LinAlgError:  # to rounding, or terms that err: CG then iterates
                factors = scipy.linalg.cho_factor(np.diag(np.diag(part)), lower=True)
            self._last = cells, part, factors
        return self._last[1:]


class FactoredInverse:
    """Inverse of the compliance of n cells by Cholesky's factors; see `ContactInverse`.

    Args:
        factors: The factors.
    """

    accurate = False  # pressures by free motions are not to be left out: they cost little

    def __init__(self, factors: tuple[Array, bool]) -> None:
        self._factors = factors

    def __call__(self, displacement: Array) -> Array:
        """Return the pressures that displace the cells so, shape (n,)."""
        return np.asarray(scipy.linalg.cho_solve(self._factors, displacement, check_finite=False))


@dataclass(frozen=True, eq=False)
class FewCells:
    """Few cells that are loaded mostly; pressures on them have the shape (n,) [MPa].

    Args:
        cells: Their flat indices, shape (n,).
        elastic: Their compliance without finite slopes.
        slopes: What finite slopes add, of each body.
        rest: Rest of the pressures, over them, that finite slopes leave out in part. Forces of 10
            surfaces of the paper's recipe changed by 5e-10 with 1e-7, and largest pressures by
            8e-10; by 8e-10 and 2e-9 with 1e-6, with an eighth fewer evaluations.
    """

    cells: Indices
    elastic: ComplianceMatrix
    slopes: Sequence[RememberedSlopes]
    rest: float

    def hold(self, pressure: Array) -> bool:
        """Return whether of all cells, shape (nx, ny), no others are loaded."""
        loaded = np.count_nonzero(pressure)
        return np.count_nonzero(pressure.ravel()[self.cells]) == loaded

    def learn(self, pressure: Array) -> None:
        """Work out what finite slopes add by pressures, where that is not known."""
        for each in self.slopes:
            each.learn(pressure, self.rest)

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
        columns = zip(*(each.columns(pressure) for each in self.slopes), strict=True)
        displacements, directions = (np.concatenate(each, axis=1) for each in columns)
        return self.elastic.with_added(displacements, directions)

    def slope_displacement(self, pressure: Array) -> Array | None:
        """Return what finite slopes add to the displacements of all cells, if any, (nx, ny)."""
        if not self.slopes:
            return None
        return np.sum([each.displacement(pressure) for each in self.slopes], axis=0)

    def rate(self, pressure: Array) -> Array:
        """Return how the pressures of the cells in contact change with the approach, (n,) [MPa/mm].

        Args:
            pressure: The pressures, which are positive in contact.
        """
        moving, rate = np.flatnonzero(pressure), np.zeros_like(pressure)
        while True:
            self.learn(pressure)  # a memory that is full has begun anew with the rate
            matrix = self.compliance(pressure).of(moving)
            for each in self.slopes:
                moved, along = each.share_rate(pressure)
                matrix += np.outer(moved[moving], along[moving])
            rate[moving] = np.linalg.solve(matrix, np.ones(len(moving)))
            if not any([each.learn(rate, _REST_OF_RATE) for each in self.slopes]):
                return rate
