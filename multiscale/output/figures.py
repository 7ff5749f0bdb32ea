"""Figures of a run: surface, pressure maps, laws, the block in contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from geometry.asperities import Asperities
from geometry.patches import PatchGrid
from geometry.surface import Surface
from multiscale.figures.block import block_figure
from multiscale.figures.style import PRESSURE_LABEL, add_grid_and_legend, map_unit, new_figure
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.results.contact_record import ContactRecord
from multiscale.results.history import History
from multiscale.setup.problem import ProblemSetup

MOST_NUMBERED_PATCHES = 100
"""A map of more patches shows colours alone; the numbers would cover each other."""

MOST_POINTS = 40_000
"""Points of a face that are drawn at most."""


def surface_figure(surface: Surface, asperities: Asperities | None, patches: PatchGrid) -> Figure:
    """Draw heights above the mean plane with summits, border maxima and patch borders.

    Args:
        surface: The heights.
        asperities: The summits of the surface; None leaves them out.
        patches: The partition of the interface.
    """
    figure = new_figure(6.4, 5.4)
    draw_surface(figure, figure.add_subplot(), surface, asperities, patches)
    return figure


def draw_surface(
    figure: Figure,
    axes: Any,
    surface: Surface,
    asperities: Asperities | None,
    patches: PatchGrid,
) -> None:
    """Draw one surface into given axes.

    Args:
        figure: The figure of the axes; a colour bar is added to it.
        axes: Axes to draw into.
        surface: The heights.
        asperities: The summits of the surface; None leaves them out.
        patches: The partition of the interface.
    """
    scale, unit = map_unit(surface.lengths)
    heights = 1e3 * (surface.heights - surface.mean_height).T
    extent = (0, scale * surface.lengths[0], 0, scale * surface.lengths[1])
    image = axes.imshow(heights, origin="lower", extent=extent, cmap="cividis")
    figure.colorbar(image, ax=axes, label="height over the mean plane [µm]")
    _draw_patch_borders(axes, patches, colour="white")
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    title = f"{patches.grid[0]} × {patches.grid[1]} patches"
    if asperities is None:
        axes.set_title(f"{heights.shape[1]} × {heights.shape[0]} heights, {title}")
        return
    summits: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": "#d1495b", "mec": "white"}
    cut: dict[str, Any] = {"marker": "x", "ms": 6, "color": "black"}
    for x, y, look, label in (
        (asperities.x, asperities.y, summits, "summits"),
        (asperities.border_x, asperities.border_y, cut, "border maxima (unused)"),
    ):
        if x.size:
            axes.plot(scale * x, scale * y, ls="none", label=label, clip_on=False, **look)
    axes.set_title(f"{len(asperities)} summits, {title}")
    if len(asperities) or asperities.border_x.size:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncol=2, frameon=False)


def pressure_figure(history: History) -> Figure:
    """Draw the patch pressures of the last load step as a map, with their values."""
    figure = new_figure(5.6, 4.8)
    axes = figure.add_subplot()
    last, record = history.steps[-1], history.reference
    assert isinstance(history.patches, PatchGrid)
    draw_pressures(figure, axes, history.patches, last.patches.pressure_MPa)
    error = "" if record is None else f" ({record.label})"
    axes.set_title(f"approach {1e3 * last.approach_mm:.3g} µm, force {last.force_N:.4g} N{error}")
    return figure


def draw_pressures(
    figure: Figure,
    axes: Any,
    patches: PatchGrid,
    pressure: NDArray[np.float64],
    *,
    top: float | None = None,
) -> Any:
    """Draw one map of patch pressures into given axes.

    Args:
        figure: The figure of the axes; a colour bar is added to it unless `top` is given.
        axes: Axes to draw into.
        patches: The partition of the interface.
        pressure: Mean pressure of each patch, shape (N,) [MPa].
        top: End of the colour scale, for maps that share one [MPa].

    Returns:
        The map, for a colour bar.
    """
    values, (scale, unit) = pressure.reshape(patches.grid), map_unit(patches.lengths)
    borders = scale * patches.borders_x, scale * patches.borders_y
    image = axes.pcolormesh(*borders, values.T, cmap="magma_r", vmin=0.0, vmax=top)
    if top is None:
        figure.colorbar(image, ax=axes, label=PRESSURE_LABEL)
    _draw_patch_borders(axes, patches, colour="0.7")
    if patches.count <= MOST_NUMBERED_PATCHES:
        dark = 0.55 * max(top or values.max(), 1e-300)
        for (x, y), value in zip(scale * patches.centres, pressure, strict=True):
            number = f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
            text = number if value > 0.0 else "open"
            colour = "white" if value > dark else "black"
            axes.text(x, y, text, ha="center", va="center", color=colour)
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", aspect="equal")
    return image


def face_figure(points: NDArray[np.float64], step: LoadStep) -> Figure:
    """Draw the pressures on a contact face of any outline at a load step.

    Args:
        points: Columns x, y [mm] and pressure [MPa], shape (n, 3).
        step: The load step.
    """
    figure = new_figure(6.4, 4.8)
    axes = figure.add_subplot()
    x, y, pressure = points[:: -(-len(points) // MOST_POINTS)].T
    scale, unit = map_unit((float(np.ptp(x)), float(np.ptp(y))))
    size = max(1.0, 5e4 / len(x))
    dots = axes.scatter(scale * x, scale * y, size, pressure, marker="s", lw=0, cmap="magma_r")
    figure.colorbar(dots, ax=axes, label="pressure [MPa]")
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", aspect="equal")
    axes.set_title(
        f"approach {1e3 * step.approach_mm:.3g} µm, force {step.force_N:.4g} N, "
        f"mean pressure {step.mean_pressure_MPa:.3g} MPa"
    )
    return figure


def block_figure_of(setup: ProblemSetup, record: ContactRecord) -> Figure:
    """Draw the block of a scene in three dimensions, with the contact of a load step.

    Args:
        setup: The problem set up from the scene.
        record: The contact, with the pressures of the surface's cells.
    """
    pressure = np.asarray(record.pressure_MPa)
    title = (
        f"load step {record.step}: approach {1e3 * record.approach_mm:.3g} µm, "
        f"force {record.force_N:.4g} N, {len(record.spots)} spots"
    )
    poisson_ratio = setup.materials.first.poisson_ratio
    return block_figure(setup.surface, pressure, poisson_ratio, title=title)


def law_figure(table: LawTable) -> Figure:
    """Draw pressure and area fraction of every patch law over closure, with the table's rows."""
    figure = new_figure(9.0, 3.8)
    pressure, area = figure.subplots(1, 2)
    closing = [law for law in table.laws if not law.is_open]
    for law in closing:
        closure = np.linspace(*law.range, 200)
        (line,) = pressure.plot(1e3 * closure, law.at(closure).pressure, lw=1.2)
        pressure.plot(1e3 * law.rows.closure, law.rows.pressure, ".", ms=3, color=line.get_color())
        area.plot(1e3 * closure, 100 * law.at(closure).contact_area_fraction, lw=1.2)
    pressure.set(xlabel="closure [µm]", ylabel="mean pressure of the patch [MPa]")
    area.set(xlabel="closure [µm]", ylabel="contact area fraction [%]")
    add_grid_and_legend(figure)
    figure.suptitle(f"{len(closing)} patch laws of {len(table.laws)} patches (dots: table rows)")
    return figure


def _draw_patch_borders(axes: Any, patches: PatchGrid, colour: str) -> None:
    scale, _ = map_unit(patches.lengths)
    for draw, borders in ((axes.axvline, patches.borders_x), (axes.axhline, patches.borders_y)):
        for border in borders[1:-1]:
            draw(scale * border, color=colour, lw=0.8, alpha=0.9)
