"""Curves: of load steps, of patch laws, of sweeps and comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from patchlaw.geometry.patches import PatchGrid
from patchlaw.multiscale.figures.style import (
    BLUE,
    COLOURS,
    ERROR_BAND,
    GREEN,
    MARKERS,
    NO_CONTACT,
    ORANGE,
    PALETTE,
    VERMILLION,
    add_legend,
    literal,
    map_axes,
    panels,
    place_colours,
    plain_logarithmic,
    show_unit,
    styled,
)


@styled()
def history_figure(history: Any, kind: str) -> Figure:
    """Draw force, contact area and mean separation of a run; dashed where the load falls.

    Args:
        history: A `multiscale.results.history.History`.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    figure, (force, area, gap) = panels(1, 3, 2.4)
    colour = COLOURS.get(kind, BLUE)
    look: dict[str, Any] = {"color": colour, "label": kind}
    if len(history) <= 500:
        look |= {"marker": "o", "ms": 3.0}
    pressure = np.append(0.0, history.mean_pressure_MPa)
    # The first touch of a tilted plane is not at that of the middle.
    level = not any(any(step.tilt) for step in history.steps)
    touch = -history.steps[0].zero_mm if level and len(history) else np.nan
    approach = 1e3 * np.append(touch, history.approach_mm)
    falls = history.unloading
    draw_path(force, approach, pressure, np.append(False, falls), look)
    share = 100 * np.append(0.0, history.contact_area_fraction)
    draw_path(area, pressure, share, np.append(False, falls), look)
    draw_path(gap, 1e3 * history.mean_separation_mm, history.mean_pressure_MPa, falls, look)
    if history.reference is not None:
        draw_error_band(force, area, history, colour=colour)
    label_response(force, area, gap, [history])
    add_legend(figure)
    return figure


def label_response(force: Any, area: Any, gap: Any, histories: Sequence[Any]) -> None:
    """Label axes of mean pressure, contact area and mean separation in units that suit all runs.

    Args:
        force: Axes of mean pressure over approach.
        area: Axes of contact area over mean pressure.
        gap: Axes of mean pressure over mean separation.
        histories: What is drawn.
    """
    pressures, approaches, gaps = (
        np.concatenate([getattr(history, name) for history in histories])
        for name in ("mean_pressure_MPa", "approach_mm", "mean_separation_mm")
    )
    area.set(ylabel="contact area fraction [%]")
    for axis in (force.yaxis, area.xaxis, gap.yaxis):
        show_unit(axis, "mean pressure", "MPa", pressures)
    show_unit(force.xaxis, "approach", "mm", approaches, 1e-3)
    show_unit(gap.xaxis, "mean separation", "mm", gaps, 1e-3)


def draw_path(axes: Any, x: Any, y: Any, falls: Any, look: dict[str, Any]) -> None:
    """Draw points along a path: where the load falls, dashed and with hollow markers.

    Args:
        axes: Axes to draw into.
        x: Abscissae of the n points.
        y: Their ordinates.
        falls: Whether the load falls to each point, shape (n,); it does not to the first.
        look: Look of the line, with its label.
    """
    turns = [0, *np.flatnonzero(np.diff(falls.astype(int))), len(x) - 1]
    # above the others, with which it may coincide
    falling = {"color": "0.6", "ls": "--", "mfc": "white", "label": "unloading", "zorder": 3}
    labelled = set()
    for start, end in pairwise(turns):
        here = look | (falling if falls[end] else {})
        if here["label"] in labelled:
            here["label"] = None
        labelled.add(here["label"])
        part = slice(start, end + 1)
        # a turning point is marked by the part that ends there
        axes.plot(x[part], y[part], markevery=slice(1 if start else 0, None), **here)


def draw_error_band(force: Any, area: Any, history: Any, *, colour: str) -> None:
    """Draw the error bands of a reference about its values at mesh size zero.

    Args:
        force: Axes of pressure [MPa] over approach [µm].
        area: Axes of the contact area fraction [%] over pressure [MPa]; None draws no band of it.
        history: The history of a reference.
        colour: Colour of the bands.
    """
    record = history.reference
    if record is None or len(record.sizes) == 1:
        force.plot([], [], " ", label="(no error bar)")
        return
    nominal = history.patches.area * history.patches.count
    pressure = record.force.value / nominal
    approach = 1e3 * record.approach.value
    look: dict[str, Any] = {"color": colour, "alpha": 0.25, "lw": 0.0}
    if record.by_force:
        error = 1e3 * record.approach.error
        force.fill_betweenx(
            pressure, approach - error, approach + error, label=record.label, **look
        )
    else:
        error = record.force.error / nominal
        force.fill_between(approach, pressure - error, pressure + error, label=record.label, **look)
    if area is not None:
        middle, error = 100 * record.area.value, 100 * record.area.error
        area.fill_between(pressure, middle - error, middle + error, **look)


@styled()
def law_figure(table: Any) -> Figure:
    """Draw pressure and area fraction of every law over closure, coloured by place on the face.

    Args:
        table: A `multiscale.laws.law_table.LawTable` of patches, which gets a key of their colours,
            or of regions, which get their names.
    """
    on_grid = isinstance(table.patches, PatchGrid) and table.patches.count > 1
    colours, names = _law_colours(table)
    closing = [index for index, law in enumerate(table.laws) if not law.is_open]
    few = len(closing) <= 36  # the dots of more would hide the curves
    what = "regions" if not isinstance(table.patches, PatchGrid) else "patches"
    rows = "; dots are their rows" if few else ""
    share = "" if len(closing) == table.patches.count else f"{len(closing)} of "
    title = f"laws of {share}{table.patches.count} {what}{rows}"
    if table.patches.count == 1:
        title = "the law and its rows"
    figure, (pressure, area, *key) = panels(1, 2 + on_grid, 2.7, title=title)
    for index in closing:
        law, look = table.laws[index], {"color": colours[index], "lw": 1.2 if few else 0.6}
        closure = np.linspace(law.range[0], law.range[1], 200)
        pressure.plot(1e3 * closure, law.at(closure).pressure, label=names[index], **look)
        area.plot(1e3 * closure, 100 * law.at(closure).contact_area_fraction, **look)
        if few:
            dots = 1e3 * law.rows.closure, law.rows.pressure
            pressure.plot(*dots, ".", ms=3, color=colours[index])
    ends = [table.laws[index].range[1] for index in closing]
    tops = [table.laws[index].rows.pressure[-1] for index in closing]
    area.set(ylabel="contact area fraction [%]")
    show_unit(pressure.yaxis, "mean pressure", "MPa", tops)
    for axes in (pressure, area):
        show_unit(axes.xaxis, "closure", "mm", ends, 1e-3)
    if key:
        _draw_places(key[0], table, colours)
    elif len(closing) > 1:
        pressure.legend()
    return figure


def _law_colours(table: Any) -> tuple[Any, list[str]]:
    """Return the colour of each law, by its place on the face or its region, and its name."""
    patches = table.patches
    if not isinstance(patches, PatchGrid):
        return [PALETTE[i % len(PALETTE)] for i in range(patches.count)], [
            literal(name) for name in patches.names
        ]
    if patches.count == 1:
        return [BLUE], [""]
    return place_colours(patches.centres / np.array(patches.lengths)), [""] * patches.count


def _draw_places(axes: Any, table: Any, colours: Any) -> None:
    """Draw the face with its patches in the colours of their laws; open ones are white."""
    patches = table.grid
    scale = map_axes(axes, patches.lengths)
    is_open = np.array([law.is_open for law in table.laws])
    shown = np.where(is_open[:, None], np.array(to_rgb(NO_CONTACT)), colours)
    borders = scale * patches.borders_x, scale * patches.borders_y
    mesh = axes.pcolormesh(*borders, np.zeros(patches.grid[::-1]))
    mesh.set_array(None)
    by_rows = shown.reshape(*patches.grid, 3).swapaxes(0, 1).reshape(-1, 3)
    mesh.set(facecolor=by_rows, edgecolor="0.8", linewidth=0.4)
    axes.set_title("colours by place; open: white")


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
_COLOURS = dict(zip(_SHOWN, ("0.1", "0.1", GREEN, ORANGE), strict=True))


@styled()
def sweep_figure(sweep: Any) -> Figure:
    """Draw mean pressure over approach, and contact area over mean pressure.

    Thin curves are single cases. A thick curve is the mean of an ensemble, a broken one its median,
    and the band about them holds the middle 90 % of its cases: of pressures where all were pressed
    to the same approaches, of approaches where all were pressed by the same forces.

    Args:
        sweep: A `multiscale.studies.sweep.SweepResults`, of which 8 ensembles are drawn.
    """
    figure, (force, area) = panels(1, 2, 3.0)
    ensembles = sweep.ensembles()[:8]  # more cannot be told apart
    looks = zip(cycle(PALETTE), cycle("osD^vPX*"))  # eight at most
    for (colour, mark), (values, part), (_, statistics) in zip(
        looks, ensembles, sweep.statistics, strict=False
    ):
        few = slice(200 // len(ensembles))  # the band shows those beyond
        approach, pressure = 1e3 * part.approach_mm[few], part.mean_pressure_MPa[few]
        look: dict[str, Any] = {"color": colour}
        if approach.shape[1] <= 50:
            look |= {"marker": mark, "ms": 4.0}
        thin = look | {"lw": 0.5, "alpha": PALE}
        force.plot(approach.T, pressure.T, **thin)
        area.plot(pressure.T, 100.0 * part.contact_area_fraction[few].T, **thin)
        many = len(part) > 1
        label = ", ".join(filter(None, (_label(values), f"mean of {len(part)}" * many)))
        mean = _read_off(statistics, "mean")
        force.plot(*mean[:2], lw=2.0, label=label, **look)
        area.plot(*mean[1:], lw=2.0, **look)
        if many:
            _draw_scatter(force, statistics, colour)
    force.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
    area.set(xlabel="mean pressure [MPa]", ylabel="contact area fraction [%]")
    if len(sweep) > len(ensembles):
        force.set_title("thick: means; dashed: medians; bands: middle 90 %")
        area.set_title("thick: means; thin: single cases")
    add_legend(figure)
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
    return literal(label)


def _read_off(statistics: Any, name: str) -> list[np.ndarray[Any, Any]]:
    """Return a number of approaches [µm], mean pressures [MPa] and area fractions [%]."""
    drawn = {"approach_mm": 1e3, "mean_pressure_MPa": 1.0, "contact_area_fraction": 100.0}
    return [scale * statistics.of(column, name) for column, scale in drawn.items()]


def _draw_scatter(axes: Any, statistics: Any, colour: str) -> None:
    """Draw the band of an ensemble whose cases share their approaches or their pressures."""
    mean, median, low, high, least, most = (
        _read_off(statistics, name)
        for name in ("mean", "median", "low", "high", "smallest", "largest")
    )
    shared = [bool((most[k] - least[k]).max() <= 1e-9 * np.abs(mean[k]).max()) for k in (0, 1)]
    if shared[0] == shared[1]:
        return
    x, y = (mean[0], median[1]) if shared[0] else (median[0], mean[1])
    axes.plot(x, y, color=colour, lw=1.2, ls="--")
    along, across = (axes.fill_between, 1) if shared[0] else (axes.fill_betweenx, 0)
    along(mean[1 - across], low[across], high[across], color=colour, alpha=0.2)
    if len(x) == 1:  # of which a band would be nothing
        lines = axes.vlines if shared[0] else axes.hlines
        lines(mean[1 - across], low[across], high[across], color=colour, lw=1.0)


@styled()
def comparison_figure(comparison: Any) -> Figure:
    """Draw errors of the response, the contact area and the pressure distribution over time.

    The frontier is drawn and its configurations have the numbers of their rows; those that another
    one beats are pale. The uncertainty of the measure is a band: errors within it cannot be told
    apart.

    Args:
        comparison: A `multiscale.studies.comparison.Comparison` with a measure.
    """
    response = comparison.response
    titles = {
        f"{response}_max": f"{response}, over the curve",
        "area_max": "contact area, over the curve",
        "distribution": "distribution of pressures",
    }
    figure, axes = panels(1, 3, 3.8, below=0.85)
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
        axes.plot([], [], MARKERS[kind], color=COLOURS[kind], label=kind, **_PLAIN)
    for number, row in enumerate(comparison.rows, 1):
        # the error of the measure is its own uncertainty
        size = 100.0 * float(np.maximum(abs(row.errors[error]), least))
        ahead = row in frontier or row.is_measure
        look = _RING if row.is_measure else _PLAIN if ahead else _BEATEN
        axes.plot(row.seconds, size, MARKERS[row.kind], color=COLOURS[row.kind], **look)
        if ahead and np.isfinite((row.seconds, size)).all():
            axes.annotate(str(number), (row.seconds, size), **_NUMBER)
    axes.set(xscale="log", yscale="log", xlabel="wall time [s]")
    axes.margins(0.15)
    axes.autoscale_view()
    axes.autoscale(False)
    plain_logarithmic(axes.xaxis)
    plain_logarithmic(axes.yaxis)
    if np.isfinite(bar) and bar > 0.0:
        axes.axhspan(1e-3 * axes.get_ylim()[0], 100.0 * bar, **ERROR_BAND)
    if frontier:
        times = [*(row.seconds for row in frontier), axes.get_xlim()[1]]
        steps = [100.0 * max(comparison.error(row, error), LEAST_ERROR) for row in frontier]
        axes.step(times, [*steps, steps[-1]], where="post", color="0.25", lw=1.2)


@styled()
def difference_figure(both: Any) -> Figure:
    """Draw mean pressure, contact area and separation of both runs, and ratios over the load.

    Curves are dashed where the load falls.

    Args:
        both: A `multiscale.studies.difference.Difference`.
    """
    figure, (force, area, gap, ratios) = panels(2, 2, 5.2)
    colours, marks = (BLUE, VERMILLION), "os"
    for history, name, colour, mark in zip(both.histories, both.names, colours, marks, strict=True):
        look: dict[str, Any] = {"color": colour, "label": literal(name)}
        if len(history) <= 100:
            look |= {"marker": mark, "ms": 3.0}
        pressure, falls = history.mean_pressure_MPa, history.unloading
        draw_path(force, 1e3 * history.approach_mm, pressure, falls, look)
        draw_path(area, pressure, 100 * history.contact_area_fraction, falls, look)
        draw_path(gap, 1e3 * history.mean_separation_mm, pressure, falls, look)
    label_response(force, area, gap, both.histories)
    gap.locator_params(axis="x", nbins=6)
    force.legend()
    _draw_ratios(ratios, both)
    return figure


def _draw_ratios(axes: Any, both: Any) -> None:
    """Draw ratios over the load that both have in common, with error bars where these are known."""
    drawn = 1.0 if both.load.unit == "MPa" else 1e-3
    load = both.loads / drawn
    axes.axhline(1.0, color="0.7", lw=0.8)
    shown = [one for one in both.ratios if one.name in _SHOWN]
    for one, mark in zip(shown, "osD^", strict=False):
        look = {"color": _COLOURS[one.name], "marker": mark, "ms": 3.0, "label": one.text}
        axes.plot(load, one.ratio, **look)
        known = np.isfinite(one.error) & (one.error > 0.0)
        bars = {"fmt": "none", "ecolor": _COLOURS[one.name], "capsize": 2.0}
        axes.errorbar(load[known], one.ratio[known], one.error[known], **bars)
    show_unit(axes.xaxis, both.load.text, both.load.unit, both.loads, drawn)
    axes.set(ylabel="second over first", title=literal(f"{both.names[1]} over {both.names[0]}"))
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.18 * len(shown) * (high - low))  # for the legend
    axes.legend(loc="upper left")
