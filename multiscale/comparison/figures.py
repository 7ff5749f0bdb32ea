"""Figures of a comparison: curves with their differences, maps of pressure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.comparison.comparison import Comparison, Row
from multiscale.comparison.level import OWN
from multiscale.comparison.measures import on_grid
from multiscale.comparison.pareto_figure import COLOURS, MARKS, with_legend
from multiscale.output.figures import PRESSURE_LABEL, draw_pressures

_STYLES = ("-", "--", "-.", ":")


def told_rows(comparison: Comparison, error: str | None = None, *, most: int = 7) -> list[Row]:
    """Return the rows to draw: the measure, the scene as it is, the closest of each kind.

    Args:
        comparison: The comparison.
        error: The error that tells how close, see `Comparison.error`; the fastest of equals wins.
        most: Largest number of rows.
    """
    usable = [row for row in comparison.rows if row.steps]
    picked = [row for row in usable if row.is_measure]
    picked += [row for row in usable if row.name.startswith(OWN)]
    for kind in MARKS:
        ended = [row for row in usable if row.kind == kind and row.status == "done"]
        picked += sorted(ended, key=lambda row: (comparison.error(row, error), row.seconds))[:1]
    picked += comparison.frontier(error)[::-1]
    return list({row.name: row for row in picked}.values())[:most]


def curves_figure(comparison: Comparison) -> Figure:
    """Draw force–approach curves, and their differences from the measure with its error bar."""
    figure = Figure(figsize=(12.0, 4.8), layout="constrained")
    (curves, apart), below = with_legend(figure, 2, 0.2)
    measure = None if comparison.measure is None else comparison.curves[comparison.measure]
    response, given = comparison.response, comparison.quantity
    for index, row in enumerate(told_rows(comparison)):
        found = comparison.curves[row.name]
        look: dict[str, Any] = {
            "color": _colour(row),
            "ls": "-" if row.is_measure else _STYLES[index % len(_STYLES)],
            "marker": MARKS[row.kind],
            "ms": 4.0,
            "lw": 1.4,
        }
        curves.plot(1e3 * found.approach, found.force, label=row.name, **look)
        if measure is None or row.is_measure:
            continue
        common = min(len(found), len(measure))
        right = getattr(measure, response)
        change = (getattr(found, response) - right)[:common] / np.abs(right).max()
        apart.plot(_scaled(found, given)[:common], 100.0 * change, **look)
    if measure is not None:
        _draw_bar(apart, comparison, _scaled(measure, given))
    curves.set(xlabel="approach [µm]", ylabel="force [N]")
    unit = "approach [µm]" if given == "approach" else "force [N]"
    apart.set(xlabel=unit, ylabel=f"{response} minus that of the measure [% of its largest]")
    for axes in (curves, apart):
        axes.grid(alpha=0.3)
    handles, labels = curves.get_legend_handles_labels()
    below.legend(handles, labels, loc="center", ncol=2, frameon=False, fontsize=8.5)
    return figure


def _colour(row: Row) -> str:
    if row.is_measure:
        return "0.1"
    return "0.55" if row.name.startswith(OWN) else COLOURS[row.kind]


def _scaled(curves: Any, quantity: str) -> Any:
    return 1e3 * curves.approach if quantity == "approach" else curves.force


def _draw_bar(axes: Any, comparison: Comparison, given: Any) -> None:
    """Draw the measure as a line at zero, with its uncertainty as a band."""
    axes.axhline(0.0, color="0.1", lw=1.4)
    bar = 100.0 * getattr(comparison.uncertainty, f"{comparison.response}_max")
    if np.isfinite(bar):
        axes.axhspan(-bar, bar, color="#e8eaed", zorder=0)


def maps_figure(comparison: Comparison) -> Figure:
    """Draw pressures at the last load step side by side: on the same patches, on one scale."""
    closest = told_rows(comparison, "pressure_l1", most=6)
    rows = [row for row in closest if row.steps == comparison.steps]
    across = min(3, max(1, len(rows)))
    down = max(1, -(-len(rows) // across))
    figure = Figure(figsize=(3.9 * across + 0.8, 3.9 * down), layout="constrained")
    panels: Sequence[Any] = list(np.atleast_1d(figure.subplots(down, across)).ravel())
    top = max((float(_last_pressure(comparison, row).max()) for row in rows), default=1.0)
    image = None
    for axes, row in zip(panels, rows, strict=False):
        pressure = _last_pressure(comparison, row)
        image = draw_pressures(figure, axes, comparison.grid, pressure, top=top)
        told = " (measure)" if row.is_measure else ""
        axes.set_title(f"{row.name}{told}".replace(", ", "\n", 1), fontsize=8.5)
        axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
    for axes in panels[len(rows) :]:
        axes.set_visible(False)
    if image is not None:
        figure.colorbar(image, ax=list(panels), label=PRESSURE_LABEL, shrink=0.8)
    return figure


def _last_pressure(comparison: Comparison, row: Row) -> NDArray[np.float64]:
    """Return pressures on the patches that they are compared on."""
    found = comparison.curves[row.name]
    return on_grid(found.patch_pressure[-1], found.patches, comparison.grid)
