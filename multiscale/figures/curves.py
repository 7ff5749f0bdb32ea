"""The curves of a history: force, contact area and mean separation."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from multiscale.figures.style import (
    BLUE,
    COLOURS,
    FULL_WIDTH,
    add_legend,
    new_figure,
    show_unit,
    styled,
)

MOST_MARKED = 500
"""Load steps that have a symbol each; more of them are drawn as lines alone."""


@styled()
def history_figure(history: Any, kind: str) -> Figure:
    """Draw force, contact area and mean separation of a run.

    Args:
        history: A `multiscale.results.history.History`.
        kind: Its coupling, which has a colour of its own, or another label.
    """
    figure = new_figure(FULL_WIDTH, 2.4)
    force, area, gap = figure.subplots(1, 3)
    colour = COLOURS.get(kind, BLUE)
    look: dict[str, Any] = {"color": colour, "label": kind}
    if len(history) <= MOST_MARKED:
        look |= {"marker": "o", "ms": 3.0}
    pressure = np.append(0.0, history.mean_pressure_MPa)
    # The first touch of a tilted plane is not at that of the middle.
    level = not any(any(step.tilt) for step in history.steps)
    touch = -history.steps[0].zero_mm if level and len(history) else np.nan
    approach = 1e3 * np.append(touch, history.approach_mm)
    force.plot(approach, pressure, **look)
    area.plot(pressure, 100 * np.append(0.0, history.contact_area_fraction), **look)
    gap.plot(1e3 * history.mean_separation_mm, history.mean_pressure_MPa, **look)
    if history.reference is not None:
        draw_error_band(force, area, history, colour=colour)
    area.set(ylabel="contact area fraction [%]")
    for axis in (force.yaxis, area.xaxis, gap.yaxis):
        show_unit(axis, "mean pressure", "MPa", history.mean_pressure_MPa)
    show_unit(force.xaxis, "approach", "mm", history.approach_mm, 1e-3)
    show_unit(gap.xaxis, "mean separation", "mm", history.mean_separation_mm, 1e-3)
    add_legend(figure)
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
