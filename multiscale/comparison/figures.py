"""Figures of a comparison: error over wall time, curves with their differences, pressure maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.comparison.comparison import Comparison, Row
from multiscale.comparison.configuration import OWN
from multiscale.comparison.error_measures import Curves, on_grid
from multiscale.output.figures import (
    COLOURS,
    ERROR_BAND,
    LINE_STYLES,
    MARKERS,
    PRESSURE_LABEL,
    draw_pressures,
    new_figure,
    panels_above_legend,
)

Array = NDArray[np.float64]

PALE = 0.4
"""Opacity of configurations that another one beats in time and error."""

LEAST_ERROR = 1e-5
"""Smaller errors are drawn here."""

LEAST_SHARE = 0.2
"""Errors below this share of the error bar are drawn there: they cannot be told apart."""

NUMBER_SIZE = np.array([13.0, 10.0])
"""Width and height that a number takes [pt]."""

_NEAR = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1.2), (0, -1.2), (1.4, 0), (-1.4, 0)])
OFFSETS = np.vstack([_NEAR, 2.2 * _NEAR, 3.4 * _NEAR]) * (10.0, 9.0)
"""Where a number may stand relative to its point, the best first [pt]."""


_NUMBER: dict[str, Any] = {"fontsize": 9, "fontweight": "bold", "color": "0.1", "zorder": 6}
_NUMBER |= {"ha": "center", "va": "center"}


class Point(NamedTuple):
    """A configuration in a panel of error over time.

    Attributes:
        seconds: Wall time [s].
        size: The error as it is drawn.
        number: Number of its row.
        row: The row.
    """

    seconds: float
    size: float
    number: int
    row: Row


def pareto_figure(comparison: Comparison) -> Figure:
    """Draw errors of the response, the contact area and the pressure distribution over time.

    The frontier is drawn, configurations that another one beats are pale, and the uncertainty of
    the measure is a band: errors within it cannot be told apart. Configurations on a frontier have
    the numbers of their rows.

    Args:
        comparison: The comparison; it has a measure.
    """
    response = comparison.response
    titles = {
        f"{response}_max": f"{response}: largest error over the curve",
        "area_max": "contact area: largest error over the curve",
        "distribution": "distribution of pressures: distance / mean",
    }
    figure = new_figure(13.2, 6.4)
    panels, below = panels_above_legend(figure, 3, 0.16)
    points = []
    for axes, (error, title) in zip(panels, titles.items(), strict=True):
        points.append(_draw_errors(axes, comparison, error))
        axes.set_title(title, fontsize=10.5)
    panels[0].set_ylabel("relative to the measure")
    _draw_legend(below, comparison)
    ahead = {row.name for error in titles for row in comparison.frontier(error)}
    names = [
        f"{number}: {row.name}"
        for number, row in enumerate(comparison.rows, 1)
        if row.name in ahead or row.is_measure
    ]
    lines = ["      ".join(names[first : first + 3]) for first in range(0, len(names), 3)]
    figure.supxlabel("\n".join(lines), fontsize=8.5)
    # Numbers are placed beside the points, whose places are known once the figure is laid out.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, error, drawn in zip(panels, titles, points, strict=True):
        _draw_numbers(axes, drawn, comparison.frontier(error))
    return figure


def _draw_legend(axes: Any, comparison: Comparison) -> None:
    handles = [
        axes.plot([], [], mark, color=COLOURS[kind], ms=7, ls="none", label=kind)[0]
        for kind, mark in MARKERS.items()
        if any(row.kind == kind for row in comparison.rows)
    ]
    ring = {"mfc": "none", "mec": "0.1", "mew": 1.4, "ms": 10, "ls": "none"}
    pale = {"color": "0.1", "alpha": PALE, "mew": 0.0, "ms": 7, "ls": "none"}
    lowest = f"within the error bar; least drawn: {LEAST_SHARE:g} of it"
    handles += [
        axes.plot([], [], "o", label="measure, at its error bar", **ring)[0],
        axes.plot([], [], "o", label="pale: another one is faster and as close", **pale)[0],
        axes.plot([], [], "-", color="0.25", lw=1.2, label="frontier: numbered")[0],
        axes.fill_between([], [], [], label=lowest, **ERROR_BAND),
    ]
    if any(row.steps and row.status != "done" for row in comparison.rows):
        early = {"mfc": "none", "mec": "0.1", "alpha": PALE, "ms": 7, "ls": "none"}
        handles += axes.plot([], [], "s", label="hollow: ended before the last load step", **early)
    axes.legend(handles=handles, loc="center", ncol=4, frameon=False, fontsize=9.5)


def _draw_errors(axes: Any, comparison: Comparison, error: str) -> list[Point]:
    """Draw one panel of errors over time without its numbers; return its points."""
    frontier, bar = comparison.frontier(error), getattr(comparison.uncertainty, error)
    least = max(LEAST_ERROR, np.nan_to_num(LEAST_SHARE * bar))
    # The error of the measure is its own uncertainty.
    sizes = [abs(getattr(row.errors, error)) for row in comparison.rows]
    points = [
        Point(row.seconds, max(size, least), number, row)
        for number, (row, size) in enumerate(zip(comparison.rows, sizes, strict=True), 1)
        if np.isfinite((row.seconds, size)).all()
    ]
    for point in points:
        row, ahead = point.row, point.row in frontier
        look: dict[str, Any] = {"color": COLOURS[row.kind], "ms": 7.0, "zorder": 3 + ahead}
        if row.is_measure:
            look |= {"ms": 10.0, "mec": "0.1", "mew": 1.4, "zorder": 5}
        elif row.status != "done":
            look |= {"mfc": "none", "alpha": PALE}
        elif not ahead:
            look |= {"mew": 0.0, "alpha": PALE}
        axes.plot(point.seconds, point.size, MARKERS[row.kind], **look)
    axes.set(xscale="log", yscale="log", xlabel="wall time [s]")
    axes.grid(alpha=0.25, which="major")
    if not points:
        return points
    low = min(point.size for point in points) / 2.0
    axes.set_ylim(low, 2.0 * max(point.size for point in points))
    if np.isfinite(bar) and bar > 0.0:
        axes.axhspan(low / 1e3, bar, **ERROR_BAND)
    if frontier:
        times = [*(row.seconds for row in frontier), axes.get_xlim()[1]]
        steps = [max(comparison.error(row, error), LEAST_ERROR) for row in frontier]
        axes.step(times, [*steps, steps[-1]], where="post", color="0.25", lw=1.2)
    return points


def _draw_numbers(axes: Any, points: Sequence[Point], frontier: Sequence[Row]) -> None:
    """Write the numbers of the frontier and of the measure where they cover the least."""
    if not points:
        return
    to_points = 72.0 / axes.figure.dpi
    marks = to_points * axes.transData.transform([point[:2] for point in points])
    low, high = to_points * axes.bbox.get_points()
    placed = np.empty((0, 2))
    for mark, point in zip(marks, points, strict=True):
        if not (point.row in frontier or point.row.is_measure):
            continue
        spots = mark + OFFSETS
        outside = ((spots < low + 0.5 * NUMBER_SIZE) | (spots > high - 0.5 * NUMBER_SIZE)).any(
            axis=1
        )
        covered = _covered(spots, marks, 0.75) + 100 * _covered(spots, placed, 1.0)
        best = int(np.argmin(covered + 1000 * outside))
        placed = np.vstack([placed, spots[best]])
        leader = {"arrowstyle": "-", "lw": 0.6, "color": "0.3"} if best >= len(_NEAR) else None
        place = {"xytext": tuple(OFFSETS[best]), "textcoords": "offset points"}
        axes.annotate(str(point.number), point[:2], arrowprops=leader, **place, **_NUMBER)


def _covered(spots: Array, others: Array, share: float) -> NDArray[np.intp]:
    """Return how many of the others a number at each spot would cover."""
    apart = np.abs(spots[:, None] - others) / (share * NUMBER_SIZE)
    return np.asarray((apart < 1.0).all(axis=2).sum(axis=1))


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


def curves_figure(comparison: Comparison) -> Figure:
    """Draw force–approach curves, and their differences from the measure with its error bar."""
    figure = new_figure(12.0, 4.8)
    (curves, differences), below = panels_above_legend(figure, 2, 0.2)
    measure = None if comparison.measure is None else comparison.curves[comparison.measure]
    response = comparison.response

    def prescribed(found: Curves) -> Array:
        return 1e3 * found.approach if comparison.quantity == "approach" else found.force

    for index, row in enumerate(selected_rows(comparison)):
        found, colour = comparison.curves[row.name], COLOURS[row.kind]
        if row.is_measure or row.name.startswith(OWN):
            colour = "0.1" if row.is_measure else "0.55"
        style = "-" if row.is_measure else LINE_STYLES[index % len(LINE_STYLES)]
        look: dict[str, Any] = {"color": colour, "ls": style, "marker": MARKERS[row.kind]}
        look |= {"ms": 4.0, "lw": 1.4}
        curves.plot(1e3 * found.approach, found.force, label=row.name, **look)
        if measure is not None and not row.is_measure:
            common, right = min(len(found), len(measure)), getattr(measure, response)
            change = (getattr(found, response)[:common] - right[:common]) / np.abs(right).max()
            differences.plot(prescribed(found)[:common], 100.0 * change, **look)
    if measure is not None:
        differences.axhline(0.0, color="0.1", lw=1.4)
        bar = 100.0 * getattr(comparison.uncertainty, f"{response}_max")
        if np.isfinite(bar):
            differences.axhspan(-bar, bar, **ERROR_BAND)
    curves.set(xlabel="approach [µm]", ylabel="force [N]")
    differences.set(
        xlabel="approach [µm]" if comparison.quantity == "approach" else "force [N]",
        ylabel=f"{response} minus that of the measure [% of its largest]",
    )
    for axes in (curves, differences):
        axes.grid(alpha=0.3)
    handles, labels = curves.get_legend_handles_labels()
    below.legend(handles, labels, loc="center", ncol=2, frameon=False, fontsize=8.5)
    return figure


def maps_figure(comparison: Comparison) -> Figure:
    """Draw pressures at the last load step side by side: on the same patches, on one scale."""
    closest = selected_rows(comparison, "pressure_l1", most=6)
    pressures = {}
    for row in closest:
        if row.steps == comparison.steps:
            found, title = comparison.curves[row.name], row.name + " (measure)" * row.is_measure
            pressures[title] = on_grid(found.patch_pressure[-1], found.patches, comparison.grid)
    across = min(3, max(1, len(pressures)))
    down = max(1, -(-len(pressures) // across))
    figure = new_figure(3.9 * across + 0.8, 3.9 * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    top = max((float(pressure.max()) for pressure in pressures.values()), default=1.0)
    image = None
    for axes, (title, pressure) in zip(panels, pressures.items(), strict=False):
        image = draw_pressures(figure, axes, comparison.grid, pressure, top=top)
        axes.set_title(title.replace(", ", "\n", 1), fontsize=8.5)
        axes.set(xlabel="", ylabel="", xticks=[], yticks=[])
    for axes in panels[len(pressures) :]:
        axes.set_visible(False)
    if image is not None:
        figure.colorbar(image, ax=list(panels), label=PRESSURE_LABEL, shrink=0.8)
    return figure
