"""Figures of sweeps, of comparisons of models, and of two runs beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.curves import (
    draw_over_pressure,
    draw_points,
    draw_response,
    label_response,
)
from patchlaw.multiscale.results.run_curves import over_pressure
from patchlaw.support.readable import shown_unit

PALE = 0.4
"""Opacity of single cases, and of configurations that another one beats in time and error."""

LEAST_ERROR = 1e-5
"""Smaller errors are drawn here."""

LEAST_SHARE = 0.2
"""Errors below this share of the error bar are drawn there: they cannot be told apart."""

_PLAIN: dict[str, Any] = {"ms": 5.0, "zorder": 4, "ls": "none"}
_RING = _PLAIN | {"mec": "0.1", "mew": 1.1, "ms": 7.5, "zorder": 5}
_BEATEN = _PLAIN | {"mew": 0.0, "alpha": PALE, "zorder": 3}
_NUMBER: dict[str, Any] = {"fontsize": 7, "fontweight": "bold", "color": "0.1", "zorder": 6}
_NUMBER |= {"xytext": (-8.0, -9.0), "textcoords": "offset points"}


_SHOWN = ("approach_mm", "mean_pressure_MPa", "contact_area_fraction", "mean_separation_mm")
"""Quantities whose ratios are drawn, where both runs know them."""
_COLOURS = dict(zip(_SHOWN, ("0.1", "0.1", style.GREEN, style.ORANGE), strict=True))


@style.styled()
def sweep_figure(sweep: Any) -> Figure:
    """Draw mean pressure over approach, and contact area over mean pressure.

    Thin curves are single cases. A thick curve is the mean of an ensemble, a broken one the median
    of a single one, and the band about them holds the middle 90 % of its cases: of pressures where
    all were pressed to the same approaches, of approaches where all were pressed by the same
    forces.

    Args:
        sweep: A `multiscale.runs.sweep.SweepResults`, of which 8 ensembles are drawn.
    """
    ensembles = sweep.ensembles()[:8]  # more cannot be told apart
    several = len(ensembles) > 1
    below = 0.5 + 0.17 * len(ensembles) * several
    figure, (force, area) = style.panels(1, 2, 2.55 + below, below=below)
    looks = zip(cycle(style.PALETTE), cycle("osD^vPX*"))  # eight at most
    for (colour, mark), (values, part), (_, statistics) in zip(
        looks, ensembles, sweep.statistics, strict=False
    ):
        few = slice(200 // len(ensembles))  # the band shows those beyond
        approach, pressure = 1e3 * part.approach_mm[few], part.mean_pressure_MPa[few]
        look: dict[str, Any] = {"color": colour}
        if approach.shape[1] <= 50:
            look |= {"marker": mark, "ms": 4.0}
        thin = (look | {"marker": ""} if several else look) | {"lw": 0.5, "alpha": PALE}
        force.plot(approach.T, pressure.T, **thin)
        area.plot(pressure.T, 100.0 * part.contact_area_fraction[few].T, **thin)
        many = len(part) > 1
        label = ", ".join(filter(None, (_label(values), f"mean of {len(part)}" * many)))
        mean = _read_off(statistics, "mean")
        force.plot(*mean[:2], lw=2.0, label=label, **look)
        area.plot(*mean[1:], lw=2.0, **look)
        if many:
            _draw_scatter(force, statistics, colour, with_median=not several)
    label_response((force, area), [part for _, part in ensembles])
    if len(sweep) > len(ensembles):
        median = "" if several else "dashed: median; "
        force.set_title(f"thick: mean{'s' * several}; {median}band{'s' * several}: middle 90 %")
        area.set_title(f"thick: mean{'s' * several}; thin: single cases")
    if several:
        figure.legend(*force.get_legend_handles_labels(), loc="lower center")
    return figure


def _label(values: Mapping[str, Any]) -> str:
    """Return the values of keys as a legend shows them, without sections and folders."""
    names = {key: key.rpartition(".")[2].replace("_", " ") for key in values}
    label = ", ".join(
        Path(value).name
        if names[key] in ("file", "mesh")
        else f"{names[key]} {value}".replace(" um", " µm")
        for key, value in values.items()
    )
    return style.literal(label)


def _read_off(statistics: Any, name: str) -> list[np.ndarray[Any, Any]]:
    """Return a number of approaches [µm], mean pressures [MPa] and area fractions [%]."""
    drawn = {"approach_mm": 1e3, "mean_pressure_MPa": 1.0, "contact_area_fraction": 100.0}
    return [scale * statistics.of(column, name) for column, scale in drawn.items()]


def _draw_scatter(axes: Any, statistics: Any, colour: str, *, with_median: bool) -> None:
    """Draw the band of an ensemble whose cases share their approaches or their pressures."""
    mean, median, low, high, least, most = (
        _read_off(statistics, name)
        for name in ("mean", "median", "low", "high", "smallest", "largest")
    )
    shared = [bool((most[k] - least[k]).max() <= 1e-9 * np.abs(mean[k]).max()) for k in (0, 1)]
    if shared[0] == shared[1]:
        return
    x, y = (mean[0], median[1]) if shared[0] else (median[0], mean[1])
    if with_median:
        axes.plot(x, y, color=colour, lw=1.2, ls="--")
    along, across = (axes.fill_between, 1) if shared[0] else (axes.fill_betweenx, 0)
    along(mean[1 - across], low[across], high[across], color=colour, alpha=0.15)
    if len(x) == 1:  # of which a band would be nothing
        lines = axes.vlines if shared[0] else axes.hlines
        lines(mean[1 - across], low[across], high[across], color=colour, lw=1.0)


@style.styled()
def comparison_figure(comparison: Any) -> Figure:
    """Draw errors of the response, the contact area and the pressure distribution over time.

    The frontier is drawn and its configurations have the numbers of their rows; those that another
    one beats are pale. The uncertainty of the measure is a band: errors within it cannot be told
    apart.

    Args:
        comparison: A `multiscale.runs.comparison.Comparison` with a measure.
    """
    response = comparison.response
    titles = {
        f"{response}_max": f"{response}, over the curve",
        "area_max": "contact area, over the curve",
        "distribution": "distribution of pressures",
    }
    figure, axes = style.panels(1, 3, 3.8, below=0.85)
    for one, (error, title) in zip(axes, titles.items(), strict=True):
        _draw_errors(one, comparison, error)
        one.set_title(title)
    axes[0].set_ylabel("error [% of the measure]")
    kinds = axes[0].get_legend_handles_labels()
    figure.legend(*kinds, loc="lower center", ncol=len(kinds[0]))
    return figure


def _draw_errors(axes: Any, comparison: Any, error: str) -> None:
    """Draw one panel of errors over time."""
    frontier, bar = comparison.frontier(error), comparison.uncertainty[error]
    least = max(LEAST_ERROR, np.nan_to_num(LEAST_SHARE * bar))
    kinds = dict.fromkeys(row.kind for row in comparison.rows)
    for kind in kinds:
        axes.plot([], [], style.MARKERS[kind], color=style.COLOURS[kind], label=kind, **_PLAIN)
    for number, row in enumerate(comparison.rows, 1):
        # the error of the measure is its own uncertainty
        size = 100.0 * float(np.maximum(abs(row.errors[error]), least))
        ahead = row in frontier or row.is_measure
        look = _RING if row.is_measure else _PLAIN if ahead else _BEATEN
        axes.plot(row.seconds, size, style.MARKERS[row.kind], color=style.COLOURS[row.kind], **look)
        if ahead and np.isfinite((row.seconds, size)).all():
            axes.annotate(str(number), (row.seconds, size), **_NUMBER)
    axes.set(xscale="log", yscale="log", xlabel="wall time [s]")
    axes.margins(0.15)
    axes.autoscale_view()
    axes.autoscale(False)
    style.logarithmic(axes.xaxis)
    style.logarithmic(axes.yaxis)
    if np.isfinite(bar) and bar > 0.0:
        axes.axhspan(1e-3 * axes.get_ylim()[0], 100.0 * bar, **style.ERROR_BAND)
    if frontier:
        times = [*(row.seconds for row in frontier), axes.get_xlim()[1]]
        steps = [100.0 * max(comparison.error(row, error), LEAST_ERROR) for row in frontier]
        axes.step(times, [*steps, steps[-1]], where="post", color="0.25", lw=1.2)


@style.styled()
def difference_figure(both: Any) -> Figure:
    """Draw mean pressure, contact area and separation of both runs, and ratios over the load.

    Points are hollow, and curves dashed, where the load falls.

    Args:
        both: A `multiscale.runs.difference.Difference`.
    """
    figure, (*panels, ratios) = style.panels(2, 2, 5.2)
    colours, marks = (style.BLUE, style.VERMILLION), "os"
    for history, name, colour, mark in zip(both.histories, both.names, colours, marks, strict=True):
        look: dict[str, Any] = {"color": colour, "label": style.literal(name), "marker": mark}
        draw_response(panels, history, look)
    label_response(panels, both.histories)
    panels[2].locator_params(axis="x", nbins=6)
    panels[0].legend()
    _draw_ratios(ratios, both)
    return figure


@style.styled()
def difference_over_pressure_figure(both: Any) -> Figure:
    """Draw stiffness, conductance, area and gap of both runs over the pressure, and their ratios.

    Args:
        both: A `multiscale.runs.difference.Difference` at equal pressures.
    """
    sides = [{one.quantity: one for one in over_pressure(history)} for history in both.histories]
    shared = [quantity for quantity in sides[0] if quantity in sides[1]]
    figure, axes = style.panel_grid(len(shared), 2.1, title=" ", each=2)
    looks = [
        {"color": colour, "label": style.literal(name), "marker": mark}
        for colour, name, mark in zip((style.BLUE, style.VERMILLION), both.names, "os", strict=True)
    ]
    for quantity, upper, lower in zip(shared, axes[::2], axes[1::2], strict=True):
        draw_over_pressure(upper, [side[quantity] for side in sides], both.histories, looks)
        ratio = both.of(quantity.name)
        name, size = shown_unit(np.concatenate([side[quantity].pressure for side in sides]), "MPa")
        known = np.isfinite(ratio.ratio)
        lower.axhline(1.0, color="0.7", lw=0.8)
        look = {"color": style.INK, "label": "", "marker": "D"}
        none = np.zeros(len(known), bool)
        draw_points(lower, both.loads / size, ratio.ratio, (None, ratio.error), none, known, look)
        lower.set(xscale="log", xlim=np.array(upper.get_xlim()), ylabel="second over first")
        lower.set(xlabel=f"mean pressure [{name}]")
        style.logarithmic(lower.xaxis)
    style.legend_above(figure)
    return figure


def _draw_ratios(axes: Any, both: Any) -> None:
    """Draw ratios over the load that both have in common, with error bars where these are known."""
    load = both.loads / style.DRAWN.get(both.load.unit, 1.0)
    axes.axhline(1.0, color="0.7", lw=0.8)
    shown = [one for one in both.ratios if one.name in _SHOWN]
    for one, mark in zip(shown, "osD^", strict=False):
        look = {"color": _COLOURS[one.name], "marker": mark, "label": one.text}
        axes.plot(load, one.ratio, color=look["color"])
        known = np.isfinite(one.ratio)
        draw_points(axes, load, one.ratio, (None, one.error), np.zeros_like(known), known, look)
    style.show_unit(axes.xaxis, both.load.text, both.load.unit, both.loads)
    axes.set(
        ylabel="second over first", title=style.literal(f"{both.names[1]} over {both.names[0]}")
    )
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.18 * len(shown) * (high - low))  # for the legend
    axes.legend(loc="upper left")
