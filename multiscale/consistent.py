"""Makes the consistent patch laws: one solution of the whole surface gives those of all patches."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.errors import InputError
from geometry.patches import PatchGrid
from micro import MicroModel
from micro.influence import influence_matrix
from multiscale.law_files import LawTable
from multiscale.laws import PatchLaw
from multiscale.refinement import law_of, refined

Array = NDArray[np.float64]

_FIRST_ROWS = 9


def consistent_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    approach_end: float,
    tolerance: float = 1e-3,
    comm: Any = None,
) -> LawTable:
    """Tabulate the laws of all patches out of the whole surface under a level plane.

    At the approach δ all patches press each other: c_i = δ − Σ_j Λ_ij p_j / (π E*), with Λ_ij the
    mean over patch i of Love's displacement by unit pressure on patch j. A half-space pressed
    through these laws gives the patch forces of the whole surface exactly at the rows.

    Args:
        model: Micro model of the whole surface.
        patches: Partition of the surface into N patches.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        approach_end: Largest approach that is solved [mm]; patches that are not touched up to it
            are open.
        tolerance: Interpolation error of the pressure, see `refinement.refined`; the rows are
            those of the patch that needs most.
        comm: MPI communicator; its first rank solves, each level of rows from low to high, so
            that every solution starts from its neighbour and the table is the same to the bit on
            any number of ranks.

    Returns:
        All laws, on every rank.

    Raises:
        InputError: When the approach does not reach the surface.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    means = np.asarray(mean_heights, dtype=float)
    if not approach_end > model.first_touch:
        raise InputError(
            "the laws' largest approach touches nothing",
            value=approach_end,
            allowed=f"more than {model.first_touch:.6g} mm",
        )
    reaches = model.datum - means
    influence = influence_matrix(patches) / (np.pi * model.contact_modulus)

    def make() -> tuple[PatchLaw, ...]:
        first = np.linspace(model.first_touch, approach_end, _FIRST_ROWS)
        solve = partial(_rows, model, patches, means, influence)
        return tuple(refined(solve, partial(_laws, reaches), first, tolerance))

    return LawTable(
        patches=patches,
        laws=on_root(comm, make),
        made_by={
            "coupling": "consistent",
            "model": model.name,
            "love": "mean",
            "tolerance": f"{tolerance:g}",
        },
    )


def _rows(
    model: MicroModel, patches: PatchGrid, means: Array, influence: Array, approaches: Array
) -> Array:
    """Return approach, closure, pressure, area fraction, contacts, relief, shape (m, N, 6)."""
    response = model.respond(approaches, patches=patches, mean_heights=means)
    pressure = response.patch_pressure
    displacement = pressure @ influence  # symmetric
    touched = pressure > 0.0
    columns = (
        np.broadcast_to(approaches[:, None], pressure.shape),
        approaches[:, None] - displacement,
        pressure,
        np.where(touched, response.patch_contact_area / patches.area, 0.0),
        np.where(touched, response.patch_contacts, 0),
        response.patch_displacement - displacement,
    )
    return np.stack(columns, axis=2)


def _laws(reaches: Array, rows: Array) -> list[PatchLaw]:
    return [_law(rows[:, i], float(reach)) for i, reach in enumerate(reaches)]


def _law(rows: Array, reach: float) -> PatchLaw:
    """Return the law of one patch out of all rows, those before its touch included."""
    touched = np.flatnonzero(rows[:, 2] > 0.0)
    if not touched.size:
        return law_of(rows[:0], float(rows[:, 1].max()), reach)
    first = int(touched[0])
    if first == 0:  # round-off at first touch of the whole surface
        rows = rows.copy()
        rows[0, 2:5] = 0.0
        return law_of(rows, float(rows[0, 1]), reach)
    start = _touch(rows[first - 1 :])
    return law_of(np.vstack((start, rows[first:])), float(start[1]), reach)


def _touch(rows: Array) -> Array:
    """Return the row of first touch, between an open row and the first one in contact.

    The straight line of p^(2/3) through the first two rows in contact tells the approach (Hertz'
    law); closure and relief are taken between the open row and the first in contact.
    """
    before, after = rows[:2]
    share = 0.0
    if len(rows) > 2:
        root, later = rows[1:3, 2] ** (2 / 3)
        if later > root:
            back = root / (later - root) * (rows[2, 0] - after[0])
            share = np.clip(1.0 - back / (after[0] - before[0]), 0.0, 0.99)
    start = before + share * (after - before)
    start[2:5] = 0.0
    return np.asarray(start)
