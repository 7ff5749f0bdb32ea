"""One step of a contact under shear: tangential tractions bounded by friction, as a record.

Pressures p are known, and with them the bound g = μ p of the tractions q on each cell (Coulomb).
The other body has shifted by d along the surface, and at the step before the cells had slipped by
w. With the tangential compliance S the slip in this step is

    s = d − w − S q,    |q| ≤ g,    s = 0 where |q| < g,    s = λ q with λ ≥ 0 where |q| = g.

These are the conditions of the minimum of the convex energy ½ q·S q − q·(d − w) over all tractions
within the bounds. Where the shear force is prescribed, d is the same unknown shift of all cells and
the tractions of the minimum have that sum.

Source: Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), ch. 4.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.friction.tangential_grid import BodyGrid, TangentialGrid
from patchlaw.support.arrays import Array, Flags

AT_BOUND = 1e-10
"""Tractions below the bound by no more than this share of it lie on it. `admissible` takes some of
them back by the square of the angle that they have turned by."""
_MOST_STEPS, _MOST_HALVINGS = 100, 30
_ENOUGH = 1e-13
"""Residual of the shear force, relative to the largest that friction transmits."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TractionProblem:
    """Shear of the n cells of a contact whose pressures are known.

    Args:
        grid: Tangential compliance.
        cells: The cells that have a pressure.
        bound: Largest traction μ p of each, positive, shape (n,).
        shift: Shift d − w that the cells would follow without slipping further, shape (2, n) [mm];
            where the shear force is prescribed it counts from an unknown shift of all cells.
        force: Sums of the tractions along x and y, shape (2,); None prescribes the shift.
        tolerance: Largest residual of a solution.
    """

    grid: TangentialGrid | BodyGrid
    cells: Cells
    bound: Array
    shift: Array
    force: Array | None
    tolerance: float

    @property
    def slides(self) -> bool:
        """Whether friction does not transmit the prescribed force without sliding."""
        if self.force is None or not self.force.any():
            return False
        return float(np.hypot(*self.force)) >= self.bound.sum()

    def within_bounds(self, tractions: Array) -> Array:
        """Return the tractions nearest to given ones within the bounds, shape (2, n)."""
        size = np.hypot(*tractions)
        return tractions * np.where(size > self.bound, self.bound / np.maximum(size, 1e-300), 1.0)

    def at_bounds(self, tractions: Array) -> Flags:
        """Return which tractions, within the bounds, lie on them, shape (n,)."""
        return np.asarray(np.hypot(*tractions) >= (1.0 - AT_BOUND) * self.bound)

    def admissible(self, tractions: Array) -> Array | None:
        """Return tractions near given ones that lie within the bounds and have the given sums.

        They are the nearest within the bounds of q + g m. The two numbers m follow from Newton's
        method: the sums are the gradient of a convex function of them.

        Args:
            tractions: Tractions that may do neither, shape (2, n).

        Returns:
            The tractions; None where they are not found.
        """
        moved = self.within_bounds(tractions)
        if self.force is None:
            return moved
        number, scale = np.zeros(2), float(self.bound.sum())
        off = moved.sum(axis=1) - self.force
        for _ in range(_MOST_STEPS):
            if np.abs(off).max() <= _ENOUGH * scale:
                return moved
            step = -np.linalg.lstsq(self._resistance(tractions, number), off, rcond=1e-14)[0]
            for _ in range(_MOST_HALVINGS):
                ahead = number + step
                moved = self.within_bounds(tractions + ahead[:, None] * self.bound)
                left = moved.sum(axis=1) - self.force
                if np.hypot(*left) < np.hypot(*off):
                    break
                step = 0.5 * step
            else:
                return None
            number, off = ahead, left
        return None

    def _resistance(self, tractions: Array, number: Array) -> Array:
        """Return the derivative of the sums by the two numbers, shape (2, 2)."""
        far = tractions + number[:, None] * self.bound
        size = np.hypot(*far)
        free = size <= self.bound
        ratio = np.where(free, 1.0, self.bound / np.maximum(size, 1e-300))
        ahead = np.where(free, 0.0, far / np.maximum(size, 1e-300))
        weight = self.bound * ratio
        return np.asarray(weight.sum() * np.eye(2) - (weight * ahead) @ ahead.T)


class Tractions(NamedTuple):
    """A solution of the traction problem.

    Attributes:
        traction: Tractions on the cells of the contact, shape (2, n).
        motion: Shift of all cells where the shear force is prescribed, otherwise 0, shape (2,)
            [mm].
        slip: Slip of the cells in this step, shape (2, n) [mm].
        slipping: Which cells slip, shape (n,).
        residual: Largest violation of the conditions over the largest shift.
        products: Products of the compliance with tractions.
    """

    traction: Array
    motion: Array
    slip: Array
    slipping: Flags
    residual: float
    products: int
