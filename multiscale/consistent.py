"""Makes the consistent patch laws: all of them from one solution of the whole surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.patches import PatchGrid
from micro import MicroModel, influence_matrix
from multiscale.law_files import LawTable
from multiscale.laws import PatchLaw
from multiscale.refinement import MOST_ROWS, law_of, refined

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeSurface:
    """A rough surface pressed as a whole by a level plane, seen patch by patch.

    The closure of a patch is the approach less the mean displacement of the patch by the mean
    pressures of all patches, c_i = δ − Σ_j Λ_ij p_j / (π E*): what a block answers with. What a
    patch sinks beyond that (`PatchLaw.relief`) is told from its first touch on; before, by that
    there.

    Attributes:
        model: Micro model of the whole surface.
        patches: Its partition.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        compliance: Λ / (π E*), shape (N, N) [mm/MPa].
    """

    model: MicroModel
    patches: PatchGrid
    mean_heights: Array
    compliance: Array

    def rows(self, approaches: Array) -> Array:
        """Return rows of all patches at increasing approaches, shape (m, N, 6).

        The columns are approach, closure, pressure, area fraction, contacts, relief.
        """
        response = self.model.respond(
            approaches, patches=self.patches, mean_heights=self.mean_heights
        )
        pressure = response.patch_pressure.copy()
        pressure[approaches <= self.model.first_touch] = 0.0  # whatever round-off makes of it
        displacement = pressure @ self.compliance
        touched = pressure > 0.0
        columns = (
            np.broadcast_to(approaches[:, None], pressure.shape),
            approaches[:, None] - displacement,
            pressure,
            np.where(touched, response.patch_contact_area / self.patches.area, 0.0),
            np.where(touched, response.patch_contacts, 0),
            response.patch_displacement - displacement,
        )
        return np.stack(columns, axis=2).astype(np.float64)

    def laws(self, rows: Array) -> list[PatchLaw]:
        """Return the laws of all patches through rows (m, N, 6), sorted by approach."""
        reaches = self.model.datum - self.mean_heights
        return [_law(rows[:, index], float(reach)) for index, reach in enumerate(reaches)]

    def tabulated(
        self, approach_end: float, tolerance: float, most_rows: int
    ) -> tuple[list[PatchLaw], float]:
        """Return all laws up to an approach, and the error of the force; see `refined`."""
        if approach_end <= self.model.first_touch:
            return self.laws(self.rows(np.array([approach_end]))), 0.0
        return refined(
            self.rows,
            self.laws,
            self.model.first_touch,
            approach_end,
            compliance=self.compliance,
            tolerance=tolerance,
            most_rows=most_rows,
        )


def consistent_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    approach_end: float,
    tolerance: float = 1e-3,
    most_rows: int = MOST_ROWS,
    comm: Any = None,
) -> LawTable:
    """Tabulate the laws of all patches of one surface that is pressed as a whole.

    On a block whose compliance is that of the half-space they give back the solution they were
    made from, whatever the partition: to rounding at their rows, and between them to the error
    that the table states.

    Args:
        model: Micro model of the whole surface.
        patches: Its partition.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        approach_end: Largest local approach that the laws will be asked for [mm]; patches that
            are not touched up to it are open.
        tolerance: Interpolation error of the force, see `refinement.refined`.
        most_rows: Rows that are solved at most.
        comm: MPI communicator; its first rank solves, so that the table is the same to the bit on
            any number of ranks.

    Returns:
        All laws, on every rank.

    Raises:
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    means = np.asarray(mean_heights, dtype=float)
    whole = WholeSurface(
        model=model,
        patches=patches,
        mean_heights=means,
        compliance=influence_matrix(patches) / (np.pi * model.contact_modulus),
    )
    laws, error = on_root(comm, lambda: whole.tabulated(approach_end, tolerance, most_rows))
    return LawTable(
        patches=patches,
        laws=tuple(laws),
        made_by={
            "coupling": "consistent",
            "model": model.name,
            "love": "mean",
            "tolerance": f"{tolerance:g}",
        },
        force_error=error,
    )


def _law(rows: Array, reach: float) -> PatchLaw:
    """Return the law of one patch out of all rows (m, 6), those before its touch included."""
    loaded = np.flatnonzero(rows[:, 2] > 0.0)
    if not loaded.size:
        return law_of(rows[:0], float(rows[:, 1].max()), reach)
    first = max(int(loaded[0]), 1)
    start = _touch(rows[first - 1 :])
    return law_of(np.vstack((start, rows[first:])), float(start[1]), reach)


def _touch(rows: Array) -> Array:
    """Return the row of first touch, between an open row and the first one in contact.

    The straight line of p^(2/3) through the first two rows in contact tells the approach (Hertz'
    law); closure and relief are taken between the open row and the first in contact.
    """
    before, after = rows[:2]
    share = 0.0
    if len(rows) > 2 and rows[2, 2] > after[2]:
        root, later = rows[1:3, 2] ** (2 / 3)
        back = root / (later - root) * (rows[2, 0] - after[0])
        share = np.clip(1.0 - back / (after[0] - before[0]), 0.0, 0.99)
    start = before + share * (after - before)
    start[2:5] = 0.0
    return np.asarray(start)
