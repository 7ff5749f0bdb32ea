"""Makes the consistent patch laws: all of them from one solution of the whole surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from micro import MicroModel, influence_matrix
from multiscale.laws.files import LawTable
from multiscale.laws.refinement import MOST_ROWS
from multiscale.laws.whole_surface import Displacements, WholeSurface

Array = NDArray[np.float64]

_GENTLE = 1e-6
"""Share of the largest force under which a plane that is free to turn is nearly at first touch; by
Hertz it has then come a ten thousandth of its way."""
_RESERVE = 0.02
"""Rows beyond the largest load, of the way from first touch: what lies between rows may ask."""
_POINTWISE = 0.5
"""The same of laws that hold at points: where a patch sinks less than in its mean, closures are
larger than any row's. On eight scenes of the paper's recipe (1 to 64 patches, level and tilted, on
a cube and a column) 0.02 ended seven, 0.25 two and 0.5 none."""


def consistent_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    largest: Control,
    displacements: Displacements | None = None,
    pointwise: bool = False,
    tolerance: float = 1e-3,
    most_rows: int = MOST_ROWS,
    comm: Any = None,
) -> LawTable:
    """Tabulate the laws of all patches of one surface that is pressed as a whole.

    In the macro model whose displacements they were made with they give back the solution they
    were made from, whatever the partition: to rounding at their rows, and between them to the
    error that the table states. Where the plane is free to turn, rows follow it as it turns.

    Args:
        model: Micro model of the whole surface, on the body that the laws are for.
        patches: Its partition.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        largest: The largest load that the laws will be asked for; patches that are not touched up
            to it are open.
        displacements: Mean displacements of the patches by their pressures in the macro model;
            those of a half-space when not given. Collective.
        pointwise: Whether the macro model asks for pressures at points, beyond the rows' means.
        tolerance: Interpolation error of the force, see `refinement.refined`.
        most_rows: Rows that are solved at most.
        comm: MPI communicator, whose ranks share the rows. The table does not depend on their
            number.

    Returns:
        All laws, on every rank.

    Raises:
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    means = np.asarray(mean_heights, dtype=float)
    compliance = np.divide(influence_matrix(patches), np.pi * model.contact_modulus)
    whole = WholeSurface(
        model=model,
        patches=patches,
        mean_heights=means,
        displacements=displacements or (lambda pressures: pressures @ compliance.T),
        tilt=largest.tilt,
        comm=comm,
    )

    def ends() -> tuple[float, float, tuple[float, float]]:
        force, end, start = 0.0, largest, None
        if largest.approach is None or largest.tilt is None:
            response, plane, start = model.press(largest, patches=patches, mean_heights=means)
            end = Control(approach=plane.approach, tilt=plane.tilt)
            force = float(response.force[0])
        # without force a plane may turn as it likes
        touch = Control(force=_GENTLE * force if largest.tilt is None else 0.0, tilt=largest.tilt)
        touched = model.press(touch, patches=patches, mean_heights=means, start=start)
        first, last = touched.plane.approach, float(end.approach or 0.0)
        if touch.force:
            first -= _GENTLE ** (2 / 3) * (last - first)
        return first, last, end.tilt or (0.0, 0.0)

    first, end, tilt = on_root(comm, ends)
    reserve = _POINTWISE if pointwise else _RESERVE
    laws, error = whole.tabulated(
        first,
        end + reserve * max(end - first, 0.0),
        compliance=compliance,
        tolerance=tolerance,
        most_rows=most_rows,
    )
    return LawTable(
        patches=patches,
        laws=tuple(laws),
        made_by={
            "coupling": "consistent",
            "model": model.name,
            "love": "mean",
            "tolerance": f"{tolerance:g}",
            "tilt": "free" if largest.tilt is None else f"{tilt[0]:g}, {tilt[1]:g}",
        },
        force_error=error,
        path=whole.path if largest.tilt is None else None,
    )
