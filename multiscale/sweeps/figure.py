"""The figure of a sweep: the curves of all cases, with mean and band of every ensemble."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.figures.style import FULL_WIDTH, PALETTE, add_legend, new_figure, styled

MOST_CURVES = 200
"""Cases that are drawn as curves; bands show those beyond."""

MOST_ENSEMBLES = 8
"""Ensembles that are drawn; more of them cannot be told apart."""

_BAND = (0.05, 0.95)  # quantiles


class Ensemble(NamedTuple):
    """The curves of cases that differ in seed or file alone; arrays of shape (cases, steps).

    Attributes:
        label: What the cases have in common; empty for nothing.
        approach: Approaches [mm].
        pressure: Mean pressures [MPa].
        area_fraction: Real over nominal contact areas.
    """

    label: str
    approach: NDArray[np.float64]
    pressure: NDArray[np.float64]
    area_fraction: NDArray[np.float64]


@styled()
def sweep_figure(ensembles: Sequence[Ensemble]) -> Figure:
    """Draw mean pressure over approach, and contact area over mean pressure.

    Thin curves are single cases. A thick curve is the mean of an ensemble, and the band about it
    holds the middle 90 % of its cases where all were pressed to the same approaches.

    Args:
        ensembles: The curves; those beyond `MOST_ENSEMBLES` are left out.
    """
    figure = new_figure(FULL_WIDTH, 3.0)
    force, area = figure.subplots(1, 2)
    shown = ensembles[:MOST_ENSEMBLES]
    for colour, ensemble in zip(cycle(PALETTE), shown, strict=False):
        x, y, a = 1e3 * ensemble.approach, ensemble.pressure, 100 * ensemble.area_fraction
        for row in range(min(len(x), MOST_CURVES // len(shown))):
            force.plot(x[row], y[row], color=colour, lw=0.5, alpha=0.4)
            area.plot(y[row], a[row], color=colour, lw=0.5, alpha=0.4)
        label = ", ".join(filter(None, (ensemble.label, f"mean of {len(x)}" * (len(x) > 1))))
        force.plot(x.mean(axis=0), y.mean(axis=0), color=colour, lw=2.0, label=label)
        area.plot(y.mean(axis=0), a.mean(axis=0), color=colour, lw=2.0)
        if len(x) > 1 and np.ptp(x, axis=0).max() < 1e-9 * x.max():
            low, high = np.quantile(y, _BAND, axis=0)
            force.fill_between(x[0], low, high, color=colour, alpha=0.2)
    force.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]")
    add_legend(figure)
    return figure
