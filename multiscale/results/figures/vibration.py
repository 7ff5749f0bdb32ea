"""The first natural modes about a load step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from patchlaw.multiscale.readable import quantity
from patchlaw.multiscale.results.figures.style import FULL_WIDTH, new_figure, styled
from patchlaw.support.arrays import Array

_SHARE = 0.12
"""Largest displacement that is drawn, over the size of the bodies."""
_VIEW = {"elev": 22.0, "azim": -60.0}


@styled()
def modes_figure(rows: Sequence[Any], surfaces: Sequence[tuple[Array, Array]], load: Any) -> Figure:
    """Draw bodies as they move in their first modes, coloured by how far.

    Args:
        rows: A `multiscale.loading.column.Mode` each.
        surfaces: Of every body corners of its facets, shape (n, corners, 3) [mm], and their
            displacements in the modes, shape (modes, n, corners, 3).
        load: A `multiscale.results.history.History`.
    """
    columns = min(3, len(rows))
    lines = -(-len(rows) // columns)
    figure = new_figure(FULL_WIDTH * columns / 3.0, 2.3 * lines)
    corners = np.concatenate([places.reshape(-1, 3) for places, _ in surfaces])
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    size = float(np.linalg.norm(upper - lower))
    lower, upper = lower - _SHARE * size, upper + _SHARE * size
    for k, row in enumerate(rows):
        axes: Any = figure.add_subplot(lines, columns, k + 1, projection="3d")
        largest = max(float(abs(moved[k]).max(initial=0.0)) for _, moved in surfaces) or 1.0
        for places, moved in surfaces:
            far = np.linalg.norm(moved[k], axis=-1).mean(axis=-1) / largest
            drawn = Poly3DCollection(
                places + _SHARE * size / largest * moved[k],
                facecolors=colormaps["viridis"](np.clip(far, 0.0, 1.0)),
                edgecolors="none" if len(places) > 3000 else "0.25",
                linewidths=0.15,
                rasterized=True,
            )
            axes.add_collection3d(drawn)
        axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
        axes.set_box_aspect(upper - lower, zoom=1.2)
        axes.view_init(**_VIEW)
        axes.set_axis_off()
        grows = f", grows by {-row.damping_per_s:.3g} 1/s" if row.damping_per_s < 0.0 else ""
        axes.set_title(f"mode {row.mode}: {quantity(row.frequency_Hz, 'Hz', 4)}{grows}")
    about = f"modes about load step {load.steps[-1].step}"
    figure.suptitle(f"{about}; yellow moves most, dark violet not at all")
    return figure
