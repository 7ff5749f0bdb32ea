"""Conjugate gradients for the pressures of a given set of cells in contact.

With the set fixed the contact is a linear system: the pressures p on the cells A in contact make
the gap vanish there, (G p)_A = d_A, or, when the force is given, make it uniform at fixed Σp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from micro.cells.elastic_grid import Cells, ElasticGrid

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactCells:
    """Cells in contact, loaded by a rigid body at a given approach or with a given force.

    Args:
        grid: The elastic half-space.
        cells: The n cells in contact.
        punch: With a given force, roughly the pressures by a uniform displacement of the cells,
            shape (n,); None with a given approach.
    """

    grid: ElasticGrid
    cells: Cells
    punch: Array | None

    @classmethod
    def among(cls, grid: ElasticGrid, cells: Cells, *, force_given: bool) -> ContactCells:
        """Prepare a set of cells."""
        punch = grid.resist(cells, np.ones(cells.flat.size)) if force_given else None
        return cls(grid=grid, cells=cells, punch=punch)

    def balanced(self, gap: Array) -> Array:
        """Subtract from gaps the uniform part, which the free body takes up by moving."""
        if self.punch is None:
            return gap
        return gap - (self.punch @ gap) / self.punch.sum()

    def preconditioned(self, gap: Array) -> Array:
        """Return roughly the pressures that make these gaps, without force when that is given."""
        found = self.grid.resist(self.cells, gap)
        if self.punch is None:
            return found
        return found - self.punch * (found.sum() / self.punch.sum())

    def close(self, gap: Array, *, stop: float, limit: int) -> Array:
        """Return the change of the pressures that closes gaps, by preconditioned iterations.

        Args:
            gap: Gaps of the cells under the present pressures, shape (n,) [mm].
            stop: Largest gap to leave [mm].
            limit: Number of iterations after which the change is returned as it is.

        Returns:
            Change of the pressures / E*, shape (n,); of any sign.

        Source:
            Polonsky & Keer 1999, doi 10.1016/S0043-1648(99)00113-1, for the given force by removal
            of the mean; Gould, Hribar & Nocedal 2001, doi 10.1137/S1064827598345667, for its
            preconditioned form.
        """
        left = self.balanced(gap)
        change, direction, before = np.zeros_like(left), np.zeros_like(left), np.inf
        for _ in range(limit):
            step = self.preconditioned(left)
            size = float(left @ step)
            if size <= 0.0:
                break
            direction = step + (size / before) * direction
            answer = self.grid.comply(self.cells, direction)
            length = size / (direction @ answer)
            change -= length * direction
            left = self.balanced(left - length * answer)
            if np.abs(left).max() <= stop:
                break
            before = size
        return change
