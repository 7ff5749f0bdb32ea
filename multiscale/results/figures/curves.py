"""Curves: of load steps, over the pressure, over the distance slid, and of patch laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale.loading.column import leak_rates
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.run_curves import (
    APPROACH,
    AREA,
    OTHERS,
    PRESSURE,
    SEPARATION,
    Quantity,
    nominal_area,
    over_pressure,
    pressure_between,
)
from patchlaw.support.readable import shown_unit


@style.styled()
def history_figure(history: Any, kind: str) -> Figure:
    """Draw force, contact area and mean separation of a run; hollow and dashed where loads fall.

    Points are load steps, with their error bars; curves between them are drawn where stiffnesses
    tell their slopes.

    Args:
        history: A `multiscale.results.history.History`.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    figure, panels = style.panels(1, 3, 2.4)
    colour = style.COLOURS.get(kind, style.BLUE)
    draw_response(panels, history, {"color": colour, "label": kind})
    if history.reference is not None:
        draw_error_band(panels[0], panels[1], history, colour=colour)
    label_response(panels, [history])
    if len(history) and history.before is None:
        panels[1].set_title("small dots: first touch")
    style.add_legend(figure)
    return figure


RESPONSE = ((APPROACH, PRESSURE), (PRESSURE, AREA), (SEPARATION, PRESSURE))
"""What the panels of a run show along x and y."""


def draw_response(panels: Sequence[Any], history: Any, look: dict[str, Any]) -> None:
    """Draw mean pressure, contact area and mean separation at all load steps.

    Args:
        panels: Axes of `RESPONSE`, in the units of `style.DRAWN`.
        history: A `multiscale.results.history.History`.
        look: Look of the points and curves, with their label.
    """
    if not len(history):
        return
    drawn = {one: _drawn(one, one.values(history)) for pair in RESPONSE for one in pair}
    bars: dict[Any, Any] = dict.fromkeys(drawn)  # of a reference bands are about mesh size zero
    if history.reference is None:
        bars = {one: _drawn(one, one.errors(history)) for one in drawn}
    # under a shear alone all load steps are one point
    alike = (
        np.isclose(drawn[one], np.append(np.nan, drawn[one][:-1]), 1e-6)
        for one in (APPROACH, PRESSURE)
    )
    shown, falls = ~np.logical_and(*alike), history.unloading
    for axes, (x, y) in zip(panels, RESPONSE, strict=True):
        known = shown & np.isfinite(drawn[x]) & np.isfinite(drawn[y])
        draw_points(axes, drawn[x], drawn[y], (bars[x], bars[y]), falls, known, look)
        between = y is PRESSURE and len(history) <= _MOST_POINTS  # of more, points are the curve
        for index, *curve in pressure_between(history, x.column) if between else ():
            line = {"color": look["color"]} | (_FALLING if falls[index] else {})
            axes.plot(_drawn(x, curve[0]), curve[1], **line)
    force, area, _ = panels
    if history.before is None:
        area.plot(0.0, 0.0, **_TOUCH, color=look["color"])
        if not any(any(step.tilt) for step in history.steps):
            # the first touch of a tilted plane is not at that of the middle
            force.plot(-1e3 * history.steps[0].zero_mm, 0.0, **_TOUCH, color=look["color"])
    _say_steps_on_one_point(force, drawn[APPROACH], drawn[PRESSURE], shown)


def _drawn(quantity: Quantity, values: Any) -> Any:
    """Return values in the unit that they are drawn in."""
    return values / style.DRAWN.get(quantity.unit, 1.0)


_MOST_POINTS = 500
"""Load steps with curves between them at most; more are small points."""
_BESIDE = 0.03
"""Distance over the range of a curve at which words on two points stand on each other."""
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
        y: Their ordinates. Bars do not go below 0 from above it, as areas and pressures cannot.
        errors: Errors of both, NaN where not known; None without.
        falls: Whether the load falls to each point, shape (n,).
        shown: Which are drawn, shape (n,).
        look: Their colour and label, and their marker unless it is a circle.
    """
    bars = [0.0 * x if one is None else np.nan_to_num(one, posinf=0.0) for one in errors]
    size = 3.5 if len(x) <= _MOST_POINTS else 1.5
    points = {"ls": "none", "ms": size, "marker": look.get("marker", "o"), "elinewidth": 0.8}
    back = "" if "unloading" in axes.get_legend_handles_labels()[1] else "unloading"
    for here, more in (
        (shown & ~falls, {"color": look["color"], "label": look["label"]}),
        (shown & falls, {"color": "0.6", "mfc": "white", "label": back}),
    ):
        if here.any():
            along, up = (bar[here] if bar[here].any() else None for bar in bars)
            if up is not None:
                up = [np.where(y[here] < 0.0, up, np.minimum(up, y[here])), up]
            axes.errorbar(x[here], y[here], up, along, capsize=1.5, zorder=3, **points | more)


def _say_steps_on_one_point(axes: Any, x: Any, y: Any, shown: Any) -> None:
    """Write which load steps a point stands for where it stands for several, as under a shear."""
    starts, told = np.flatnonzero(shown), list[list[int]]()
    for start, end in zip(starts, np.append(starts[1:], len(shown)), strict=True):
        if end - start > 1:
            beside = told and all(
                abs(one[start] - one[told[-1][0]]) <= _BESIDE * np.ptp(one) for one in (x, y)
            )
            told = [*told[:-1], [told[-1][0], end]] if beside else [*told, [start, end]]
    for start, end in told:
        at = {"xytext": (-4.0, 4.0), "textcoords": "offset points", "ha": "right"}
        axes.annotate(f"steps {start + 1} to {end}", (x[start], y[start]), fontsize=7, **at)


def label_response(panels: Sequence[Any], histories: Sequence[Any]) -> None:
    """Label panels of `RESPONSE`, or the first of them, in units that suit all runs.

    Args:
        panels: Their axes.
        histories: What is drawn.
    """
    for axes, pair in zip(panels, RESPONSE, strict=False):
        for axis, one in zip((axes.xaxis, axes.yaxis), pair, strict=True):
            values = np.concatenate([np.ravel(one.values(history)) for history in histories])
            style.show_unit(axis, one.text, one.unit, values)


@style.styled()
def over_pressure_figure(history: Any, kind: str) -> Figure:
    """Draw contact area, gap, stiffness and conductances over the mean pressure.

    Axes are logarithmic, but that of the gap. Lines are the powers of the pressure that quantities
    follow as the load first rises.

    Args:
        history: A `multiscale.results.history.History` that reaches several pressures.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    found = over_pressure(history)
    turns = any(one.back.any() for one in found)  # which the legend tells apart
    lines = turns + any(len(one.laws) > 1 for one in found)
    figure, axes = style.panel_grid(len(found), 2.4, title="\n".join([" "] * lines))
    look = {"color": style.COLOURS.get(kind, style.BLUE), "label": kind}
    for place, one in zip(axes, found, strict=True):
        draw_over_pressure(place, [one], [history], [look])
        text = "\n".join(law.text for law in one.laws)  # a line for each power
        place.set_title(text, fontsize="small")  # wider than its panel
    if turns:
        style.legend_above(figure)
    return figure


def draw_over_pressure(axes: Any, found: Any, histories: Any, looks: Any) -> None:
    """Draw a quantity of runs over the mean pressure, with its powers and known curves.

    Args:
        axes: Axes to draw into.
        found: A `multiscale.results.run_curves.OverPressure` of each run.
        histories: Their histories.
        looks: Colours, labels and markers of the runs.
    """
    quantity = found[0].quantity
    is_gap = quantity.column == "mean_separation_mm"
    name, size = shown_unit(np.concatenate([one.values for one in found]), quantity.unit)
    pressures, unit = shown_unit(np.concatenate([one.pressure for one in found]), "MPa")
    axes.set(xscale="log", yscale="linear" if is_gap else "log")
    for one, history, look in zip(found, histories, looks, strict=True):
        values, errors = one.values / size, one.errors / size
        shown = np.isfinite(values) & ((values > 0.0) | is_gap)
        draw_points(axes, one.pressure / unit, values, (None, errors), one.back, shown, look)
        line: dict[str, Any] = {"color": look["color"], "lw": 1.0, "zorder": 2}
        for law in one.laws:
            ends = np.array([law.low, law.high])
            axes.plot(ends / unit, law.at(ends) / size, **line)
        if is_gap:
            for index, gap, pressure in pressure_between(history, quantity.column):
                back = _FALLING if history.unloading[index] else {}
                axes.plot(pressure / unit, gap / size, **line | back)
    style.logarithmic(axes.xaxis)
    if not is_gap:
        style.logarithmic(axes.yaxis)
    label = f"{quantity.text.removesuffix(' per area')} [{name}]"
    axes.set(xlabel=f"mean pressure [{pressures}]", ylabel=label)


_OVER_SLID = (
    "peak_pressure_MPa", "mean_pressure_MPa", "contact_area_fraction",
    "interface_stiffness_MPa_per_mm", "worn_depth_mm", *(name for name, _ in leak_rates()),
)  # fmt: skip
"""Quantities that are drawn over the distance slid."""
_STAYS, _SPREAD, _FEW = 1e-6, 30.0, 0.2
"""Relative change of what stays as the surfaces slide, such as a mean pressure under a force; ratio
of values from which on their axis is logarithmic; and median over the largest of distances below
which theirs is."""


@style.styled()
def wear_figure(history: Any, kind: str) -> Figure:
    """Draw pressures, contact area, stiffness, worn depths and leak over the distance slid.

    Dotted lines are the values before anything slid, under the load that it then slid under.

    Args:
        history: A `multiscale.results.history.History` whose surfaces slide.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    slid, colour = np.nan_to_num(history.slid_mm), style.COLOURS.get(kind, style.BLUE)
    worn, unit = slid > 0.0, shown_unit(slid, "mm")
    quantities, shown = {one.name: one for one in (PRESSURE, *OTHERS)}, []
    for one in map(quantities.__getitem__, _OVER_SLID):
        values = one.values(history)
        known = values[worn & np.isfinite(values)]
        if known.size and (one is not PRESSURE or np.ptp(known) > _STAYS * known.max()):
            shown.append((one, values))
    figure, axes = style.panel_grid(len(shown), 2.3)
    for place, (one, values) in zip(axes, shown, strict=True):
        errors, text, of = np.nan_to_num(one.errors(history)), one.text, one.unit
        if of == "%":  # there is no more than all
            errors = np.minimum(errors, 1.0 - np.nan_to_num(values))
        said, size = shown_unit(values[np.isfinite(values)], of)
        bars = None, errors / size
        look = {"color": colour, "label": kind}
        place.set(
            xlabel=f"distance slid [{unit[0]}]", ylabel=f"{text.removesuffix(' per area')} [{said}]"
        )
        known = worn & np.isfinite(values)
        place.plot(slid[known] / unit[1], values[known] / size, color=colour, lw=1.0)
        draw_points(place, slid / unit[1], values / size, bars, ~worn, known, look)
        first, drawn = int(np.argmax(worn)) - 1, values[known]
        if first >= 0 and np.isfinite(values[first]) and values[first]:
            place.axhline(values[first] / size, color="0.5", lw=0.9, ls=":")
            axes[0].set_title("dotted: before it slid")
            drawn = np.append(drawn, values[first])
        least, most = drawn.min(), drawn.max()
        far = np.median(slid[worn]) < _FEW * slid.max()
        if far and least > 0.0 and most > _SPREAD * least:
            place.set_yscale("log")
            style.logarithmic(place.yaxis)
        elif least >= 0.0:
            place.set_ylim(0.0, 1.05 * place.get_ylim()[1])
        # all panels alike, whichever of their values are known
        ends = np.array([slid[worn].min(), slid[worn].max()]) / unit[1]
        place.set_xlim(*(ends * [0.8, 1.25] if far else ends * [0.0, 1.05]))
        if far:
            place.set_xscale("log")
            style.logarithmic(place.xaxis)
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
    nominal = nominal_area(history)
    approach, pressure = 1e3 * record.approach.value, record.force.value / nominal
    aside, above = 1e3 * record.approach.error, record.force.error / nominal
    share, error = 100 * record.area.value, 100 * record.area.error
    for axes, x, y, beside, up, label in (
        (force, approach, pressure, aside, above, record.label),
        (area, pressure, share, 0.0, error, None),
    ):
        if axes is not None:
            off, up = np.nan_to_num(beside), np.nan_to_num(up)
            around = np.append(x - off, (x + off)[::-1]), np.append(y + up, (y - up)[::-1])
            axes.fill(*around, color=colour, alpha=0.25, lw=0.0, label=label)


@style.styled()
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
    figure, (pressure, area, *key) = style.panels(1, 2 + on_grid, 2.7, title=title)
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
    for axes, one, most in ((pressure, PRESSURE, tops), (area, AREA, [1.0])):
        style.show_unit(axes.xaxis, "closure", "mm", ends)
        style.show_unit(axes.yaxis, one.text, one.unit, most)
    if key:
        _draw_places(key[0], table, colours)
    elif len(closing) > 1:
        pressure.legend()
    return figure


def _law_colours(table: Any) -> tuple[Any, list[str]]:
    """Return the colour of each law, by its place on the face or its region, and its name."""
    patches = table.patches
    if not isinstance(patches, PatchGrid):
        return [style.PALETTE[i % len(style.PALETTE)] for i in range(patches.count)], [
            style.literal(name) for name in patches.names
        ]
    if patches.count == 1:
        return [style.BLUE], [""]
    return style.place_colours(patches.centres / np.array(patches.lengths)), [""] * patches.count


def _draw_places(axes: Any, table: Any, colours: Any) -> None:
    """Draw the face with its patches in the colours of their laws; open ones are white."""
    patches = table.grid
    scale = style.map_axes(axes, patches.lengths)
    is_open = np.array([law.is_open for law in table.laws])
    shown = np.where(is_open[:, None], np.array(to_rgb(style.NO_CONTACT)), colours)
    extent = (0.0, scale * patches.lengths[0], 0.0, scale * patches.lengths[1])
    image = shown.reshape(*patches.grid, 3).swapaxes(0, 1)
    axes.imshow(image, origin="lower", extent=extent)
    style.draw_patch_borders(axes, patches, colour="0.8")
    axes.set_title("colours by place; open: white")
