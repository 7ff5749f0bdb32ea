"""The contact at one load step: maps of pressures and gaps, sizes of spots, share of pressures."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from geometry.surface import Surface
from multiscale.figures.maps import coarsened, colour_bar, draw_face, draw_pressures, map_axes
from multiscale.figures.style import (
    BLUE,
    GAPS,
    ONE_COLUMN,
    PRESSURES,
    VERMILLION,
    panels,
    styled,
)
from multiscale.figures.surface import draw_surface
from multiscale.readable import quantity, usual_unit


def load_text(step: Any) -> str:
    """Return approach and force of a load step, as titles say them."""
    return f"approach {quantity(step.approach_mm, 'mm')}, force {quantity(step.force_N, 'N')}"


def record_text(record: Any) -> str:
    """Return what a recorded contact is of, as titles say it."""
    return f"load step {record.step}: {load_text(record)}, {len(record.spots)} spots"


@styled()
def contact_figure(record: Any) -> Figure:
    """Draw pressures and gaps as maps, and how large spots and pressures are.

    Spots without fields are drawn as circles of their areas, coloured by their largest pressures.

    Args:
        record: A `multiscale.results.contact_record.ContactRecord`.
    """
    fields = record.pressure_MPa is not None
    if not fields:
        figure, (spots, sizes) = panels(1, 2, 2.9, bars=[0], title=record_text(record))
        draw_contact(spots, record)
    else:
        figure, (pressures, gaps, sizes, shares) = panels(
            2, 2, 5.4, bars=[0, 1], title=record_text(record)
        )
        draw_contact(pressures, record)
        _draw_gaps(gaps, record)
        _draw_shares(shares, record)
    _draw_sizes(sizes, record)
    return figure


def draw_contact(axes: Any, record: Any) -> None:
    """Draw the map of contact pressures, white where there are none; of spots alone circles.

    Args:
        axes: Axes to draw into.
        record: A `multiscale.results.contact_record.ContactRecord`.
    """
    if record.pressure_MPa is None:
        _draw_spots(axes, record)
        return
    unit, pressure = _in_unit(np.asarray(record.pressure_MPa), "MPa")
    shown = np.ma.masked_less_equal(pressure, 0.0)
    # few cells carry the largest pressures
    top = float(np.quantile(shown.compressed(), 0.99)) if shown.count() else 1.0
    image = _draw_field(axes, record, shown, PRESSURES, Normalize(0.0, top), largest=True)
    colour_bar(image, axes, f"contact pressure [{unit}]", extend="max")
    peak = quantity(float(np.max(record.pressure_MPa)), "MPa", 3)
    axes.set_title(f"contact pressure, at most {peak}")


def _draw_gaps(axes: Any, record: Any) -> None:
    closed = np.asarray(record.pressure_MPa) > 0.0
    unit, gap = _in_unit(np.maximum(np.asarray(record.gap_mm), 0.0), "mm")
    shown = np.ma.masked_where(closed, gap)
    top = float(shown.max()) if not closed.all() else 1.0
    axes.set_facecolor(VERMILLION)
    image = _draw_field(axes, record, shown, GAPS, Normalize(0.0, top), largest=False)
    colour_bar(image, axes, f"gap [{unit}]")
    axes.set_title("gap; contact in red")


def _draw_field(
    axes: Any, record: Any, values: Any, colours: Any, scale: Any, *, largest: bool
) -> Any:
    """Draw a field of cells as an image, one of nodes as triangles between them."""
    look: dict[str, Any] = {"cmap": colours, "norm": scale}
    unit = map_axes(axes, record.lengths_mm)
    if values.ndim == 2:
        width, depth = record.lengths_mm
        extent = (0.0, unit * width, 0.0, unit * depth)
        return axes.imshow(
            coarsened(values, largest=largest).T, origin="lower", extent=extent, **look
        )
    from matplotlib.tri import Triangulation

    mesh = Triangulation(unit * record.x_mm, unit * record.y_mm)
    whole = values[mesh.triangles]
    # a triangle belongs to the contact as soon as one of its nodes does
    filled = (
        whole.max(axis=1)
        if largest
        else np.ma.masked_where(np.ma.getmaskarray(whole).any(axis=1), whole.mean(axis=1))
    )
    return axes.tripcolor(mesh, facecolors=filled, rasterized=True, **look)


def _draw_spots(axes: Any, record: Any) -> None:
    unit = map_axes(axes, record.lengths_mm)
    diameter = 2.0 * unit * np.sqrt(record.area_mm2 / np.pi)
    many = len(diameter) > 500  # whose outlines would hide their colours
    spots = EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=unit * record.place_mm,
        offset_transform=axes.transData, cmap=PRESSURES, lw=0.0 if many else 0.3, edgecolor="0.3",
        rasterized=many,
    )  # fmt: skip
    name, pressure = _in_unit(record.peak_pressure_MPa, "MPa")
    spots.set_array(pressure)
    spots.set_clim(0.0, float(pressure.max(initial=0.0)) or 1.0)
    axes.add_collection(spots)
    colour_bar(spots, axes, f"largest pressure of the spot [{name}]")
    axes.set_title("spots, as circles of their areas")


def _draw_sizes(axes: Any, record: Any) -> None:
    """Draw how many spots have which area."""
    axes.set(xlabel="area of a spot [µm²]", ylabel="number of spots", title="sizes of the spots")
    exponent = np.log10(1e6 * record.area_mm2)
    if not exponent.size:
        return
    low, high = np.floor(exponent.min()), np.floor(exponent.max()) + 1.0
    bins = np.logspace(low, high, int(8 * (high - low)) + 1)
    axes.hist(10.0**exponent, bins, color=BLUE, ec="white", lw=0.5)
    axes.set(xscale="log", xlim=(10.0**low, 10.0**high))
    axes.minorticks_off()
    axes.yaxis.get_major_locator().set_params(integer=True)


def _draw_shares(axes: Any, record: Any) -> None:
    """Draw which share of the contact bears more than a pressure."""
    unit, pressure = _in_unit(np.asarray(record.pressure_MPa), "MPa")
    axes.set(xlabel=f"contact pressure [{unit}]", ylabel="contact that bears more [%]")
    axes.set_title("pressures in the contact")
    loaded = np.sort(pressure[pressure > 0.0], axis=None)
    if loaded.size:
        share = np.linspace(0.0, 100.0, 401)
        axes.plot(np.percentile(loaded, 100.0 - share), share, color=BLUE)
        axes.set(xlim=(0.0, None), ylim=(0.0, 100.0))


def _in_unit(values: Any, unit: str) -> tuple[str, Any]:
    """Return the unit that suits the largest of values, and the values in it."""
    name, size = usual_unit([float(np.max(values, initial=0.0))], unit)
    return name, values / size


@styled()
def pressure_figure(history: Any) -> Figure:
    """Draw the patch pressures of the last load step as a map, with their values.

    Args:
        history: A `multiscale.results.history.History`.
    """
    figure, (axes,) = panels(1, 1, 2.9, width=ONE_COLUMN, bars=[0])
    last = history.steps[-1]
    draw_pressures(axes, history.patches, last.patches.pressure_MPa)
    bar = f" ({history.reference.label})" if history.reference else ""
    axes.set_title(load_text(last) + bar)
    return figure


@styled()
def overview_figure(
    surface: Surface, is_sample: bool, history: Any, face: NDArray[np.float64] | None
) -> Figure:
    """Draw the surface beside the pressures on it: of cells, spots, the face or patches.

    Args:
        surface: The surface.
        is_sample: Whether it is a sample of a larger one.
        history: A `multiscale.results.history.History`.
        face: Pressures on a face with laws of samples, see `face_figure`; None without.
    """
    figure, (left, right) = panels(1, 2, 2.8, bars=[0, 1])
    draw_surface(left, surface, None)
    left.set_title("surface" + " of a sample" * is_sample)
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
def face_figure(points: NDArray[np.float64], step: Any) -> Figure:
    """Draw the pressures on a contact face of any outline at a load step.

    Args:
        points: Columns x, y [mm] and pressure [MPa], shape (n, 3).
        step: The load step.
    """
    figure, (axes,) = panels(1, 1, 4.2, bars=[0])
    draw_face(axes, points)
    mean = quantity(step.mean_pressure_MPa, "MPa", 3)
    axes.set_title(f"{load_text(step)}, mean pressure {mean}")
    return figure
