"""The figure of a comparison: error over wall time, with the frontier."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from multiscale.comparing.comparison import Comparison, Row

MARKS = {
    "analytic": "o",
    "isolated": "s",
    "consistent": "D",
    "concurrent": "^",
    "reference": "*",
}
"""Marker of each coupling."""

COLOURS = {
    "analytic": "#0b3c5d",
    "isolated": "#d1495b",
    "consistent": "#1b998b",
    "concurrent": "#edae49",
    "reference": "#6a4c93",
}
"""Colour of each coupling."""

_GREY = "#b8bec4"
_LEAST = 1e-5  # errors below are drawn there
_WITHIN = 0.2  # of the error bar: errors below are drawn there, as they cannot be told apart


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
    drawn, below = with_legend(figure, 3, 0.1)
    for axes, (error, title) in zip(drawn, panels, strict=True):
        _draw_pareto(axes, comparison, error)
        axes.set_title(title, fontsize=10.5)
    drawn[0].set_ylabel("relative to the measure")
    handles = [
        below.plot([], [], mark, color=COLOURS[kind], ms=7, ls="none", label=kind)[0]
        for kind, mark in MARKS.items()
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


def with_legend(figure: Figure, panels: int, share: float) -> tuple[list[Any], Any]:
    """Return panels side by side, and empty axes below them that hold a legend.

    Args:
        figure: Where to draw.
        panels: Number of panels.
        share: Height of the legend relative to that of the panels.
    """
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
        look = {"color": COLOURS[row.kind] if coloured else _GREY, "ms": 7.0, "zorder": 3 + ahead}
        if row.is_measure:
            look |= {"ms": 10.0, "mec": "0.1", "mew": 1.4, "zorder": 5}
        if row.status != "done":
            look["mfc"] = "none"
        axes.plot(seconds, size, MARKS[row.kind], **look)
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
