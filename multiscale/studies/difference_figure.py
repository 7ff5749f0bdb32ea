"""The figure of two runs: their curves over each other, and ratios with error bars."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from multiscale.figures.curves import draw_path
from multiscale.figures.style import BLUE, GREEN, ORANGE, VERMILLION, panels, show_unit, styled
from multiscale.studies.difference import Difference

_SHOWN = ("approach_mm", "mean_pressure_MPa", "contact_area_fraction", "mean_separation_mm")
"""Quantities whose ratios are drawn, where both runs know them."""
_COLOURS = dict(zip(_SHOWN, ("0.1", "0.1", GREEN, ORANGE), strict=True))


@styled()
def difference_figure(both: Difference) -> Figure:
    """Draw mean pressure, contact area and separation of both runs, and ratios over the load.

    Curves are dashed where the load falls.

    Args:
        both: The two runs.
    """
    figure, (force, area, gap, ratios) = panels(2, 2, 5.2)
    colours, marks = (BLUE, VERMILLION), "os"
    for history, name, colour, mark in zip(both.histories, both.names, colours, marks, strict=True):
        look: dict[str, Any] = {"color": colour, "label": name}
        if len(history) <= 100:
            look |= {"marker": mark, "ms": 3.0}
        pressure, falls = history.mean_pressure_MPa, history.unloading
        draw_path(force, 1e3 * history.approach_mm, pressure, falls, look)
        draw_path(area, pressure, 100 * history.contact_area_fraction, falls, look)
        draw_path(gap, 1e3 * history.mean_separation_mm, pressure, falls, look)
    pressures, approaches, gaps = (
        np.concatenate([getattr(history, name) for history in both.histories])
        for name in ("mean_pressure_MPa", "approach_mm", "mean_separation_mm")
    )
    area.set(ylabel="contact area fraction [%]")
    for axis in (force.yaxis, area.xaxis, gap.yaxis):
        show_unit(axis, "mean pressure", "MPa", pressures)
    show_unit(force.xaxis, "approach", "mm", approaches, 1e-3)
    show_unit(gap.xaxis, "mean separation", "mm", gaps, 1e-3)
    gap.locator_params(axis="x", nbins=6)
    force.legend()
    _draw_ratios(ratios, both)
    return figure


def _draw_ratios(axes: Any, both: Difference) -> None:
    """Draw ratios over the load that both have in common, with error bars where these are known."""
    at_pressure = both.at == "pressure"
    load = both.loads if at_pressure else 1e3 * both.loads
    axes.axhline(1.0, color="0.7", lw=0.8)
    shown = [one for one in both.ratios if one.name in _SHOWN]
    for one, mark in zip(shown, "osD^", strict=False):
        look = {"color": _COLOURS[one.name], "marker": mark, "ms": 3.0, "label": one.text}
        axes.plot(load, one.ratio, **look)
        known = np.isfinite(one.error) & (one.error > 0.0)
        bars = {"fmt": "none", "ecolor": _COLOURS[one.name], "capsize": 2.0}
        axes.errorbar(load[known], one.ratio[known], one.error[known], **bars)
    text, unit, drawn = ("mean pressure", "MPa", 1.0) if at_pressure else ("approach", "mm", 1e-3)
    show_unit(axes.xaxis, text, unit, both.loads, drawn)
    axes.set(ylabel="second over first", title=f"{both.names[1]} over {both.names[0]}")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.18 * len(shown) * (high - low))  # for the legend
    axes.legend(loc="upper left")
