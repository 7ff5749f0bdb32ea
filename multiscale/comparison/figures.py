"""Figures of a comparison: curves with their differences, and maps of pressure."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from multiscale.comparison.comparison import Comparison, Row
from multiscale.comparison.configuration import OWN
from multiscale.comparison.errors import on_grid
from multiscale.figures.maps import colour_bar, draw_pressures
from multiscale.figures.style import (
    COLOURS,
    ERROR_BAND,
    FULL_WIDTH,
    GREY,
    INK,
    LINE_STYLES,
    MARKERS,
    new_figure,
    panels_above_legend,
    show_unit,
    styled,
)
from multiscale.readable import usual_unit


def selected_rows(comparison: Comparison, error: str | None = None, *, most: int = 7) -> list[Row]:
    """Return the rows to draw: the measure, the scene as it is, the closest of each coupling.

    Args:
        comparison: The comparison.
        error: The error that counts, see `Comparison.error`; of equals the fastest is taken.
        most: Largest number of rows.
    """
    usable = [row for row in comparison.rows if row.steps]
    picked = [row for row in usable if row.is_measure]
    picked += [row for row in usable if row.name.startswith(OWN)]
    for kind in MARKERS:
        ended = [row for row in usable if row.kind == kind and row.status == "done"]
        picked += sorted(ended, key=lambda row: (comparison.error(row, error), row.seconds))[:1]
    picked += comparison.frontier(error)[::-1]
    return list({row.name: row for row in picked}.values())[:most]


@styled()
def curves_figure(comparison: Comparison) -> Figure:
    """Draw force–approach curves, and their differences from the measure with its error bar.

    Args:
        comparison: The comparison.
    """
    figure = new_figure(FULL_WIDTH, 3.9)
    (curves, differences), below = panels_above_legend(figure, 2, 0.32)
    measure = comparison[comparison.measure].curves if comparison.measure else None
    by_approach, response = comparison.quantity == "approach", comparison.response
    for index, row in enumerate(selected_rows(comparison)):
        look: dict[str, Any] = {"color": COLOURS[row.kind], "marker": MARKERS[row.kind], "ms": 3.5}
        look |= {"lw": 1.4, "ls": LINE_STYLES[index % len(LINE_STYLES)]}
        if row.is_measure or row.name.startswith(OWN):
            look["color"] = INK if row.is_measure else GREY
        found, approach = row.curves, 1e3 * row.curves.approach
        curves.plot(approach, found.force, label=row.name, **look)
        if measure is not None:
            common, right = min(row.steps, measure.force.size), getattr(measure, response)
            change = (getattr(found, response)[:common] - right[:common]) / np.abs(right).max()
            prescribed = approach if by_approach else found.force
            differences.plot(prescribed[:common], 100.0 * change, **look)
    bar = 100.0 * getattr(comparison.uncertainty, f"{response}_max")
    if np.isfinite(bar):
        differences.axhspan(-bar, bar, **ERROR_BAND)
    rows = [row.curves for row in selected_rows(comparison)]
    show_unit(curves.xaxis, "approach", "mm", [row.approach.max() for row in rows], 1e-3)
    show_unit(curves.yaxis, "force", "N", [row.force.max() for row in rows])
    differences.set(
        xlabel="approach [µm]" if by_approach else "force [N]",
        ylabel=f"{response} minus that of the measure [% of its largest]",
    )
    entries = curves.get_legend_handles_labels()
    below.legend(*entries, loc="center", ncol=2)
    return figure


@styled()
def maps_figure(comparison: Comparison) -> Figure:
    """Draw pressures at the last load step side by side: on the same patches, on one scale.

    Args:
        comparison: The comparison.
    """
    closest = selected_rows(comparison, "pressure_l1", most=6)
    shown = [row for row in closest if row.steps == comparison.steps]
    pressures = [
        on_grid(row.curves.patch_pressure[-1], row.curves.patches, comparison.grid) for row in shown
    ]
    down = 1 + (len(shown) > 3)
    figure = new_figure(FULL_WIDTH, 2.4 * down)
    panels = figure.subplots(down, 3, squeeze=False).ravel()
    top = max((float(pressure.max()) for pressure in pressures), default=1.0)
    for axes, row, pressure in zip(panels, shown, pressures, strict=False):
        image = draw_pressures(axes, comparison.grid, pressure, top=top, label="")
        title = row.name + " (measure)" * row.is_measure
        axes.set_title(title.replace(", ", "\n", 1), fontsize=7)
    for index, axes in enumerate(panels):
        axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
        if index >= len(shown):
            axes.axis("off")
        elif index % 3 == 2 or index == len(shown) - 1:
            unit, _ = usual_unit([top], "MPa")
            colour_bar(image, axes, f"mean pressure of the patch [{unit}]")
    return figure
