"""The figures of a run: each from its results, in the style of `multiscale.figures`."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from multiscale.couplings.coupling import Coupling
from multiscale.figures.block import block_figure
from multiscale.figures.contact import draw_contact
from multiscale.figures.maps import colour_bar, draw_pressures, map_axes, place_colours
from multiscale.figures.style import (
    BLUE,
    FULL_WIDTH,
    NO_CONTACT,
    ONE_COLUMN,
    PALETTE,
    PRESSURES,
    new_figure,
    show_unit,
    styled,
)
from multiscale.figures.surface import draw_surface, surface_figure
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.readable import quantity, usual_unit
from multiscale.results.contact_record import ContactRecord
from multiscale.results.history import History

MOST_POINTS = 40_000
"""Points of a face that are drawn at most."""

MOST_MARKED_LAWS = 36
"""Laws whose rows are marked; the dots of more would hide the curves."""


def surface_figure_of(coupling: Coupling) -> Figure:
    """Draw the surface of a scene, with its summits where the micro model uses them.

    Args:
        coupling: What was made of the scene.
    """
    target = coupling.scene.surface.spectrum
    return surface_figure(coupling.surface, coupling.summits, coupling.patches, target)


@styled()
def pressure_figure(history: History) -> Figure:
    """Draw the patch pressures of the last load step as a map, with their values."""
    figure = new_figure(ONE_COLUMN, 2.9)
    axes = figure.add_subplot()
    last = history.steps[-1]
    assert isinstance(history.patches, PatchGrid)
    draw_pressures(axes, history.patches, last.patches.pressure_MPa)
    bar = f" ({history.reference.label})" if history.reference else ""
    axes.set_title(load_text(last) + bar)
    return figure


def load_text(step: LoadStep) -> str:
    """Return approach and force of a load step, as titles say them."""
    return f"approach {quantity(step.approach_mm, 'mm')}, force {quantity(step.force_N, 'N')}"


@styled()
def overview_figure(
    coupling: Coupling, history: History, face: NDArray[np.float64] | None
) -> Figure:
    """Draw the surface beside the pressures on it: of cells, spots, the face or patches.

    Args:
        coupling: What was made of the scene.
        history: The load steps.
        face: Pressures on a face with laws of samples, see `face_figure`; None without.
    """
    figure = new_figure(FULL_WIDTH, 2.8)
    left, right = figure.subplots(1, 2)
    draw_surface(left, coupling.surface, None)
    left.set_title("surface" + " of a sample" * (coupling.regions is not None))
    record, last = history.contact, history.steps[-1]
    if record is not None:
        draw_contact(right, record)
    elif face is not None:
        draw_face(right, face)
        right.set_title("contact pressure, averaged over the roughness")
    elif isinstance(history.patches, PatchGrid):
        draw_pressures(right, history.patches, last.patches.pressure_MPa)
        right.set_title("mean pressure of every patch; open ones white")
    else:
        right.axis("off")
    return figure


@styled()
def face_figure(points: NDArray[np.float64], step: LoadStep) -> Figure:
    """Draw the pressures on a contact face of any outline at a load step.

    Args:
        points: Columns x, y [mm] and pressure [MPa], shape (n, 3).
        step: The load step.
    """
    figure = new_figure(FULL_WIDTH, 4.2)
    axes = figure.add_subplot()
    draw_face(axes, points)
    mean = quantity(step.mean_pressure_MPa, "MPa", 3)
    axes.set_title(f"{load_text(step)}, mean pressure {mean}")
    return figure


def draw_face(axes: Any, points: NDArray[np.float64]) -> None:
    """Draw the pressures on a contact face of any outline.

    What bears no pressure is pale grey, so that the outline is seen.

    Args:
        axes: Axes to draw into.
        points: Columns x, y [mm] and pressure [MPa], shape (n, 3).
    """
    x, y, pressure = points[:: -(-len(points) // MOST_POINTS)].T
    lengths = float(np.ptp(x)), float(np.ptp(y))
    scale = map_axes(axes, lengths)
    axes.set(xlim=(scale * x.min(), scale * x.max()), ylim=(scale * y.min(), scale * y.max()))
    inches = axes.get_position().width * axes.figure.get_figwidth()
    size = (1.1 * 72.0 * inches) ** 2 / len(x)  # squares that cover a face as long as the axes
    look: dict[str, Any] = {"marker": "s", "lw": 0, "rasterized": True, "clip_on": False}
    loaded = pressure > 0.0
    axes.scatter(scale * x[~loaded], scale * y[~loaded], size, color="0.92", **look)
    place = scale * x[loaded], scale * y[loaded]
    name, unit = usual_unit([float(pressure.max())], "MPa")
    dots = axes.scatter(*place, size, pressure[loaded] / unit, cmap=PRESSURES, **look)
    dots.set_clim(0.0, float(pressure.max()) / unit or 1.0)
    colour_bar(dots, axes, f"contact pressure [{name}]")


def block_figure_of(coupling: Coupling, record: ContactRecord) -> Figure:
    """Draw the block of a scene in three dimensions, with the contact of a load step.

    Args:
        coupling: What was made of the scene.
        record: The contact, with the pressures of the surface's cells.
    """
    pressure = np.asarray(record.pressure_MPa)
    title = (
        f"load step {record.step}: approach {quantity(record.approach_mm, 'mm')}, "
        f"force {quantity(record.force_N, 'N')}, {len(record.spots)} spots"
    )
    poisson_ratio = coupling.materials.first.poisson_ratio
    return block_figure(coupling.surface, pressure, poisson_ratio, title=title)


@styled()
def law_figure(table: LawTable) -> Figure:
    """Draw pressure and area fraction of every law over closure, coloured by place on the face.

    Args:
        table: The laws of patches, with a key of their colours, or of regions, with their names.
    """
    figure = new_figure(FULL_WIDTH, 2.7)
    on_grid = isinstance(table.patches, PatchGrid) and table.patches.count > 1
    pressure, area, *key = figure.subplots(1, 2 + on_grid)
    colours, names = _law_colours(table)
    closing = [index for index, law in enumerate(table.laws) if not law.is_open]
    few = len(closing) <= MOST_MARKED_LAWS
    for index in closing:
        law, look = table.laws[index], {"color": colours[index], "lw": 1.2 if few else 0.6}
        closure = np.linspace(*law.range, 200)
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
    what = "regions" if not isinstance(table.patches, PatchGrid) else "patches"
    rows = "; dots are their rows" if few else ""
    figure.suptitle(f"laws of {len(closing)} of {table.patches.count} {what}{rows}")
    return figure


def _law_colours(table: LawTable) -> tuple[Any, list[str]]:
    """Return the colour of each law, by its place on the face or its region, and its name."""
    patches = table.patches
    if not isinstance(patches, PatchGrid):
        return [PALETTE[i % len(PALETTE)] for i in range(patches.count)], list(patches.names)
    if patches.count == 1:
        return [BLUE], [""]
    return place_colours(patches.centres / np.array(patches.lengths)), [""] * patches.count


def _draw_places(axes: Any, table: LawTable, colours: Any) -> None:
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
