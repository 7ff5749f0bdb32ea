"""The contact problem of a rigid body on an elastic one, as a record.

Unknown are the pressures p on the cells of a grid and those rigid motions q of the body that are
free. With the compliance C, the interference d of the undeformed bodies where all free motions are
zero, and ℓ_i, how much nearer motion i brings the body, the gap is

    g = C p − d − Σ_i q_i ℓ_i,

and the pressures, bounded by the hardness H of the cells where one is given, satisfy

    p = 0 where g > 0,    g = 0 where 0 < p < H,    p = H where g < 0,    Σ p ℓ_i = f_i.

These are the conditions of the minimum of the convex energy ½ p·C p − p·d over all pressures
between 0 and H that meet the loads f_i.

Source: Almqvist, Sahlin, Larsson & Glavatskih 2007, Tribol. Int. 40, 574-579, for the bound H.

Theory: docs/theory.md, section 3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from patchlaw.micro.boundary_elements.compliance_matrix import ComplianceMatrix
from patchlaw.micro.boundary_elements.grid_compliance import Compliance, GridCompliance
from patchlaw.micro.complementarity.cell_fields import Box, coarsened
from patchlaw.micro.complementarity.rigid_motions import Motions
from patchlaw.support.arrays import Array, Flags, Indices

_ROUGH = 5e-5
"""Tolerance from which on displacements are evaluated in single precision. That errs by 3e-7 of the
largest one, which thin layers have a hundred times as large on a half-space."""


class ContactPressures(NamedTuple):
    """A solution of the contact problem, or pressures to start one from.

    Attributes:
        pressure: Pressures, shape (nx, ny) [MPa].
        motion: Free motions of the body, counted from where the interference was, (k,) [mm].
        residual: Largest violation of the contact conditions over the largest interference.
        iterations: Products of the compliance with pressures.
        by_slopes: What finite slopes add to the displacements, shape (nx, ny) [mm]; None where that
            is not known.
        nearby: Returns interferences of solutions nearby, less what finite slopes add, and what
            these add, shape (nx, ny) [mm].
    """

    pressure: Array
    motion: Array = np.zeros(0)
    residual: float = 0.0
    iterations: int = 0
    by_slopes: Array | None = None
    nearby: Callable[[], Sequence[tuple[Array, Array]]] = tuple


@dataclass(frozen=True, kw_only=True, eq=False)
class CellProblem:
    """Contact of a rigid body with a rectangle of cells of a surface.

    Args:
        compliance: The elastic body.
        spacing: Sides of a cell [mm].
        interference: Interference d of the undeformed bodies at zero free motions, negative where
            they are apart, shape (nx, ny) [mm].
        motions: Free rigid motions of the body, if there are any, with their loads.
        tolerance: Largest residual of a solution.
        hardness: Largest pressure H [MPa], infinite where contacts are elastic. Pressures of a
            solution that are at this bound equal it exactly.
        lowered: What finite slopes have taken off the interference [mm].
        corner: Corner of the first cell on the surface [mm].
        coarse: Whether these are no cells of the surface but coarser ones, where free sides may be
            left out.
        matrix: Compliance of the cells where they are few, here and there on the surface; they are
            a column then.
    """

    compliance: Compliance
    spacing: tuple[float, float]
    interference: Array
    motions: Motions
    tolerance: float
    hardness: float = np.inf
    lowered: Array | float = 0.0
    corner: tuple[float, float] = (0.0, 0.0)
    coarse: bool = False
    matrix: ComplianceMatrix | None = None

    @cached_property
    def grid(self) -> GridCompliance | ComplianceMatrix:
        """Compliance of these cells, without finite slopes."""
        if self.matrix is not None:
            return self.matrix
        return self.compliance.on_grid(
            self.interference.shape,
            self.spacing,
            self.corner,
            coarse=self.coarse,
            rough=self.tolerance >= _ROUGH,
        )

    @property
    def undeformed(self) -> Array:
        """Interference without finite slopes, shape (nx, ny) [mm]."""
        return np.asarray(self.interference + self.lowered)

    @property
    def unloaded(self) -> bool:
        """Whether no free motion has a load: the approach is prescribed and the tilt is free."""
        return self.motions.turns and not self.motions.loads.any()

    @property
    def has_no_gap(self) -> bool:
        """Whether no pressures hold a period at a prescribed approach, as it leaves no gap."""
        prescribed = self.compliance.periodic and not self.motions.count
        return prescribed and not self.yields and float(self.interference.mean()) >= 0.0

    @property
    def yields(self) -> bool:
        """Whether cells yield, at a pressure that is the hardness."""
        return self.hardness < np.inf

    def lowered_by(self, displaced: Array) -> CellProblem:
        """Return the problem without finite slopes, with what they displace the surface by.

        Args:
            displaced: This displacement into the body, shape (nx, ny) [mm].
        """
        return replace(self, interference=self.interference - displaced, lowered=displaced)

    def on(self, box: Box) -> CellProblem:
        """Return the problem of a box of these cells, those of a surface, which carries all loads.

        Args:
            box: Rows and columns of the box.
        """
        x, y = (part.start * step for part, step in zip(box, self.spacing, strict=True))
        interference = np.ascontiguousarray(self.interference[box])
        return replace(
            self,
            interference=interference,
            motions=self.motions.on(box),
            corner=(x, y),
        )

    def among(self, cells: Indices, matrix: ComplianceMatrix | None = None) -> CellProblem:
        """Return the problem of a few of these cells, those of a surface, which carry all loads.

        Args:
            cells: Their flat indices, shape (n,).
            matrix: Their compliance; that without finite slopes when not given.
        """
        if matrix is None:
            matrix = self.compliance.matrix_on(cells, self.interference.shape, self.spacing)
        return replace(
            self,
            interference=self.interference.ravel()[cells][:, None],
            motions=self.motions.among(cells),
            matrix=matrix,
        )

    def coarsened(self, factors: Sequence[int], tolerance: float) -> CellProblem:
        """Return the problem on coarse cells, with a tolerance of its own.

        Args:
            factors: Fine cells along x and y in a coarse one.
            tolerance: Largest residual of a solution.
        """
        return replace(
            self,
            interference=coarsened(self.interference, factors),
            motions=self.motions.coarsened(factors),
            spacing=(self.spacing[0] * factors[0], self.spacing[1] * factors[1]),
            tolerance=tolerance,
            coarse=True,
        )

    def admissible(self, pressure: Array, fixed: Flags | None = None) -> Array | None:
        """Return pressures near given ones that lie within the bounds and meet the loads.

        Args:
            pressure: Pressures ≥ 0 that may do neither, shape (nx, ny); may be overwritten by
                the result.
            fixed: Cells whose pressures stay as they are where that is possible, shape (nx, ny).

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if not self.motions.count:
            return np.minimum(pressure, self.hardness, out=pressure) if self.yields else pressure
        scaled = None
        if fixed is not None:
            scaled = self.motions.scaled_to_loads(pressure, self.hardness, fixed)
        return self.motions.scaled_to_loads(pressure, self.hardness) if scaled is None else scaled

    def first_at_bounds(self, pressure: Array, change: Array) -> tuple[Indices, float]:
        """Return the cells that meet their bounds first along a change, and its share up to there.

        Cells that the change would drive out of a bound which they are at already come first, with
        a share of 0: the half of them that it changes most.

        Args:
            pressure: Pressures of some cells, within the bounds, shape (n,).
            change: Their change, shape (n,).
        """
        distance = np.where(change < 0.0, pressure, self.hardness - pressure)
        size = np.abs(change)
        stuck = np.flatnonzero((distance <= 0.0) & (size > 0.0))
        if stuck.size:
            most = np.argsort(-size[stuck], kind="stable")[: (stuck.size + 1) // 2]
            return stuck[most], 0.0
        parts = np.divide(distance, size, out=np.full_like(change, np.inf), where=size > 0.0)
        first = int(np.argmin(parts))
        return np.array([first]), min(1.0, float(parts[first]))
