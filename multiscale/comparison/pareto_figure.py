"""The figure of a comparison: error over wall time, with the frontier."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.comparison.comparison import Comparison, Row

Array = NDArray[np.float64]

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

_PALE = 0.4  # opacity of dominated levels
_LEAST = 1e-5  # errors below are drawn there
_WITHIN = 0.2  # of the error bar: errors below are drawn there, as they cannot be told apart
_SPOTS = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1.2), (0, -1.2), (1.4, 0), (-1.4, 0)])
_SPOTS = np.vstack([_SPOTS, 2.2 * _SPOTS, 3.4 * _SPOTS]) * (10.0, 9.0)
"""Where a number may stand beside its point, best first [pt]."""
_NUMBER = np.array([13.0, 10.0])  # room that it takes [pt]

Point = tuple[float, float, int, Row]  # time, error as drawn, number, level


def pareto_figure(comparison: Comparison) -> Figure:
    """Draw errors of the response, the contact area and the pressure distribution over time.

    The frontier is drawn, dominated levels are pale, and the uncertainty of the measure is a band:
    errors within it cannot be told apart. Levels on a frontier have the numbers of their rows.
    """
    response = comparison.response
    panels = (
        (f"{response}_max", f"{response}: largest error over the curve"),
        ("area_max", "contact area: largest error over the curve"),
        ("distribution", "distribution of pressures: distance / mean"),
    )
    figure = Figure(figsize=(13.2, 6.4), layout="constrained")
    drawn, below = with_legend(figure, 3, 0.16)
    points = [
        _draw_pareto(axes, comparison, error)
        for axes, (error, _) in zip(drawn, panels, strict=True)
    ]
    for axes, (_, title) in zip(drawn, panels, strict=True):
        axes.set_title(title, fontsize=10.5)
    drawn[0].set_ylabel("relative to the measure")
    _draw_legend(below, comparison)
    figure.supxlabel(_names(comparison, [error for error, _ in panels]), fontsize=8.5)
    figure.draw_without_rendering()  # only now is it known where points lie
    figure.set_layout_engine("none")  # and there they stay
    for axes, (error, _), told in zip(drawn, panels, points, strict=True):
        _number(axes, told, comparison.frontier(error))
    return figure


def _draw_legend(axes: Any, comparison: Comparison) -> None:
    """Say what marks, shades and lines mean."""
    handles = [
        axes.plot([], [], mark, color=COLOURS[kind], ms=7, ls="none", label=kind)[0]
        for kind, mark in MARKS.items()
        if any(row.kind == kind for row in comparison.rows)
    ]
    ring = {"mfc": "none", "mec": "0.1", "mew": 1.4, "ms": 10, "ls": "none"}
    pale = {"color": "0.1", "alpha": _PALE, "mew": 0.0, "ms": 7, "ls": "none"}
    lowest = f"within the error bar; least drawn: {_WITHIN:g} of it"
    handles += [
        axes.plot([], [], "o", label="measure, at its error bar", **ring)[0],
        axes.plot([], [], "o", label="pale: another level is faster and as close", **pale)[0],
        axes.plot([], [], "-", color="0.25", lw=1.2, label="frontier: its levels are numbered")[0],
        axes.fill_between([], [], [], color="#e8eaed", label=lowest),
    ]
    if any(row.steps and row.status != "done" for row in comparison.rows):
        early = {"mfc": "none", "mec": "0.1", "alpha": _PALE, "ms": 7, "ls": "none"}
        handles += axes.plot([], [], "s", label="hollow: ended before the last load step", **early)
    axes.legend(handles=handles, loc="center", ncol=4, frameon=False, fontsize=9.5)


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


def _draw_pareto(axes: Any, comparison: Comparison, error: str) -> list[Point]:
    """Draw one panel but for its numbers; return its points."""
    frontier = comparison.frontier(error)
    bar = getattr(comparison.uncertainty, error)
    least = max(_LEAST, np.nan_to_num(_WITHIN * bar))
    points: list[Point] = []
    for number, row in enumerate(comparison.rows, 1):
        size = abs(getattr(row.errors, error))  # the measure stands at its own uncertainty
        if np.isfinite((row.seconds, size)).all():
            points.append((row.seconds, max(size, least), number, row))
    for seconds, size, _, row in points:
        axes.plot(seconds, size, MARKS[row.kind], **_look(row, row in frontier))
    axes.set(xscale="log", yscale="log", xlabel="wall time [s]")
    axes.grid(alpha=0.25, which="major")
    if not points:
        return points
    sizes = [size for _, size, *_ in points]
    low = min(sizes) / 2.0
    axes.set_ylim(low, 2.0 * max(sizes))
    if np.isfinite(bar) and bar > 0.0:
        axes.axhspan(low / 1e3, bar, color="#e8eaed", zorder=0)
    if frontier:
        times = [*(row.seconds for row in frontier), axes.get_xlim()[1]]
        steps = [max(comparison.error(row, error), _LEAST) for row in frontier]
        axes.step(times, [*steps, steps[-1]], where="post", color="0.25", lw=1.2)
    return points


def _look(row: Row, ahead: bool) -> dict[str, Any]:
    """Return how the mark of a level is drawn."""
    look: dict[str, Any] = {"color": COLOURS[row.kind], "ms": 7.0, "zorder": 3 + ahead}
    if row.is_measure:
        return look | {"ms": 10.0, "mec": "0.1", "mew": 1.4, "zorder": 5}
    if row.status != "done":
        look["mfc"] = "none"
    elif not ahead:
        look["mew"] = 0.0
    return look if ahead else look | {"alpha": _PALE}


def _number(axes: Any, points: Sequence[Point], frontier: Sequence[Row]) -> None:
    """Write the numbers of the frontier and the measure where they cover least."""
    if not points:
        return
    scale = 72.0 / axes.figure.dpi
    marks = scale * axes.transData.transform([point[:2] for point in points])
    low, high = scale * axes.bbox.get_points()
    numbers = np.empty((0, 2))
    for mark, (seconds, size, number, row) in zip(marks, points, strict=True):
        if not (row in frontier or row.is_measure):
            continue
        spots = mark + _SPOTS
        outside = ((spots < low + 0.5 * _NUMBER) | (spots > high - 0.5 * _NUMBER)).any(axis=1)
        covered = _covered(spots, marks, 0.75) + 100 * _covered(spots, numbers, 1.0)
        best = int(np.argmin(covered + 1000 * outside))
        numbers = np.vstack([numbers, spots[best]])
        far = best >= len(_SPOTS) // 3
        axes.annotate(
            str(number),
            (seconds, size),
            xytext=tuple(_SPOTS[best]),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=9,
            fontweight="bold",
            color="0.1",
            zorder=6,
            arrowprops={"arrowstyle": "-", "lw": 0.6, "color": "0.3"} if far else None,
        )


def _covered(spots: Array, others: Array, share: float) -> NDArray[np.intp]:
    """Return how many of the others lie within the room of a number at each spot."""
    apart = np.abs(spots[:, None] - others) / (share * _NUMBER)
    return np.asarray((apart < 1.0).all(axis=2).sum(axis=1))
