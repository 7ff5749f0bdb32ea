"""The figure of a sweep: curves of cases, with mean, median and band of every ensemble."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.figures.style import FULL_WIDTH, PALETTE, add_legend, new_figure, styled
from multiscale.sweeps.statistics import Statistics

Array = NDArray[np.float64]

MOST_CURVES = 200
"""Cases that are drawn as curves; bands show those beyond."""

MOST_ENSEMBLES = 8
"""Ensembles that are drawn; more of them cannot be told apart."""


class Ensemble(NamedTuple):
    """Cases that differ in seed alone: statistics of all, and the curves of some.

    Attributes:
        label: What the cases have in common; empty for nothing.
        total: Number of all cases.
        statistics: Of all cases that ended well.
        approach: Approaches of some cases, shape (cases, steps) [mm].
        pressure: Their mean pressures [MPa].
        area_fraction: Their real over nominal contact areas.
    """

    label: str
    total: int
    statistics: Statistics
    approach: NDArray[np.float64]
    pressure: NDArray[np.float64]
    area_fraction: NDArray[np.float64]


_SHARED = 1e-9
"""Spread of values of all cases, relative to their mean, that is rounding."""

CURVES = "approach_mm", "mean_pressure_MPa", "contact_area_fraction"
"""Columns of the curves of an `Ensemble`."""


_POINTS = {"marker": "o", "ms": 4.0}
"""Style of curves of one load step, which are points."""


@styled()
def sweep_figure(ensembles: Sequence[Ensemble]) -> Figure:
    """Draw mean pressure over approach, and contact area over mean pressure.

    Thin curves are single cases. A thick curve is the mean of an ensemble, a broken one its median,
    and the band about them holds the middle 90 % of its cases: of pressures where all were pressed
    to the same approaches, of approaches where all were pressed by the same forces.

    Args:
        ensembles: The curves; those beyond `MOST_ENSEMBLES` are left out.
    """
    figure = new_figure(FULL_WIDTH, 3.0)
    force, area = figure.subplots(1, 2)
    for colour, ensemble in zip(cycle(PALETTE), ensembles[:MOST_ENSEMBLES], strict=False):
        x, y, a = 1e3 * ensemble.approach, ensemble.pressure, 100 * ensemble.area_fraction
        points: dict[str, Any] = _POINTS if x.shape[1] == 1 else {}
        for row in range(len(x)):
            force.plot(x[row], y[row], color=colour, lw=0.5, alpha=0.4, **points)
            area.plot(y[row], a[row], color=colour, lw=0.5, alpha=0.4, **points)
        many = ensemble.total > 1
        approach, pressure, fraction = _numbers(ensemble, "mean")
        label = ", ".join(filter(None, (ensemble.label, f"mean of {ensemble.total}" * many)))
        force.plot(approach, pressure, color=colour, lw=2.0, label=label, **points)
        area.plot(pressure, fraction, color=colour, lw=2.0, **points)
        if many:
            _draw_scatter(force, ensemble, colour)
    force.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]")
    add_legend(figure)
    return figure


def _numbers(ensemble: Ensemble, name: str) -> Array:
    """Return a number of approaches [µm], pressures [MPa], area fractions [%], shape (3, steps)."""
    scales = (1e3, 1.0, 100.0)
    of = ensemble.statistics.of
    return np.array(
        [scale * of(column, name) for scale, column in zip(scales, CURVES, strict=True)]
    )


def _draw_scatter(axes: Any, ensemble: Ensemble, colour: str) -> None:
    """Draw the band of an ensemble whose cases share their approaches or their pressures."""
    mean, median = _numbers(ensemble, "mean"), _numbers(ensemble, "median")
    low, high = _numbers(ensemble, "low"), _numbers(ensemble, "high")
    spread = _numbers(ensemble, "largest") - _numbers(ensemble, "smallest")
    shared = [
        bool(one.max() <= _SHARED * np.abs(of).max()) for one, of in zip(spread, mean, strict=True)
    ]
    if shared[0] == shared[1]:
        return
    x, y = (mean[0], median[1]) if shared[0] else (median[0], mean[1])
    axes.plot(x, y, color=colour, lw=1.2, ls="--")
    along, across = (axes.fill_between, 1) if shared[0] else (axes.fill_betweenx, 0)
    along(mean[1 - across], low[across], high[across], color=colour, alpha=0.2)
    if len(x) == 1:  # of which a band would be nothing
        lines = axes.vlines if shared[0] else axes.hlines
        lines(mean[1 - across], low[across], high[across], color=colour, lw=1.0)
