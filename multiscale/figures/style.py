"""The style of all figures: colours, markers, grid, legend."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")
COLOURS = dict(zip(KINDS, ("#0b3c5d", "#d1495b", "#1b998b", "#edae49", "#6a4c93"), strict=True))
"""Colour of each coupling."""

MARKERS = dict(zip(KINDS, "osD^*", strict=True))
"""Marker of each coupling."""

LINE_STYLES = ("-", "--", "-.", ":", (0, (3, 1, 1, 1, 1, 1)))
"""Line styles of curves that are drawn over each other."""

ERROR_BAND = {"color": "#e8eaed", "zorder": 0}
"""Look of the band within an error bar, behind everything else."""

PRESSURE_LABEL = "mean pressure of the patch [MPa]"
"""Label of the colour bars of pressure maps."""


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, which shares no global state of matplotlib.

    Args:
        width: Width [inch].
        height: Height [inch].
    """
    return Figure(figsize=(width, height), layout="constrained")


def map_unit(lengths: tuple[float, float]) -> tuple[float, str]:
    """Return the unit of x and y on maps, µm below 1 mm, and its number in a mm.

    Args:
        lengths: Sides of the map [mm].
    """
    return (1e3, "µm") if max(lengths) < 1.0 else (1.0, "mm")


def add_grid_and_legend(figure: Figure) -> None:
    """Draw a grid in every panel, and a legend in the first when it has more than one line."""
    for axes in figure.axes:
        axes.grid(alpha=0.3)
    first = figure.axes[0]
    if len(first.get_legend_handles_labels()[0]) > 1:
        first.legend(frameon=False)


def panels_above_legend(figure: Figure, panels: int, share: float) -> tuple[list[Any], Any]:
    """Return panels side by side, and empty axes below them for a common legend.

    Args:
        figure: The figure.
        panels: Number of panels.
        share: Height of the legend relative to that of the panels.
    """
    grid = figure.add_gridspec(2, panels, height_ratios=(1.0, share))
    below = figure.add_subplot(grid[1, :])
    below.axis("off")
    return [figure.add_subplot(grid[0, index]) for index in range(panels)], below
