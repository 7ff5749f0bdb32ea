"""Makes the consistent patch laws: all of them from one solution of the whole surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.patches import PatchGrid
from micro import MicroModel, influence_matrix
from multiscale.law_tables.law_files import LawTable
from multiscale.law_tables.refinement import MOST_ROWS
from multiscale.law_tables.spread import Sinking
from multiscale.law_tables.whole_surface import WholeSurface

Array = NDArray[np.float64]


def consistent_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    approach_end: float,
    tolerance: float = 1e-3,
    most_rows: int = MOST_ROWS,
    tilt: tuple[float, float] = (0.0, 0.0),
    sinking: Sinking | None = None,
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
        approach_end: Largest approach at the middle that the laws will be asked for [mm];
            patches that are not touched up to it are open.
        tolerance: Interpolation error of the force, see `refinement.refined`.
        most_rows: Rows that are solved at most.
        tilt: Slopes of the plane that presses the surface; laws serve other planes less well.
        sinking: What the block that the laws are for sinks more than a half-space. Where its
            rectangles divide the patches, the table then tells where the contacts are; smaller
            patches tell so themselves.
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
        compliance=np.divide(influence_matrix(patches), np.pi * model.contact_modulus),
        tilt=tilt,
        sinking=sinking,
    )
    laws, error, spread = on_root(comm, lambda: whole.tabulated(approach_end, tolerance, most_rows))
    return LawTable(
        patches=patches,
        laws=tuple(laws),
        made_by={
            "coupling": "consistent",
            "model": model.name,
            "love": "mean",
            "tolerance": f"{tolerance:g}",
            "tilt": f"{tilt[0]:g}, {tilt[1]:g}",
        },
        force_error=error,
        spread=spread,
    )
