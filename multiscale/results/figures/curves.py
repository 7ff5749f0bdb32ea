"""Curves: of load steps, of patch laws, of sweeps and comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle, pairwise
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from patchlaw.geometry.patches import PatchGrid
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.readable import shown_unit
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    COLOURS,
    ERROR_BAND,
    GREEN,
    INK,
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
from patchlaw.multiscale.results.run_curves import nominal_area, over_pressure, pressure_between


@styled()
def history_figure(history: Any, kind: str) -> Figure:
    """Draw force, contact area and mean separation of a run; hollow and dashed where loads fall.

    Points are load steps, with their error bars; curves between them are drawn where stiffnesses
    tell their slopes.

    Args:
        history: A `multiscale.results.history.History`.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    figure, (force, area, gap) = panels(1, 3, 2.4)
    colour = COLOURS.get(kind, BLUE)
    draw_response(force, area, gap, history, {"color": colour, "label": kind})
    if history.reference is not None:
        draw_error_band(force, area, history, colour=colour)
    label_response(force, area, gap, [history])
    add_legend(figure)
    return figure


def draw_response(force: Any, area: Any, gap: Any, history: Any, look: dict[str, Any]) -> None:
    """Draw mean pressure, contact area and mean separation at all load steps.

    Args:
        force: Axes of mean pressure [MPa] over approach [µm].
        area: Axes of contact area [%] over mean pressure [MPa].
        gap: Axes of mean pressure [MPa] over mean separation [µm].
        history: A `multiscale.results.history.History`.
        look: Look of the points and curves, with their label.
    """
    if not len(history):
        return
    pressure, nominal = history.mean_pressure_MPa, nominal_area(history)
    bars = [history.approach_error_mm * 1e3, history.force_error_N / nominal]
    bars += [100 * history.contact_area_fraction_error, 1e3 * history.mean_separation_error_mm]
    if history.reference is not None:  # whose bands are about mesh size zero
        bars = [np.zeros(len(history))] * 4
    approach, share = 1e3 * history.approach_mm, 100 * history.contact_area_fraction
    # under a shear alone all load steps are one point
    before = np.append(np.nan, pressure[:-1]), np.append(np.nan, approach[:-1])
    shown = ~(np.isclose(pressure, before[0], 1e-6) & np.isclose(approach, before[1], 1e-6))
    falls = history.unloading
    for axes, x, y, errors, over in (
        (force, approach, pressure, (bars[0], bars[1]), "approach_mm"),
        (area, pressure, share, (bars[1], bars[2]), ""),
        (gap, 1e3 * history.mean_separation_mm, pressure, (bars[3], bars[1]), "mean_separation_mm"),
    ):
        known = shown & np.isfinite(x) & np.isfinite(y)
        if len(history) > _MOST_POINTS:  # so close that lines between them are the curves
            draw_path(axes, x[known], y[known], falls[known], look)
            continue
        draw_points(axes, x, y, errors, falls, known, look)
        for index, *curve in pressure_between(history, over) if over else ():
            line = {"color": look["color"]} | (_FALLING if falls[index] else {})
            axes.plot(1e3 * curve[0], curve[1], **line)
    if history.before is None:
        area.plot(0.0, 0.0, **_TOUCH, color=look["color"])
        if not any(any(step.tilt) for step in history.steps):
            # the first touch of a tilted plane is not at that of the middle
            force.plot(-1e3 * history.steps[0].zero_mm, 0.0, **_TOUCH, color=look["color"])
    _say_steps_on_one_point(force, approach, pressure, shown)


_MOST_POINTS = 500
"""Load steps that are drawn as points at most."""
_TOUCH: dict[str, Any] = {"marker": "o", "ms": 2.0, "zorder": 3}
"""Look of the first touch."""
_FALLING: dict[str, Any] = {"color": "0.6", "ls": "--", "zorder": 2.5}
"""Look of curves along which the load falls, above those that it may coincide with."""


def draw_points(
    axes: Any, x: Any, y: Any, errors: Any, falls: Any, shown: Any, look: dict[str, Any]
) -> None:
    """Draw load steps as points with their error bars: hollow and grey where the load falls.

    Args:
        axes: Axes to draw into.
        x: Abscissae of the n points.
        y: Their ordinates.
        errors: Errors of both, NaN where not known.
        falls: Whether the load falls to each point, shape (n,).
        shown: Which are drawn, shape (n,).
        look: Their colour and label, and their marker unless it is a circle.
    """
    bars = [np.nan_to_num(one, posinf=0.0) for one in errors]
    points = {"ls": "none", "ms": 3.5, "marker": look.get("marker", "o"), "elinewidth": 0.8}
    back = "" if "unloading" in axes.get_legend_handles_labels()[1] else "unloading"
    for here, more in (
        (shown & ~falls, {"color": look["color"], "label": look["label"]}),
        (shown & falls, {"color": "0.6", "mfc": "white", "label": back}),
    ):
        if here.any():
            sides = [bar[..., here] if bar[..., here].any() else None for bar in bars]
            axes.errorbar(
                x[here], y[here], sides[1], sides[0], capsize=1.5, zorder=3, **points | more
            )


def _say_steps_on_one_point(axes: Any, x: Any, y: Any, shown: Any) -> None:
    """Write which load steps a point stands for where it stands for several, as under a shear."""
    starts = np.flatnonzero(shown)
    for start, end in zip(starts, np.append(starts[1:], len(shown)), strict=True):
        if end - start > 1:
            at = {"xytext": (-4.0, 4.0), "textcoords": "offset points", "ha": "right"}
            axes.annotate(f"{start + 1} to {end}", (x[start], y[start]), fontsize=7, **at)


def label_response(force: Any, area: Any, gap: Any, histories: Sequence[Any]) -> None:
    """Label axes of mean pressure, contact area and mean separation in units that suit all runs.

    Args:
        force: Axes of mean pressure over approach.
        area: Axes of contact area over mean pressure.
        gap: Axes of mean pressure over mean separation; None for none.
        histories: What is drawn.
    """
    pressures, approaches = (
        np.concatenate([np.ravel(getattr(history, name)) for history in histories])
        for name in ("mean_pressure_MPa", "approach_mm")
    )
    area.set(ylabel="contact area fraction [%]")
    for axis in (force.yaxis, area.xaxis):
        show_unit(axis, "mean pressure", "MPa", pressures)
    show_unit(force.xaxis, "approach", "mm", approaches, 1e-3)
    if gap is not None:
        gaps = np.concatenate([history.mean_separation_mm for history in histories])
        show_unit(gap.yaxis, "mean pressure", "MPa", pressures)
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


@styled()
def over_pressure_figure(history: Any, kind: str) -> Figure:
    """Draw contact area, gap, stiffness and conductances over the mean pressure.

    Axes are logarithmic, but that of the gap. Lines are the powers of the pressure that quantities
    follow as the load first rises.

    Args:
        history: A `multiscale.results.history.History` that reaches several pressures.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    found = over_pressure(history)
    columns = 2 if len(found) in (2, 4) else 3
    rows = -(-len(found) // columns)
    turns = any(one.back.any() for one in found)  # which the legend tells apart
    figure, axes = panels(rows, columns, 2.4 * rows, title=" " * turns)
    look = {"color": COLOURS.get(kind, BLUE), "label": kind}
    for place, one in zip(axes, found, strict=False):
        draw_over_pressure(place, [one], [history], [look])
        place.set_title(fill(one.text, 44))
    for spare in axes[len(found) :]:
        spare.remove()
    if turns:
        _legend_above(figure)
    return figure


def draw_over_pressure(axes: Any, found: Any, histories: Any, looks: Any) -> None:
    """Draw a quantity of runs over the mean pressure, with its powers and known curves.

    Args:
        axes: Axes to draw into.
        found: A `multiscale.results.run_curves.OverPressure` of each run.
        histories: Their histories.
        looks: Colours, labels and markers of the runs.
    """
    quantity, is_power = found[0].quantity, bool(found[0].laws)
    name, size = shown_unit(np.concatenate([one.values for one in found]), quantity.unit)
    pressures, unit = shown_unit(np.concatenate([one.pressure for one in found]), "MPa")
    axes.set(xscale="log", yscale="log" if is_power else "linear")
    for one, history, look in zip(found, histories, looks, strict=True):
        values = one.values / size
        errors = np.tile(one.errors / size, (2, 1))
        if is_power:  # bars end above 0, which the axis does not have
            errors[0] = np.minimum(errors[0], 0.9 * values)
        shown = np.isfinite(values) & ((values > 0.0) | (not is_power))
        bars = np.zeros(len(values)), errors
        draw_points(axes, one.pressure / unit, values, bars, one.back, shown, look)
        line: dict[str, Any] = {"color": look["color"], "lw": 1.0, "zorder": 2}
        for law in one.laws:
            ends = np.array([law.low, law.high])
            axes.plot(ends / unit, law.at(ends) / size, **line)
        if quantity.column == "mean_separation_mm":
            for index, gap, pressure in pressure_between(history, quantity.column):
                back = _FALLING if history.unloading[index] else {}
                axes.plot(pressure / unit, gap / size, **line | back)
    plain_logarithmic(axes.xaxis)
    if is_power:
        plain_logarithmic(axes.yaxis)
    label = f"{quantity.text.removesuffix(' per area')} [{name}]"
    axes.set(xlabel=f"mean pressure [{pressures}]", ylabel=label)


_OVER_SLID = (
    ("peak_pressure_MPa", "peak pressure", "MPa"),
    ("mean_pressure_MPa", "mean pressure", "MPa"),
    ("contact_area_fraction", "contact area", "%"),
    ("interface_stiffness_MPa_per_mm", "interface stiffness", "MPa/mm"),
    ("worn_depth_mm", "largest worn depth", "mm"),
    *(
        (f"leak_{way}mm3_per_s", f"leak {words}".strip(), "mm³/s")
        for way, words in (("x_", "along x"), ("y_", "along y"), ("", ""))
    ),
)
"""Columns that are drawn over the distance slid, with their names and units."""
_STAYS, _SPREAD, _FEW = 1e-6, 30.0, 0.2
"""Relative change of what stays as the surfaces slide, such as a mean pressure under a force; ratio
of values from which on their axis is logarithmic; and median over the largest of distances below
which theirs is."""


@styled()
def wear_figure(history: Any, kind: str) -> Figure:
    """Draw pressures, contact area, stiffness, worn depths and leak over the distance slid.

    Dotted lines are the values before anything slid, under the load that it then slid under.

    Args:
        history: A `multiscale.results.history.History` whose surfaces slide.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    slid, colour = np.nan_to_num(history.slid_mm), COLOURS.get(kind, BLUE)
    worn, unit = slid > 0.0, shown_unit(slid, "mm")
    column_errors, shown = {column.name: column.error for column in COLUMNS}, []
    for name, text, of in _OVER_SLID:
        values = np.asarray(getattr(history, name, np.full(len(slid), np.nan)), float)
        known = values[worn & np.isfinite(values)]
        if known.size and (name != "mean_pressure_MPa" or np.ptp(known) > _STAYS * known.max()):
            shown.append((name, values, text, of))
    columns = 2 if len(shown) in (2, 4) else 3
    rows = -(-len(shown) // columns)
    figure, axes = panels(rows, columns, 2.3 * rows)
    for place, (name, values, text, of) in zip(axes, shown, strict=False):
        told = [getattr(step, column_errors[name], None) for step in history.steps]
        errors = np.array([0.0 if one is None else one for one in told])
        if of == "%":  # there is no more than all
            errors = np.minimum(errors, 1.0 - np.nan_to_num(values))
        said, size = shown_unit(values[np.isfinite(values)], of)
        bars = np.zeros(len(slid)), errors / size
        look = {"color": colour, "label": kind}
        place.set(xlabel=f"distance slid [{unit[0]}]", ylabel=f"{text} [{said}]")
        known = worn & np.isfinite(values)
        place.plot(slid[known] / unit[1], values[known] / size, color=colour, lw=1.0)
        draw_points(place, slid / unit[1], values / size, bars, ~worn, known, look)
        first = int(np.argmax(worn)) - 1
        if first >= 0 and np.isfinite(values[first]) and values[first]:
            place.axhline(values[first] / size, color="0.5", lw=0.9, ls=":")
        least, most = values[known].min(), values[known].max()
        far = np.median(slid[worn]) < _FEW * slid.max()
        if far and least > 0.0 and most > _SPREAD * least:
            place.set_yscale("log")
            plain_logarithmic(place.yaxis)
        elif place.get_ylim()[0] > 0.0:
            place.set_ylim(0.0, 1.05 * place.get_ylim()[1])
        if far:
            place.set_xscale("log")
            plain_logarithmic(place.xaxis)
    for spare in axes[len(shown) :]:
        spare.remove()
    return figure


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
    figure, (force, area) = panels(1, 2, 2.55 + below, below=below)
    looks = zip(cycle(PALETTE), cycle("osD^vPX*"))  # eight at most
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
    label_response(force, area, None, [part for _, part in ensembles])
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
    return literal(label)


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


@styled()
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

    Points are hollow, and curves dashed, where the load falls.

    Args:
        both: A `multiscale.runs.difference.Difference`.
    """
    figure, (force, area, gap, ratios) = panels(2, 2, 5.2)
    colours, marks = (BLUE, VERMILLION), "os"
    for history, name, colour, mark in zip(both.histories, both.names, colours, marks, strict=True):
        look: dict[str, Any] = {"color": colour, "label": literal(name), "marker": mark}
        draw_response(force, area, gap, history, look)
    label_response(force, area, gap, both.histories)
    gap.locator_params(axis="x", nbins=6)
    force.legend()
    _draw_ratios(ratios, both)
    return figure


@styled()
def difference_over_pressure_figure(both: Any) -> Figure:
    """Draw stiffness, conductance, area and gap of both runs over the pressure, and their ratios.

    Args:
        both: A `multiscale.runs.difference.Difference` at equal pressures.
    """
    sides = [{one.quantity: one for one in over_pressure(history)} for history in both.histories]
    shared = [quantity for quantity in sides[0] if quantity in sides[1]]
    columns = 2 if len(shared) in (2, 4) else 3
    rows = 2 * -(-len(shared) // columns)
    figure, axes = panels(rows, columns, 2.1 * rows, title=" ")
    looks = [
        {"color": colour, "label": literal(name), "marker": mark}
        for colour, name, mark in zip((BLUE, VERMILLION), both.names, "os", strict=True)
    ]
    unused = set(axes)
    for number, quantity in enumerate(shared):
        upper = axes[2 * columns * (number // columns) + number % columns]
        lower = axes[2 * columns * (number // columns) + number % columns + columns]
        unused -= {upper, lower}
        draw_over_pressure(upper, [side[quantity] for side in sides], both.histories, looks)
        ratio = both.of(quantity.name)
        name, size = shown_unit(both.loads, "MPa")
        known, bars = np.isfinite(ratio.ratio), np.nan_to_num(ratio.error)
        lower.axhline(1.0, color="0.7", lw=0.8)
        look = {"color": INK, "label": "", "marker": "D"}
        none = np.zeros(len(known), bool)
        draw_points(lower, both.loads / size, ratio.ratio, (0.0 * bars, bars), none, known, look)
        lower.set(xscale="log", xlim=np.array(upper.get_xlim()), ylabel="second over first")
        lower.set(xlabel=f"mean pressure [{name}]")
        plain_logarithmic(lower.xaxis)
    for spare in unused:
        spare.remove()
    _legend_above(figure)
    return figure


def _legend_above(figure: Figure) -> None:
    """Draw the legend of the first panel where the title of a figure stands."""
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="upper center", ncol=len(handles[0]))


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
