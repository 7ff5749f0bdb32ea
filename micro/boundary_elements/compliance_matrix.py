"""The compliance of few cells as one matrix, whose linear systems are solved by factors.

Where a rigid body can touch few cells of a large surface, the sum of all terms between these cells
is a small matrix. A product with it takes microseconds, and Cholesky's factors of the cells in
contact are an exact inverse for the conjugate gradients, which then end after a step or two.

Finite slopes are a matrix of their own up to what they have not been worked out for, and to the
share of their second order. A contact of these cells is then a linear complementarity problem of a
small matrix, which is corrected a few times.

Remembered slopes: pressures are near those that finite slopes were worked out for. Both orders L of
finite slopes are linear in the pressures, and their sum is but for the share of the second, which
two quadratic forms give (`micro.boundary_elements.finite_slopes`). Of pressures p the part Π p is a
combination of those before, for which L is known. As L is symmetric, so is most of what it does
with the rest:

    L p ≈ L Π p + Π L (1 − Π) p.

What is left out, (1 − Π) L (1 − Π) p, changes a force by the product of two rests: that of the
pressures and that of their derivative by the approach. Where the rest of the pressures is larger
than a bound, L is worked out for it, too. On few cells the right-hand side is a symmetric matrix:
the sum, over all directions that were worked out, of a product of two columns and its transpose.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes, second_share
from patchlaw.micro.boundary_elements.half_space_grid import Cells, Displaced
from patchlaw.micro.boundary_elements.inverse import Inverse
from patchlaw.support import Array, Indices

_FIRST, _MOST = 24, 128
"""Pressures that there is room for at first, and that are remembered at most: 80 MB on 64² coarse
cells that are mirrored around."""
_ROUNDING = 1e-12
"""Part of pressures beside all directions, over them, that may be rounding. Directions of rounding
are not at right angles to the others, and the next ones still less: with them forces erred by 6e-3,
with pressures that met all conditions of contact."""


class RememberedSlopes:
    """Finite slopes of a surface that is loaded on few cells, with a memory.

    Args:
        slopes: The finite slopes.
        cells: Flat indices of the n cells that may be loaded, shape (n,).

    Attributes:
        learnt: Pressures on these cells that they were worked out for, in order, (n,) each.
    """

    def __init__(self, slopes: FiniteSlopes, cells: Indices) -> None:
        self._cells, self._slopes = cells, slopes
        coarse = slopes.grid[0] * slopes.grid[1]
        self._per_coarse = slopes.surface.heights.size / coarse
        self._forget()

    def _forget(self) -> None:
        slopes, count = self._slopes, len(self._cells)
        self._known, self.learnt = 0, list[Array]()
        # directions of pressures, orthonormal, and displacements by them in both orders: on the
        # coarse cells, and on the few ones; pressures and stresses by them
        self._coarse = np.empty((3, 0, slopes.grid[0] * slopes.grid[1]))
        self._few = np.empty((3, 0, count))
        self._fields = np.empty((1, 0, 0))
        # displacements in both orders along directions, and the form of first order from the top
        self._forms = np.zeros((3, _MOST, _MOST))
        # columns: an order is their products with the directions and transposes
        self._orders = np.zeros((2, 0, count))

    def relearn(self, learnt: list[Array]) -> None:
        """Work out the orders for pressures as another memory did, see `learnt`; bit for bit."""
        self._forget()
        for pressure in learnt:
            self._remember(pressure, self._loaded(pressure))

    def learn(self, pressure: Array, rest: float) -> bool:
        """Work out the orders for pressures that are not known.

        Args:
            pressure: Pressures on the few cells, shape (n,) [MPa].
            rest: Part of the pressures that need not be known, by its norm over theirs; 1e-12 at
                least.

        Returns:
            Whether they were not known.
        """
        loaded = self._loaded(pressure)
        size, parts = float(np.linalg.norm(loaded)), self._along(0, pressure)
        if size**2 - float(parts @ parts) <= (rest * size) ** 2:
            return False
        if float(np.linalg.norm(self._beyond(loaded))) <= max(rest, _ROUNDING) * size:
            return False  # the difference of squares was rounding
        if self._known == _MOST:
            self._forget()
        self._remember(pressure, loaded)
        return True

    def columns(self, pressure: Array) -> tuple[Array, Array]:
        """Return columns a and b of the matrix a bᵀ + b aᵀ that finite slopes add on the few cells.

        Args:
            pressure: Pressures on these cells that set the share of the second order, (n,) [MPa].

        Returns:
            Both of shape (n, m); the matrix is that of displacements by unit pressures [mm/MPa].
        """
        first, second = self._orders
        return (first + self._share(pressure)[0] * second).T, self._few[0, : self._known].T

    def share_rate(self, pressure: Array) -> tuple[Array, Array]:
        """Return columns a, b: along q the displacements change by a (b · q) as the share does.

        Args:
            pressure: Pressures on the few cells, shape (n,) [MPa].
        """
        second, directions = self._orders[1], self._few[0, : self._known]
        moved = (directions @ pressure) @ second + (second @ pressure) @ directions
        return np.asarray(moved), self._share(pressure)[1]

    def displacement(self, pressure: Array) -> Array:
        """Return what is added to the displacements of all cells, shape (nx, ny) [mm].

        Args:
            pressure: Pressures on the few cells, shape (n,) [MPa]; the others have none.
        """
        moved = self._moved(pressure, 1.0, self._share(pressure)[0])
        return self._slopes.refined(moved.reshape(self._slopes.grid))

    def mean_rate(self, pressure: Array, rate: Array) -> float:
        """Return the derivative of the mean of `displacement` along a change of the pressures.

        Args:
            pressure: Pressures on the few cells, shape (n,) [MPa].
            rate: Their change by whatever the derivative is by, shape (n,).
        """
        share, changes = self._share(pressure)
        moved = self._moved(rate, 1.0, share)
        moved += self._moved(pressure, 0.0, float(changes @ rate))
        return float(moved.mean())  # all cells have the mean of the coarse ones

    def _moved(self, pressure: Array, first: float, second: float) -> Array:
        """Return a sum of the displacements of both orders on the coarse cells, flat [mm].

        Args:
            pressure: Pressures on the few cells, shape (n,) [MPa].
            first: Factor on the first order.
            second: Factor on the second.
        """
        count, parts = self._known, self._along(0, pressure)
        moved, across = np.zeros(self._coarse.shape[2]), np.zeros(count)
        for order, share in ((1, first), (2, second)):
            beyond = self._along(order, pressure) - self._forms[order - 1, :count, :count] @ parts
            moved += (share * parts) @ self._coarse[order, :count]
            across += share * beyond
        moved += across @ self._coarse[0, :count]
        return moved

    def _share(self, pressure: Array) -> tuple[float, Array]:
        """Return the share of the second order and its derivative by the pressures, (n,)."""
        parts, count = self._along(0, pressure), self._known
        by_parts = self._forms[1:, :count, :count] @ parts
        second, first = (float(parts @ one) for one in by_parts)
        share = second_share(first, second)
        if abs(second) >= abs(first):
            return share, np.zeros_like(pressure)
        ratio = second / first
        rate = -4.0 * ratio * share**2 / first * (by_parts[0] - ratio * by_parts[1])
        return share, rate @ self._few[0, :count] / self._per_coarse

    def _loaded(self, pressure: Array) -> Array:
        """Return pressures on the coarse cells by those on the few, flat."""
        everywhere = np.zeros(self._slopes.surface.grid)
        everywhere.ravel()[self._cells] = pressure
        return self._slopes.coarsened(everywhere).ravel()

    def _beyond(self, loaded: Array) -> Array:
        """Return what pressures on the coarse cells, flat, have beside all directions."""
        directions = self._coarse[0, : self._known]
        for _ in range(2):  # orthogonal to rounding
            loaded = loaded - (directions @ loaded) @ directions
        return loaded

    def _along(self, what: int, pressure: Array) -> Array:
        """Return products of pressures with directions or displacements by them, shape (m,)."""
        return np.asarray(self._few[what, : self._known] @ pressure / self._per_coarse)

    def _remember(self, pressure: Array, loaded: Array) -> None:
        """Work out the orders for the direction that pressures on the few cells add.

        Args:
            pressure: The pressures, shape (n,) [MPa].
            loaded: The same on the coarse cells, flat.
        """
        slopes, last, end = self._slopes, self._known, self._known + 1
        self.learnt.append(pressure.copy())
        if last == self._few.shape[1]:
            self._coarse, self._few = _lengthened(self._coarse), _lengthened(self._few)
        directions, loaded = self._coarse[0], self._beyond(loaded)
        directions[last] = loaded / np.linalg.norm(loaded)
        moved, fields, works = slopes.orders(directions[last].reshape(slopes.grid))
        self._coarse[1:, last] = moved.reshape(2, -1)
        everywhere = slopes.refined(self._coarse[:, last].reshape(3, *slopes.grid))
        self._few[:, last] = everywhere.reshape(3, -1)[:, self._cells]
        if not last:
            self._fields = np.empty((1, 0, fields.size))
        if last == self._fields.shape[1]:
            self._fields = _lengthened(self._fields)
        self._fields[0, last] = fields.ravel()
        rows = [directions[:end] @ self._coarse[order, last] for order in (1, 2)]
        rows.append(self._fields[0, :end] @ works.ravel())
        for form, row in zip(self._forms, rows, strict=True):
            form[last, :end] = form[:end, last] = row
        half = 0.5 * self._forms[:2, :end, :end] @ self._few[0, :end]
        self._orders = (self._few[1:, :end] - half) / self._per_coarse
        self._known = end


def _lengthened(fields: Array) -> Array:
    """Return fields with room for more of them along the second axis."""
    kinds, count, size = fields.shape
    longer = np.empty((kinds, min(max(2 * count, _FIRST), _MOST), size))
    longer[:, :count] = fields
    return longer


_REST_OF_RATE = 4e-4
"""Rest of the derivative of the pressures by the approach. Its square, times the few per cent that
finite slopes add, is what the derivative of the force errs by: 2e-8 at most on 10 drawn
surfaces, with 2e-4 as well."""


def _factors(matrix: Array) -> tuple[Array, bool]:
    """Return Cholesky's factors of a matrix, or those of its diagonal, with which CG iterates."""
    try:
        return scipy.linalg.cho_factor(matrix, lower=True, check_finite=False)
    except np.linalg.LinAlgError:  # to rounding, or terms that err
        return scipy.linalg.cho_factor(np.diag(np.diag(matrix)), lower=True)


class ComplianceMatrix:
    """Compliance of n cells, a column of them, by its matrix; see `GridCompliance`.

    Args:
        matrix: Displacements of the cells by unit pressures on them, shape (n, n) [mm/MPa].
        added: Columns a and b of a symmetric matrix a bᵀ + b aᵀ that is added to it, shape (n, m)
            both; None: none.
        of: The cells on a larger grid, where linear problems of just these are solved; None: none.

    Attributes:
        products: Products with pressures so far.
    """

    def __init__(
        self, matrix: Array, added: tuple[Array, Array] | None = None, *, of: Cells | None = None
    ) -> None:
        self._matrix, self._added = matrix, added
        self._last = None if of is None else (of, matrix, _factors(matrix))
        self.products = 0

    @property
    def nbytes(self) -> int:
        """Size of the matrix [B]."""
        return self._matrix.nbytes

    rounding, inverted = 0.0, True
    accurate = False  # pressures by free motions are not to be left out: they cost little

    def displacement(
        self, pressure: Array, out: Array | None = None, *, rough: bool = False
    ) -> Array:
        """Return the displacement by pressures on all cells, shape (n, 1) [mm].

        Args:
            pressure: The pressures, shape (n, 1) [MPa].
            out: Where the displacement is put; new memory if not given.
            rough: Of no effect.
        """
        self.products += 1
        moved = np.matmul(self._matrix, pressure, out=out)
        if self._added is not None:
            moved += self.displacement_by_added(pressure)
        return moved

    def solved_on(self, cells: Cells) -> ComplianceMatrix:
        """Return what linear problems of some cells are solved by; see `GridCompliance`."""
        return self

    def displaced_by(self, cells: Cells, pressure: Array) -> Displaced:
        """Return the displacements of all cells by pressures on some; see `GridCompliance`."""
        everywhere = np.zeros((len(self._matrix), 1))
        everywhere[cells.flat, 0] = pressure
        field = self.displacement(everywhere)
        return Displaced(field, 1.0, field[cells.flat, 0], 0.0)

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

    def inverse_on(self, cells: Cells) -> Inverse:
        """Return the inverse of the compliance of some cells, by Cholesky's factors."""
        return partial(scipy.linalg.cho_solve, self._among(cells)[1], check_finite=False)

    def _among(self, cells: Cells) -> tuple[Array, tuple[Array, bool]]:
        """Return the matrix of some cells, and its factors."""
        if self._last is None or self._last[0] is not cells:
            part = self.of(cells.flat)
            self._last = cells, part, _factors(part)
        return self._last[1:]


@dataclass(frozen=True, eq=False)
class FewCells:
    """Few cells that are loaded mostly; pressures on them have the shape (n,) [MPa].

    Args:
        cells: Their flat indices, shape (n,).
        elastic: Their compliance without finite slopes.
        slopes: What finite slopes add, of each body.
        rest: Rest of the pressures, over them, that finite slopes leave out in part. Against a
            matrix of unit loads forces of 10 drawn surfaces erred by 3e-10 with 1e-7, and pressures
            by 1e-9 of the largest; by 8e-10 and 1e-8 with 3e-7, by 2e-9 and 1e-7 with 1e-6.
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
        return ComplianceMatrix(self.elastic._matrix, (displacements, directions))

    def slope_displacement(self, pressure: Array) -> Array | None:
        """Return what finite slopes add to the displacements of all cells, if any, (nx, ny)."""
        if not self.slopes:
            return None
        return np.sum([each.displacement(pressure) for each in self.slopes], axis=0)

    def mean_slope_rate(self, pressure: Array, rate: Array) -> float:
        """Return what the mean of `slope_displacement` changes by along a change of the pressures.

        Args:
            pressure: The pressures, shape (n,) [MPa].
            rate: Their change by whatever the derivative is by, shape (n,).
        """
        for each in self.slopes:
            each.learn(rate, _REST_OF_RATE)
        return sum(each.mean_rate(pressure, rate) for each in self.slopes)

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
