"""Figures of a comparison: error over time, curves with their differences, maps of pressure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.comparison import Comparison, Row
from multiscale.figures import PRESSURE_LABEL, draw_pressures
from multiscale.levels import OWN
from multiscale.measures import on_grid

_MARKS = {
    "analytic": "o",
    "isolated": "s",
    "consistent": "D",
    "concurrent": "^",
    "reference": "*",
}
_COLOURS = {
    "analytic": "#0b3c5d",
    "isolated": "#d1495b",
    "consistent": "#1b998b",
    "concurrent": "#edae49",
    "reference": "#6a4c93",
}
_GREY = "#b8bec4"
_LEAST = 1e-5  # errors below are drawn there
_WITHIN = 0.2  # of the error bar: errors below are drawn there, as they cannot be told apart
_STYLES = ("-", "--", "-.", ":")


def pareto_figure(comparison: Comparison) -> Figure:
    """Draw errors of the response, the contact area and the pressure distribution over time.

    The frontier is drawn, dominated levels are grey, and the uncertainty of the measure is a band:
    errors within it cannot be told apart. Numbers are those of the rows.
    """
    response = comparison.response
    panels = (
        (f"{response}_max", f"{response}: largest error over the curve"),
        ("area_max", "contact area: largest error over the curve"),
        ("distribution", "distribution of pressures: distance / mean"),
    )
    figure = Figure(figsize=(13.2, 6.4), layout="constrained")
    drawn, below = _with_legend(figure, 3, 0.1)
    for axes, (error, title) in zip(drawn, panels, strict=True):
        _draw_pareto(axes, comparison, error)
        axes.set_title(title, fontsize=10.5)
    drawn[0].set_ylabel("relative to the measure")
    handles = [
        below.plot([], [], mark, color=_COLOURS[kind], ms=7, ls="none", label=kind)[0]
        for kind, mark in _MARKS.items()
        if any(row.kind == kind for row in comparison.rows)
    ]
    ring = {"mfc": "none", "mec": "0.1", "mew": 1.4, "ms": 10, "ls": "none"}
    handles += [
        below.plot([], [], "o", label="measure, at its error bar", **ring)[0],
        below.plot([], [], "o", color=_GREY, ms=6, ls="none", label="dominated")[0],
        below.plot([], [], "-", color="0.25", lw=1.2, label="frontier")[0],
        below.fill_between([], [], [], color="#e8eaed", label="within the error bar"),
    ]
    below.legend(handles=handles, loc="center", ncol=5, frameon=False)
    figure.supxlabel(_names(comparison, [error for error, _ in panels]), fontsize=8.5)
    return figure


def _names(comparison: Comparison, errors: Sequence[str], across: int = 3) -> str:
    """Say which levels the numbers on the frontiers are, several in a line."""
    ahead = {row.name for error in errors for row in comparison.frontier(error)}
    told = [
        f"{number}: {row.name}"
        for number, row in enumerate(comparison.rows, 1)
        if row.name in ahead or row.is_measure
    ]
    lines = [told[first : first + across] for first in range(0, len(told), across)]
    return "\n".join("      ".join(line) for line in lines)


def _with_legend(figure: Figure, panels: int, share: float) -> tuple[list[Any], Any]:
    """Return panels side by side, and empty axes below them that hold a legend."""
    grid = figure.add_gridspec(2, panels, height_ratios=(1.0, share))
    below = figure.add_subplot(grid[1, :])
    below.axis("off")
    return [figure.add_subplot(grid[0, index]) for index in range(panels)], below


def _draw_pareto(axes: Any, comparison: Comparison, error: str) -> None:
    """Draw one panel."""
    frontier = comparison.frontier(error)
    bar = getattr(comparison.uncertainty, error)
    least = max(_LEAST, np.nan_to_num(_WITHIN * bar))
    points: list[tuple[float, float, int, Row]] = []
    for number, row in enumerate(comparison.rows, 1):
        size = abs(getattr(row.errors, error))  # the measure stands at its own uncertainty
        if not np.isfinite((row.seconds, size)).all():
            continue
        size = max(size, least)
        points.append((row.seconds, size, number, row))
    for seconds, size, _, row in points:
        ahead = row in frontier
        coloured = ahead or row.is_measure
        look = {"color": _COLOURS[row.kind] if coloured else _GREY, "ms": 7.0, "zorder": 3 + ahead}
        if row.is_measure:
            look |= {"ms": 10.0, "mec": "0.1", "mew": 1.4, "zorder": 5}
        if row.status != "done":
            look["mfc"] = "none"
        axes.plot(seconds, size, _MARKS[row.kind], **look)
    axes.set(xscale="log", yscale="log", xlabel="wall time [s]")
    axes.grid(alpha=0.25, which="major")
    if not points:
        return
    sizes = [size for _, size, *_ in points]
    low = min(sizes) / 2.0
    axes.set_ylim(low, 2.0 * max(sizes))
    if np.isfinite(bar) and bar > 0.0:
        axes.axhspan(low / 1e3, bar, color="#e8eaed", zorder=0)
    if frontier:
        times = [*(row.seconds for row in frontier), axes.get_xlim()[1]]
        steps = [max(comparison.error(row, error), _LEAST) for row in frontier]
        axes.step(times, [*steps, steps[-1]], where="post", color="0.25", lw=1.2)
    _number(axes, sorted(points, key=lambda point: point[3] not in frontier), len(frontier))


def _number(axes: Any, points: Sequence[tuple[float, float, int, Row]], bold: int) -> None:
    """Write the rows' numbers beside their points; those that would cover another are left out.

    The first ``bold`` points are the frontier's; the table has all numbers.
    """
    placed: list[Any] = []
    for index, (seconds, size, number, row) in enumerate(points):
        ahead = index < bold or row.is_measure
        at = axes.transData.transform((seconds, size))
        if any(abs(at[0] - x) < 17.0 and abs(at[1] - y) < 13.0 for x, y in placed):
            continue
        placed.append(at)
        axes.annotate(
            str(number),
            (seconds, size),
            xytext=(5, 4),
            textcoords="offset points",
            fontsize=9 if ahead else 7.5,
            fontweight="bold" if ahead else "normal",
            color="0.1" if ahead else "0.5",
            zorder=6,
        )


def told_rows(comparison: Comparison, error: str | None = None, *, most: int = 7) -> list[Row]:
    """Return the rows to draw: the measure, the scene as it is, the closest of each kind.

    Args:
        comparison: The comparison.
        error: The error that tells how close, see `Comparison.error`; the fastest of equals wins.
        most: Largest number of rows.
    """
    usable = [row for row in comparison.rows if row.steps]
    picked = [row for row in usable if row.is_measure]
    picked += [row for row in usable if row.name == OWN]
    for kind in _MARKS:
        ended = [row for row in usable if row.kind == kind and row.status == "done"]
        picked += sorted(ended, key=lambda row: (comparison.error(row, error), row.seconds))[:1]
    picked += comparison.frontier(error)[::-1]
    return list({row.name: row for row in picked}.values())[:most]


def curves_figure(comparison: Comparison) -> Figure:
    """Draw force–approach curves, and their differences from the measure with its error bar."""
    figure = Figure(figsize=(12.0, 4.8), layout="constrained")
    (curves, apart), below = _with_legend(figure, 2, 0.2)
    measure = None if comparison.measure is None else comparison.curves[comparison.measure]
    response, given = comparison.response, comparison.quantity
    for index, row in enumerate(told_rows(comparison)):
        found = comparison.curves[row.name]
        look: dict[str, Any] = {
            "color": _colour(row),
            "ls": "-" if row.is_measure else _STYLES[index % len(_STYLES)],
            "marker": _MARKS[row.kind],
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
    return "0.55" if row.name == OWN else _COLOURS[row.kind]


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
    panels: Sequence[Any] = np.atleast_1d(figure.subplots(down, across)).ravel()
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
