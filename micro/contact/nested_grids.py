"""A contact problem on the cells of a surface, on boxes of them and on coarser grids.

Pressures to start from come from the solution on a grid half as fine, and so on down to a small
one. The set of cells in contact is then found on the coarse grids, where that costs little, and
only its edge is left to the fine one (full multigrid: Zhao, Vollebregt & Oosterlee 2014,
doi 10.3846/13926292.2014.909899).

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.cells import Box
from micro.compliance.grid_compliance import Compliance, GridCompliance
from micro.contact.active_set import solve
from micro.contact.problem import ContactPressures, ContactProblem
from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]

FEW_CELLS = 32
"""Cells per side on which a solution from nothing costs nothing."""
_ROUGH = 2e-2
"""Residual on the coarse grids; their discretisation errs by more."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceProblem:
    """Contact of a rigid body with a rectangle of cells of a surface.

    Args:
        compliance: The elastic body.
        interference: Overlap of the undeformed bodies at zero free motions, (nx, ny) [mm].
        motions: Free motions of the rigid body with their loads; none when not given.
        upper: Upper bound of the pressures / E*.
        spacing: Sides of a cell [mm].
        corner: Corner of the first cell on the surface [mm].
    """

    compliance: Compliance
    interference: Array
    motions: Motions | None
    upper: float
    spacing: tuple[float, float]
    corner: tuple[float, float] = (0.0, 0.0)

    def on(self, box: Box) -> SurfaceProblem:
        """Return the problem of a box of these cells, which carries all loads."""
        return replace(
            self,
            interference=np.ascontiguousarray(self.interference[box]),
            motions=None if self.motions is None else self.motions.on(box),
            corner=box.corner(self.spacing),
        )

    def coarsened(self, factors: Sequence[int]) -> SurfaceProblem:
        """Return the problem on coarse cells of so many fine ones along x and y."""
        return replace(
            self,
            interference=coarsened(self.interference, factors),
            motions=None if self.motions is None else self.motions.coarsened(factors),
            spacing=(self.spacing[0] * factors[0], self.spacing[1] * factors[1]),
        )

    def with_compliance(self, compliance: GridCompliance) -> ContactProblem:
        """Return the problem on these cells with their compliance."""
        return ContactProblem(
            compliance=compliance,
            interference=self.interference,
            motions=self.motions,
            upper=self.upper,
        )

    def solve_coarse(self, tolerance: float) -> ContactPressures:
        """Solve on these cells without free sides and slopes, from nothing.

        Raises:
            NotConverged: As for `solve`.
        """
        start = self.nested_start()
        shape = self.interference.shape
        grid = self.compliance.on_coarse(shape, self.spacing, self.corner)
        return solve(self.with_compliance(grid), start, tolerance)

    def nested_start(self) -> Array:
        """Return pressures / E* to start from, shape (nx, ny).

        They come from a grid half as fine. On a small grid they are uniform and meet the loads.
        """
        shape = self.interference.shape
        total = 0.0 if self.motions is None else float(np.abs(self.motions.loads).max())
        factors = [1 + (n > FEW_CELLS) for n in shape]
        if max(factors) > 1:
            try:
                found = self.coarsened(factors).solve_coarse(_ROUGH)
                return refined(found.pressure, factors)[: shape[0], : shape[1]]
            except NotConverged:  # a bad start only costs time
                pass
        return np.full(shape, total / self.interference.size)


def coarsened(field: Array, factors: Sequence[int]) -> Array:
    """Average blocks of cells; an incomplete last block is filled with its last cells."""
    missing = [(0, -n % factor) for n, factor in zip(field.shape, factors, strict=True)]
    full = np.pad(field, missing, mode="edge")
    rows, columns = (n // factor for n, factor in zip(full.shape, factors, strict=True))
    return full.reshape(rows, factors[0], columns, factors[1]).mean(axis=(1, 3))


def refined(field: Array, factors: Sequence[int]) -> Array:
    """Repeat cells."""
    return np.repeat(np.repeat(field, factors[0], axis=0), factors[1], axis=1)
