"""The figure of a sweep: curves of cases, with mean, median and band of every ensemble."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.figures.style import FULL_WIDTH, PALETTE, add_legend, new_figure, styled
from multiscale.sweeps.statistics import Statistics

MOST_CURVES = 200
"""Cases that are drawn as curves; bands show those beyond."""

MOST_ENSEMBLES = 8
"""Ensembles that are drawn; more of them cannot be told apart."""


class Ensemble(NamedTuple):
    """Cases that differ in seed or file alone: statistics of all, and the curves of some.

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


CURVES = "approach_mm", "mean_pressure_MPa", "contact_area_fraction"
"""Columns of the curves of an `Ensemble`."""


@styled()
def sweep_figure(ensembles: Sequence[Ensemble]) -> Figure:
    """Draw mean pressure over approach, and contact area over mean pressure.

    Thin curves are single cases. A thick curve is the mean of an ensemble, a broken one its median,
    and the band about them holds the middle 90 % of its cases where all were pressed to the same
    approaches.

    Args:
        ensembles: The curves; those beyond `MOST_ENSEMBLES` are left out.
    """
    figure = new_figure(FULL_WIDTH, 3.0)
    force, area = figure.subplots(1, 2)
    for colour, ensemble in zip(cycle(PALETTE), ensembles[:MOST_ENSEMBLES], strict=False):
        x, y, a = 1e3 * ensemble.approach, ensemble.pressure, 100 * ensemble.area_fraction
        for row in range(len(x)):
            force.plot(x[row], y[row], color=colour, lw=0.5, alpha=0.4)
            area.plot(y[row], a[row], color=colour, lw=0.5, alpha=0.4)
        of, many = ensemble.statistics.of, ensemble.total > 1
        approach, pressure, fraction = (of(name, "mean") for name in CURVES)
        label = ", ".join(filter(None, (ensemble.label, f"mean of {ensemble.total}" * many)))
        force.plot(1e3 * approach, pressure, color=colour, lw=2.0, label=label)
        area.plot(pressure, 100 * fraction, color=colour, lw=2.0)
        low, high = of(CURVES[0], "smallest"), of(CURVES[0], "largest")
        if many and (high - low).max() < 1e-9 * high.max():
            name = CURVES[1]
            force.plot(1e3 * approach, of(name, "median"), color=colour, lw=1.2, ls="--")
            band = of(name, "low"), of(name, "high")
            force.fill_between(1e3 * approach, *band, color=colour, alpha=0.2)
    force.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]")
    add_legend(figure)
    return figure
