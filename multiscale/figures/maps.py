"""Maps of a face: their axes and units, colour bars, borders of patches, colours by place."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from patchlaw.geometry.patches import PatchGrid
from patchlaw.multiscale.figures.style import BLUE, GREY, NO_CONTACT, ORANGE, PRESSURES
from patchlaw.multiscale.readable import number, usual_unit
from patchlaw.support.arrays import Array


def map_unit(lengths: tuple[float, float]) -> tuple[float, str]:
    """Return the number of units in a mm and the unit of x and y on maps, µm below 1 mm.

    Args:
        lengths: Sides of the map [mm].
    """
    return (1e3, "µm") if max(lengths) < 1.0 else (1.0, "mm")


def map_axes(axes: Any, lengths: tuple[float, float]) -> float:
    """Turn axes into those of a map that starts at the origin: to scale, framed, without a grid.

    Args:
        axes: The axes.
        lengths: Sides of the map [mm].

    Returns:
        The number of the map's units in a mm.
    """
    scale, unit = map_unit(lengths)
    axes.set(xlim=(0.0, scale * lengths[0]), ylim=(0.0, scale * lengths[1]), aspect="equal")
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]")
    axes.spines[:].set_visible(True)
    axes.grid(False)
    wide, _ = _drawn_inches(axes)
    if wide < 1.5:  # labels of the ticks would meet
        axes.locator_params(axis="x", nbins=max(1, int(wide / 0.4)))
    return scale


def draw_image(
    axes: Any, lengths: tuple[float, float], values: Any, *, largest: bool, **look: Any
) -> Any:
    """Draw a field of cells as a map, on few enough cells to be seen.

    Args:
        axes: Axes, which become those of a map.
        lengths: Sides of the face along x and y [mm].
        values: The field, shape (nx, ny); what is masked is not drawn.
        largest: Whether blocks of cells show their largest value instead of their mean.
        **look: Colours and their scale, as `imshow` takes them.
    """
    scale = map_axes(axes, lengths)
    extent = (0.0, scale * lengths[0], 0.0, scale * lengths[1])
    shown = coarsened(values, largest=largest).T
    return axes.imshow(shown, origin="lower", extent=extent, **look)


def _drawn_inches(axes: Any) -> tuple[float, float]:
    """Return width and height of axes as they are drawn, those of a map to scale [inch]."""
    wide, high = (side / axes.figure.dpi for side in (axes.bbox.width, axes.bbox.height))
    if axes.get_aspect() == "auto":
        return wide, high
    ratio = float(np.ptp(axes.get_ylim()) / np.ptp(axes.get_xlim()))
    return min(wide, high / ratio), min(high, wide * ratio)


def say(axes: Any, text: str) -> None:
    """Write into the middle of axes why they are empty.

    Args:
        axes: The axes.
        text: What to say.
    """
    middle = {"ha": "center", "va": "center", "transform": axes.transAxes}
    axes.text(0.5, 0.5, text, color=GREY, **middle)


def colour_bar(mappable: Any, axes: Any, label: str, *, extend: str = "neither") -> Any:
    """Draw a colour bar to the right of axes, exactly as tall as they are.

    Args:
        mappable: What the colours belong to.
        axes: The axes.
        label: What the colours show, with its unit.
        extend: ``"max"`` where values beyond the scale are drawn in its last colour.

    Returns:
        The colour bar.
    """
    inches, high = _drawn_inches(axes)
    wide = 0.11 / inches
    beside = axes.inset_axes((1.0 + 0.8 * wide, 0.0, wide, 1.0))
    beside.grid(False)
    bar = axes.figure.colorbar(mappable, cax=beside, extend=extend)
    text = fill(label, max(12, int(high / 0.06)))
    bar.set_label(text, labelpad=2.5 if "\n" in text else 4.0, linespacing=1.0)
    bar.locator = MaxNLocator(min(6, max(2, int(high / 0.25))), steps=[1, 2, 5, 10])
    return bar


def draw_patch_borders(axes: Any, patches: PatchGrid, colour: str = "0.7") -> None:
    """Draw the borders between patches.

    Args:
        axes: Axes of a map.
        patches: The partition of the interface.
        colour: Colour of the lines.
    """
    scale, _ = map_unit(patches.lengths)
    for draw, borders in ((axes.axvline, patches.borders_x), (axes.axhline, patches.borders_y)):
        for border in borders[1:-1]:
            draw(scale * border, color=colour, lw=0.6, alpha=0.9)


def draw_pressures(
    axes: Any,
    patches: PatchGrid,
    pressure: Array,
    *,
    top: float | None = None,
    label: str = "mean pressure of the patch",
) -> Any:
    """Draw one map of patch pressures; patches that carry nothing are white.

    Args:
        axes: Axes to draw into.
        patches: The partition of the interface.
        pressure: Mean pressure of each patch, shape (N,) [MPa].
        top: End of the colour scale, for maps that share one [MPa].
        label: Label of the colour bar, without the unit; empty draws none.

    Returns:
        The map, for a colour bar.
    """
    scale = map_axes(axes, patches.lengths)
    largest = float(pressure.max(initial=0.0)) if top is None else top
    unit, size = usual_unit([largest], "MPa")
    pressure, norm = pressure / size, Normalize(0.0, largest / size or 1.0)
    shown = np.ma.masked_less_equal(pressure, 0.0).reshape(patches.grid)
    axes.set_facecolor(NO_CONTACT)
    borders = scale * patches.borders_x, scale * patches.borders_y
    image = axes.pcolormesh(*borders, shown.T, cmap=PRESSURES, norm=norm)
    few = patches.count <= 36  # the numbers of more would cover each other
    image.set_rasterized(not few)
    draw_patch_borders(axes, patches)
    if few:
        for (x, y), value in zip(scale * patches.centres, pressure, strict=True):
            colour = "white" if value > 0.6 * norm.vmax else "black"
            axes.text(x, y, _number(value), ha="center", va="center", color=colour, fontsize=7)
    if not pressure.max(initial=0.0) > 0.0:
        say(axes, "no contact")
    elif label:
        colour_bar(image, axes, f"{label} [{unit}]")
    return image


def _number(value: float) -> str:
    """Return a pressure in few digits and without a power of ten; nothing for an open patch."""
    if value <= 0.0:
        return ""
    return f"{value:.0f}" if value >= 99.5 else number(value, 2)


def draw_face(axes: Any, points: NDArray[np.float64]) -> None:
    """Draw the pressures on a contact face of any outline.

    What bears no pressure is pale grey, so that the outline is seen.

    Args:
        axes: Axes to draw into.
        points: Columns x, y [mm] and pressure [MPa], shape (n, 3).
    """
    x, y, pressure = points[:: -(-len(points) // 40_000)].T
    lengths = float(np.ptp(x)), float(np.ptp(y))
    scale = map_axes(axes, lengths)
    half = scale * 0.55 * np.sqrt(lengths[0] * lengths[1] / len(x))  # they cover a rectangle
    places = scale * np.column_stack([x, y])
    low, high = places.min(axis=0) - half, places.max(axis=0) + half
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    look: dict[str, Any] = {"lw": 0, "rasterized": True}
    loaded = pressure > 0.0
    squares = places[:, None] + corners
    axes.add_collection(PolyCollection(squares[~loaded], facecolors="0.92", **look))
    if not loaded.any():
        say(axes, "no contact")
        return
    name, unit = usual_unit([float(pressure.max())], "MPa")
    drawn = PolyCollection(squares[loaded], array=pressure[loaded] / unit, cmap=PRESSURES, **look)
    drawn.set_clim(0.0, float(pressure.max()) / unit or 1.0)
    axes.add_collection(drawn)
    colour_bar(drawn, axes, f"contact pressure [{name}]")


def place_colours(shares: Array) -> Array:
    """Return colours by place on a face: from blue to orange along x, from dark to light along y.

    Args:
        shares: Places as shares of the face's sides, shape (n, 2), from 0 to 1.

    Returns:
        Red, green and blue, shape (n, 3).
    """
    x, y = np.clip(np.asarray(shares, float), 0.0, 1.0).T[:, :, None]
    colour = (1.0 - x) * np.array(to_rgb(BLUE)) + x * np.array(to_rgb(ORANGE))
    dark, light = np.clip(0.5 - y, 0.0, 0.5), np.clip(y - 0.5, 0.0, 0.5)
    found: Array = colour * (1.0 - 1.1 * dark) + (1.0 - colour) * 1.1 * light
    return found


def coarsened(values: Any, *, largest: bool, most: int = 420) -> Any:
    """Return a field on few enough cells to draw; what lies beyond whole blocks is left out.

    Args:
        values: The field, possibly masked, shape (nx, ny).
        largest: Whether a block shows its largest value, so that the smallest spots stay visible;
            else its mean, masked where one of its cells is.
        most: Largest number of cells a side.
    """
    step = -(-max(values.shape) // most)
    if step == 1:
        return values
    blocks = blocks_of(values, (step, step))
    if largest:
        return blocks.max(axis=(1, 3))
    hidden = np.ma.getmaskarray(blocks).any(axis=(1, 3))
    return np.ma.masked_where(hidden, blocks.mean(axis=(1, 3)))


def blocks_of(field: Any, steps: Sequence[int]) -> Any:
    """Return a field in blocks of cells, shape (mx, steps x, my, steps y); the rest is cut off.

    Args:
        field: The field, possibly masked, shape (nx, ny).
        steps: Cells of a block along x and y.
    """
    mx, my = (n // step for n, step in zip(field.shape, steps, strict=True))
    return field[: mx * steps[0], : my * steps[1]].reshape(mx, steps[0], my, steps[1])
