"""The contact at one load step: maps of pressure and gap, and the sizes of its spots."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import EllipseCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from multiscale.figures.style import COLOURS, map_unit, new_figure
from multiscale.readable import quantity

Array = NDArray[np.float64]

_PRESSURES = ListedColormap(colormaps["magma_r"](np.linspace(0.2, 1.0, 256)))
_GAPS = colormaps["cividis_r"].copy()
_GAPS.set_bad("#d1495b")
_SHOWN = 0.99
"""Part of the pressures within the colour scale; few cells carry the largest ones."""
_PER_DECADE = 8
"""Bars of the histogram per factor of ten in the area."""
_MOST_POINTS = 420
"""Cells a side of a map that is drawn; of more, the largest pressure of a block is shown."""


def contact_figure(record: Any) -> Figure:
    """Draw pressures and gaps as maps, and how large the spots are.

    Spots without fields are drawn as circles of their areas, coloured by their largest pressures.

    Args:
        record: A `multiscale.results.contact_record.ContactRecord`.
    """
    fields = record.pressure_MPa is not None
    figure = new_figure(13.5 if fields else 9.5, 4.2)
    panels = figure.subplots(1, 3 if fields else 2)
    if fields:
        _draw_pressures(figure, panels[0], record)
        _draw_gaps(figure, panels[1], record)
    else:
        _draw_spots(figure, panels[0], record)
    (width, depth), (scale, unit) = record.lengths_mm, map_unit(record.lengths_mm)
    for axes in panels[:-1]:
        axes.set(xlim=(0, width), ylim=(0, depth), aspect="equal")
        axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda place, _: f"{scale * place:g}")
    _draw_sizes(panels[-1], record)
    figure.suptitle(
        f"load step {record.step}: approach {1e3 * record.approach_mm:.3g} µm, "
        f"force {record.force_N:.4g} N, {len(record.spots)} spots"
    )
    return figure


def _draw_pressures(figure: Figure, axes: Any, record: Any) -> None:
    pressure = np.asarray(record.pressure_MPa)
    shown = np.ma.masked_less_equal(pressure, 0.0)
    top = float(np.quantile(shown.compressed(), _SHOWN)) if shown.count() else 1.0
    scale = Normalize(0.0, top)
    image = _draw_field(axes, record, shown, _PRESSURES, scale, largest=True)
    figure.colorbar(image, ax=axes, label="contact pressure [MPa]", extend="max")
    axes.set_title(f"pressure, at most {quantity(float(pressure.max()), 'MPa')}")


def _draw_gaps(figure: Figure, axes: Any, record: Any) -> None:
    closed = np.asarray(record.pressure_MPa) > 0.0
    gap = 1e3 * np.maximum(np.asarray(record.gap_mm), 0.0)
    shown = np.ma.masked_where(closed, gap)
    top = float(shown.max()) if not closed.all() else 1.0
    image = _draw_field(axes, record, shown, _GAPS, Normalize(0.0, top), largest=False)
    figure.colorbar(image, ax=axes, label="gap [µm]")
    axes.set_title("gap; contact in red")


def _draw_field(
    axes: Any, record: Any, values: Any, colours: Any, scale: Any, *, largest: bool
) -> Any:
    """Draw a field of cells as an image, one of nodes as triangles between them."""
    look: dict[str, Any] = {"cmap": colours, "norm": scale}
    if values.ndim == 2:
        width, depth = record.lengths_mm
        shown = _coarsened(values, largest=largest)
        extent = (0, width, 0, depth)
        return axes.imshow(shown.T, origin="lower", extent=extent, interpolation="nearest", **look)
    from matplotlib.tri import Triangulation

    mesh = Triangulation(record.x_mm, record.y_mm)
    whole = values[mesh.triangles]
    # a triangle belongs to the contact as soon as one of its nodes does
    filled = (
        whole.max(axis=1)
        if largest
        else np.ma.masked_where(np.ma.getmaskarray(whole).any(axis=1), whole.mean(axis=1))
    )
    return axes.tripcolor(mesh, facecolors=filled, **look)


def _coarsened(values: Any, *, largest: bool) -> Any:
    """Return a field on few enough cells; spots smaller than a pixel stay visible."""
    step = -(-max(values.shape) // _MOST_POINTS)
    if step == 1:
        return values
    nx, ny = (n // step * step for n in values.shape)
    blocks = values[:nx, :ny].reshape(nx // step, step, ny // step, step)
    if largest:
        return blocks.max(axis=(1, 3))
    closed = np.ma.getmaskarray(blocks).any(axis=(1, 3))
    return np.ma.masked_where(closed, blocks.mean(axis=(1, 3)))


def _draw_spots(figure: Figure, axes: Any, record: Any) -> None:
    diameter = 2.0 * np.sqrt(record.area_mm2 / np.pi)
    spots = EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=record.place_mm,
        offset_transform=axes.transData, cmap=_PRESSURES, lw=0.3, edgecolor="0.3",
    )  # fmt: skip
    spots.set_array(record.peak_pressure_MPa)
    spots.set_clim(0.0, float(record.peak_pressure_MPa.max(initial=0.0)) or 1.0)
    axes.add_collection(spots)
    figure.colorbar(spots, ax=axes, label="largest pressure of the spot [MPa]")
    axes.set_title("spots, as circles of their areas")


def _draw_sizes(axes: Any, record: Any) -> None:
    """Draw how many spots have which area."""
    axes.set(xlabel="area of a spot [µm²]", ylabel="number of spots")
    axes.set_title("sizes of the spots")
    exponent = np.log10(1e6 * record.area_mm2)
    if not exponent.size:
        return
    low, high = np.floor(exponent.min()), np.floor(exponent.max()) + 1.0
    bins = np.logspace(low, high, int(_PER_DECADE * (high - low)) + 1)
    axes.hist(10.0**exponent, bins, color=COLOURS["analytic"], ec="white", lw=0.5)
    axes.set(xscale="log", xlim=(10.0**low, 10.0**high))
    axes.yaxis.get_major_locator().set_params(integer=True)
