"""Curves of load steps and of patch laws."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from patchlaw.geometry.patches import PatchGrid
from patchlaw.multiscale.figures.style import (
    BLUE,
    COLOURS,
    NO_CONTACT,
    PALETTE,
    add_legend,
    literal,
    map_axes,
    panels,
    place_colours,
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
