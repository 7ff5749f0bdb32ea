"""What finite slopes add on few cells, by pressures near those that they were worked out for.

Both orders L of finite slopes are linear in the pressures, and their sum is but for the share of
the second, which two quadratic forms give (`micro.boundary_elements.finite_slopes`). Of pressures p
the part Π p is a combination of those before, for which L is known. As L is symmetric, so is most
of what it does with the rest:

    L p ≈ L Π p + Π L (1 − Π) p.

What is left out, (1 − Π) L (1 − Π) p, changes a force by the product of two rests: that of the
pressures and that of their derivative by the approach. Where the rest of the pressures is larger
than a bound, L is worked out for it, too.

Theory: docs/theory.md, section 7.
"""

from __future__ import annotations

import numpy as np

from micro.boundary_elements.finite_slopes import FiniteSlopes, second_share
from support.arrays import Array, Indices

_MOST = 192
"""Pressures that are remembered at most: 40 MB on 64² coarse cells."""


class RememberedSlopes:
    """Finite slopes of a surface that is loaded on few cells, with a memory.

    Args:
        slopes: The finite slopes.
        cells: Flat indices of the cells that may be loaded, shape (n,).
        rest: Rest of the pressures, over them, that is left out in part. With 1e-6 forces of rows
            changed by 6e-10, with 1e-4 by up to 6e-8, and of 51 evaluations 35 were left.
    """

    def __init__(self, slopes: FiniteSlopes, cells: Indices, rest: float) -> None:
        self._cells, self._slopes, self._rest = cells, slopes, rest
        coarse = slopes.grid[0] * slopes.grid[1]
        self._per_coarse = slopes.surface.heights.size / coarse
        # m directions of pressures, orthonormal, and displacements by them in both orders: on the
        # coarse cells, and on the few ones
        self._known = 0
        self._coarse = np.empty((3, _MOST, coarse))
        self._few = np.empty((3, _MOST, len(cells)))
        # displacements in both orders along directions, and the form of first order from the top
        self._forms = np.zeros((3, _MOST, _MOST))

    def on_cells(self, pressure: Array) -> Array:
        """Return what is added to the displacements of the first k cells, shape (k,) [mm].

        Args:
            pressure: Pressures on them; the others have none, shape (k,) [MPa].
        """
        return self._combined(self._few[:, :, : len(pressure)], pressure)

    def displacement(self, pressure: Array) -> Array:
        """Return what is added to the displacements of all cells, shape (nx, ny) [mm].

        Args:
            pressure: Pressures on all cells, shape (nx, ny) [MPa].
        """
        few = pressure.ravel()[self._cells]
        if np.count_nonzero(few) < np.count_nonzero(pressure):
            return self._slopes.displacement(pressure)
        moved = self._combined(self._coarse, few)
        return self._slopes.refined(moved.reshape(self._slopes.grid))

    def _combined(self, known: Array, pressure: Array) -> Array:
        """Return displacements where directions and displacements by them are known, (3, m, k)."""
        loaded = self._loaded(pressure)
        size, parts = float(np.linalg.norm(loaded)), self._along(0, pressure)
        rest = size**2 - float(parts @ parts)
        if rest > (self._rest * size) ** 2:
            if self._known == _MOST:
                self._known = 0  # forget all
            self._remember(loaded)
            parts = self._along(0, pressure)
        count = self._known
        forms = self._forms[:, :count, :count]
        first, second = (float(parts @ forms[k] @ parts) for k in (2, 1))
        combined = np.zeros(known.shape[2])
        for order, share in ((1, 1.0), (2, second_share(first, second))):
            across = self._along(order, pressure) - forms[order - 1] @ parts
            combined += (share * parts) @ known[order, :count]
            combined += (share * across) @ known[0, :count]
        return combined

    def _loaded(self, pressure: Array) -> Array:
        """Return pressures on the coarse cells by those on the few, flat."""
        everywhere = np.zeros(self._slopes.surface.grid)
        everywhere.ravel()[self._cells[: len(pressure)]] = pressure
        return self._slopes.coarsened(everywhere).ravel()

    def _along(self, what: int, pressure: Array) -> Array:
        """Return products of pressures with directions or displacements by them, shape (m,)."""
        known = self._few[what, : self._known, : len(pressure)]
        return np.asarray(known @ pressure / self._per_coarse)

    def _remember(self, loaded: Array) -> None:
        """Work out the orders for the direction that pressures on the coarse cells add."""
        slopes, last, end = self._slopes, self._known, self._known + 1
        directions = self._coarse[0]
        for _ in range(2):  # orthogonal to rounding
            loaded = loaded - (directions[:last] @ loaded) @ directions[:last]
        directions[last] = loaded / np.linalg.norm(loaded)
        moved, fields, works = slopes.orders(directions[last].reshape(slopes.grid))
        self._coarse[1:, last] = moved.reshape(2, -1)
        for few, coarse in zip(self._few, self._coarse, strict=True):
            few[last] = slopes.refined(coarse[last].reshape(slopes.grid)).ravel()[self._cells]
        if not last:  # fields only weigh the second order: single precision is enough
            self._fields = np.empty((_MOST, fields.size), np.float32)
        self._fields[last] = fields.ravel()
        rows = [directions[:end] @ self._coarse[order, last] for order in (1, 2)]
        rows.append(self._fields[:end] @ works.ravel().astype(np.float32))
        for form, row in zip(self._forms, rows, strict=True):
            form[last, :end] = form[:end, last] = row
        self._known = end
