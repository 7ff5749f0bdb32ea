"""Makes the consistent patch laws: all of them from one solution of the whole surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.patches import PatchGrid
from micro import MicroModel, influence_matrix
from multiscale.law_files import LawTable
from multiscale.laws import PatchLaw

Array = NDArray[np.float64]

_FIRST_ROWS = 9
_MOST_ROWS = 400  # solutions of the micro model
_LEAST_SCALE = 0.01  # of the largest pressure: below it an error counts as one of this much


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
        """Return, for every approach, columns of all patches, shape (n, 6, N).

        The columns are approach, closure, pressure, area fraction, contacts, relief.
        """
        response = self.model.respond(
            approaches, patches=self.patches, mean_heights=self.mean_heights
        )
        pressure = response.patch_pressure
        displacement = pressure @ self.compliance
        columns = (
            np.broadcast_to(approaches[:, None], pressure.shape),
            approaches[:, None] - displacement,
            pressure,
            response.patch_contact_area / self.patches.area,
            response.patch_contacts,
            response.patch_displacement - displacement,
        )
        return np.stack(columns, axis=1).astype(np.float64)

    def laws(self, approach_end: float, tolerance: float) -> tuple[PatchLaw, ...]:
        """Tabulate all laws up to an approach; rows are added half-way between rows.

        Args:
            approach_end: Largest approach.
            tolerance: Error of the interpolated pressure half-way between rows, relative to the
                pressure there, or to a hundredth of the largest on any patch where that is more.
        """
        first = min(self.model.first_touch, approach_end)
        rows = self.rows(np.linspace(first, approach_end, _FIRST_ROWS, dtype=np.float64))
        rows[0, 2:] = 0.0  # whatever round-off makes of first touch
        halfway = 0.5 * (rows[:-1, 0, 0] + rows[1:, 0, 0])
        errors = np.zeros(self.patches.count)
        while halfway.size and len(rows) < _MOST_ROWS:
            new = self.rows(halfway)
            error = self._errors(self._made(rows), new)
            bad = error.max(axis=1) > tolerance
            errors = np.maximum(errors, error[~bad].max(axis=0, initial=0.0))
            rows = np.concatenate((rows, new))
            rows = rows[np.argsort(rows[:, 0, 0])]
            halfway = _around(rows[:, 0, 0], new[bad, 0, 0])
            missed = error.max(axis=0)
        if halfway.size:
            errors = np.maximum(errors, missed)
        made = zip(self._made(rows), errors, strict=True)
        return tuple(replace(law, interpolation_error=float(error)) for law, error in made)

    def _errors(self, laws: list[PatchLaw], new: Array) -> Array:
        """Return the errors of laws at new rows, shape (n, N)."""
        largest = max((law.pressure[-1] for law in laws if not law.is_open), default=0.0)
        scale = np.maximum(new[:, 2], _LEAST_SCALE * max(float(largest), float(new[:, 2].max())))
        made = [law.along(new[:, 0, index]).pressure for index, law in enumerate(laws)]
        missing = np.abs(np.column_stack(made) - new[:, 2])
        return np.divide(missing, scale, out=np.zeros_like(missing), where=scale > 0.0)

    def _made(self, rows: Array) -> list[PatchLaw]:
        """Return the laws through rows."""
        reach = self.model.datum - self.mean_heights
        return [_law(rows[:, :, index], float(reach[index])) for index in range(len(reach))]


def consistent_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    approach_end: float,
    tolerance: float = 1e-4,
    comm: Any = None,
) -> LawTable:
    """Tabulate the laws of all patches of one surface that is pressed as a whole.

    On a block whose compliance is that of the half-space they give back the solution they were
    made from, whatever the partition.

    Args:
        model: Micro model of the whole surface.
        patches: Its partition.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        approach_end: Largest local approach that the laws will be asked for [mm].
        tolerance: Interpolation error of the pressure, see `WholeSurface.laws`.
        comm: MPI communicator.

    Returns:
        All laws, on every rank.

    Note:
        Collective.
    """
    whole = WholeSurface(
        model=model,
        patches=patches,
        mean_heights=mean_heights,
        compliance=influence_matrix(patches) / (np.pi * model.contact_modulus),
    )
    return LawTable(
        patches=patches,
        laws=on_root(comm, lambda: whole.laws(approach_end, tolerance)),
        made_by={"coupling": "consistent", "model": model.name, "tolerance": f"{tolerance:g}"},
    )


def _law(rows: Array, reach: float) -> PatchLaw:
    """Return the law of one patch through rows of its own, shape (n, 6)."""
    loaded = np.flatnonzero(rows[:, 2] > 0.0)
    if not loaded.size:
        touch = float(rows[-1, 1])  # not touched as far as the table goes
        rows = rows[:0]
    else:
        rows = _from_touch(rows, int(loaded[0]))
        touch = float(rows[0, 1])
    return PatchLaw(
        approach=rows[:, 0],
        closure=rows[:, 1],
        pressure=rows[:, 2],
        contact_area_fraction=rows[:, 3],
        contacts=rows[:, 4].astype(np.int64),
        relief=rows[:, 5],
        touch=touch,
        reach=reach,
    )


def _from_touch(rows: Array, first: int) -> Array:
    """Begin rows at first touch, where p^(2/3) goes to zero, and keep those that rise."""
    rows, before = rows[first:], rows[max(first - 1, 0)]
    highest = np.maximum.accumulate(rows[:, 2])
    rows = rows[np.concatenate(([True], highest[1:] > highest[:-1]))]
    touch = before.copy()
    if len(rows) > 1:
        root = rows[:2, 2] ** (2 / 3)
        straight = rows[0, 0] - root[0] * (rows[1, 0] - rows[0, 0]) / (root[1] - root[0])
        share = (straight - before[0]) / (rows[0, 0] - before[0]) if first else 1.0
        touch = before + np.clip(share, 0.0, 1.0 - 1e-6) * (rows[0] - before)
    touch[2:5] = 0.0
    return np.vstack((touch, rows))


def _around(points: Array, centres: Array) -> Array:
    """Return the middles of the intervals on either side of some of the points."""
    index = np.searchsorted(points, centres)
    return np.unique(
        np.concatenate((points[index - 1] + points[index], points[index] + points[index + 1])) / 2
    )
