"""The style of all figures: palette, sizes, fonts, panels, maps, and how they are written.

Functions that draw are decorated by ``@styled()``; scripts call `use_style` once. All figures are
made by `new_figure`, in one of two widths, and written by `save`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager, ContextDecorator
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any, cast

import numpy as np
from matplotlib import colormaps, cycler, rc_context, rcParams, rcParamsDefault
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator
from matplotlib.transforms import ScaledTranslation

from patchlaw.geometry import PatchGrid
from patchlaw.support import Array
from patchlaw.support.readable import number, power_of_ten, shown_unit, usual_unit

BLUE, VERMILLION, GREEN, ORANGE = "#0072b2", "#d55e00", "#009e73", "#e69f00"
PURPLE, SKY, INK, GREY = "#cc79a7", "#56b4e9", "#222222", "#8c8c8c"
"""Colours of Okabe and Ito (2008), which people who confuse red and green tell apart, and greys."""

PALETTE = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, INK)
"""Colours of curves without a meaning of their own, in their order."""

KINDS = ("analytic", "isolated", "consistent", "concurrent", "reference")
COLOURS = dict(zip(KINDS, (SKY, VERMILLION, GREEN, BLUE, INK), strict=True))
"""Colour of each coupling."""

MARKERS = dict(zip(KINDS, "osD^*", strict=True))
"""Marker of each coupling."""

MODELS: dict[str, dict[str, Any]] = {
    "half-space": {"color": BLUE, "ls": "-", "marker": "^"},
    "elliptic": {"color": VERMILLION, "ls": "-", "marker": "s"},
    "circular": {"color": ORANGE, "ls": "-", "marker": "o"},
    "elliptic-independent": {"color": VERMILLION, "ls": "--", "marker": "s", "mfc": "white"},
    "circular-independent": {"color": ORANGE, "ls": "--", "marker": "o", "mfc": "white"},
}
"""Look of each micro model; those without interaction are dashed, with hollow markers."""

HEIGHTS = colormaps["cividis"]
"""Colours of heights."""
PRESSURES = ListedColormap(colormaps["YlOrRd"](np.linspace(0.12, 1.0, 256)), name="pressures")
"""Colours of contact pressures, from pale yellow; what carries none is `NO_CONTACT`."""
GAPS = ListedColormap(colormaps["Blues"](np.linspace(0.0, 0.85, 256)), name="gaps")
"""Colours of gaps, white where the sides nearly touch."""
DEPTHS = ListedColormap(colormaps["Purples"](np.linspace(0.25, 1.0, 256)), name="depths")
"""Colours of plastic depths, from pale purple; what has not yielded is white."""
STRESSES = colormaps["GnBu"]
"""Colours of stresses inside a body."""
NO_CONTACT = "white"
"""Colour of open patches and of what bears no pressure."""

ERROR_BAND = {"color": "#e8eaed", "zorder": 0}
"""Look of the band within an error bar, behind everything else."""

ONE_COLUMN, FULL_WIDTH = 3.5, 7.2
"""Widths of figures [inch]: of one column of a paper, and of its page."""

MARGINS = {"left": 0.62, "right": 0.14, "bar": 0.9, "below": 0.46, "above": 0.28, "title": 0.26}
"""Room around panels for their labels, for a colour bar, and for the title of a figure [inch]."""

_X_LABEL = 0.257
"""Distance of the labels of x from their axes [inch]."""
_PANEL_HEIGHT = 1.96
"""Height of a panel beside square maps [inch]."""
_OBLONG = 0.5
"""Ratio of the sides of a face from which on maps of it have rows of their own."""

DOTS_PER_INCH = 200
"""Resolution of PNG files."""

_LOGARITHMIC = " (log)"
"""End of the labels of logarithmic axes."""

_NOTEBOOK_DOTS = 100
"""Resolution of figures in notebooks, which hold them in their files."""

STYLE: dict[str, Any] = {
    "font.size": 8.0, "axes.titlesize": 8.5, "axes.labelsize": 8.0, "legend.fontsize": 7.5,
    "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "figure.titlesize": 9.0,
    "axes.prop_cycle": cycler(color=PALETTE), "text.color": INK, "axes.labelcolor": INK,
    "axes.edgecolor": "0.35", "xtick.color": "0.35", "ytick.color": "0.35",
    "xtick.labelcolor": INK, "ytick.labelcolor": INK,
    "axes.linewidth": 0.7, "xtick.major.width": 0.7, "ytick.major.width": 0.7,
    "axes.titley": 1.0, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "axes.axisbelow": True, "grid.color": "0.88", "grid.linewidth": 0.6,
    "lines.linewidth": 1.4, "lines.markersize": 4.0, "legend.frameon": False,
    "image.interpolation": "nearest", "image.cmap": "cividis",
    "savefig.dpi": DOTS_PER_INCH, "svg.hashsalt": "patchlaw", "pdf.fonttype": 42,
}  # fmt: skip
"""Parameters of matplotlib, as ``matplotlib.rcParams`` has them."""

_WHOLE_STYLE = {
    name: value for name, value in rcParamsDefault.items() if not name.startswith("backend")
} | STYLE
"""All parameters, whatever a file of the user's says: figures are the same everywhere."""

_FILES: dict[str, dict[str, Any]] = {
    "png": {"pil_kwargs": {"compress_level": 1}},  # 6, the usual one, takes 40 % longer
    "svg": {"metadata": {"Date": None}},
}
"""How files are written, by kind."""


def styled() -> Any:
    """Return a decorator, or context, in which matplotlib draws in this style."""
    return cast("AbstractContextManager[None] | ContextDecorator", rc_context(_WHOLE_STYLE))


def use_style() -> None:
    """Draw in this style from now on; for scripts, which own matplotlib's parameters."""
    rcParams.update(STYLE)


class StyledFigure(Figure):
    """A figure that is laid out and written in this style, whoever draws it."""

    def draw(self, renderer: Any) -> None:
        """Draw the figure, whose logarithmic axes say that they are."""
        for axis in (one for axes in self.axes for one in (axes.xaxis, axes.yaxis)):
            label = axis.get_label_text()
            if axis.get_scale() == "log" and label and not label.endswith(_LOGARITHMIC):
                axis.set_label_text(label + _LOGARITHMIC)
        with styled():
            super().draw(renderer)

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG, which notebooks show; they need not import pyplot for it."""
        content = BytesIO()
        self.savefig(content, format="png", dpi=_NOTEBOOK_DOTS)
        return content.getvalue()

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write the figure, by default in `DOTS_PER_INCH`."""
        with styled():
            super().savefig(fname, **options)


class _Ticks(MaxNLocator):
    """Ticks none of which is out of view, as matplotlib makes five objects for each."""

    def __call__(self) -> Any:
        """Return the places of the ticks."""
        low, high = sorted(self.axis.get_view_interval())
        slack = 1e-9 * (high - low)
        return [at for at in super().__call__() if low - slack <= at <= high + slack]


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, which shares no global state of matplotlib.

    Args:
        width: Width [inch], `ONE_COLUMN` or `FULL_WIDTH`.
        height: Height [inch].
    """
    return StyledFigure(figsize=(width, height), layout="constrained")


def panels(rows: int, columns: int, height: float, **about: Any) -> tuple[Figure, list[Any]]:
    """Return a figure with panels row by row, whose places are fixed before anything is drawn.

    Finding places that suit the labels takes longer than drawing. Here margins have room for labels
    of 7 digits.

    Args:
        rows: Number of rows.
        columns: Number of columns.
        height: Height of the figure [inch].
        **about: ``width`` of the figure [inch], `FULL_WIDTH` by default; ``bars``, the numbers of
            the panels that have a colour bar, from 0; ``below``, height below a panel for its
            labels [inch]; ``title`` of the figure.
    """
    return _in_rows([(columns, height / rows)] * rows, rows * columns, height=height, **about)


def panel_grid(
    count: int, height: float, *, title: str = "", each: int = 1
) -> tuple[Figure, list[Any]]:
    """Return a figure with groups of panels in rows of two or three groups.

    Args:
        count: Number of groups.
        height: Height of a row of panels [inch].
        title: Title of the figure.
        each: Number of panels of a group, which stand below each other.

    Returns:
        The figure, and the panels, group by group.
    """
    columns = 2 if count in (2, 4) else 3
    rows = -(-count // columns) * each
    figure, axes = panels(rows, columns, height * rows, title=title)
    groups = np.reshape(axes, (-1, each, columns)).swapaxes(1, 2).ravel()
    for spare in groups[count * each :]:
        spare.remove()
    return figure, list(groups[: count * each])


def map_panels(
    lengths: tuple[float, float],
    maps: int,
    plots: int = 0,
    *,
    width: float = FULL_WIDTH,
    below: float = MARGINS["below"],
    title: str = "",
) -> tuple[Figure, list[Any]]:
    """Return a figure with maps of one face, each with a colour bar, and then other panels.

    Rows are as high as the maps need. Oblong maps have rows of their own: one each where they are
    wide, all side by side where they are tall.

    Args:
        lengths: Sides of the face [mm].
        maps: Number of maps.
        plots: Number of other panels.
        width: Width of the figure [inch].
        below: Height below a panel for its labels [inch].
        title: Title of the figure.
    """
    ratio, around = lengths[1] / lengths[0], below + MARGINS["above"]

    def row(columns: int, most: float = _PANEL_HEIGHT) -> tuple[int, float]:
        wide = width / columns - MARGINS["left"] - MARGINS["bar"]
        return columns, around + min(max(wide * ratio, 0.25), most)

    plain = 2, around + _PANEL_HEIGHT
    if maps + plots == 1:
        rows = [row(1, 1.9 * _PANEL_HEIGHT)]
    elif ratio <= _OBLONG:
        columns = 3 if plots == 3 else 2
        rows = [row(1)] * maps + [(columns, plain[1])] * -(-plots // columns)
    elif ratio * _OBLONG >= 1.0:
        columns = max(2, maps)
        left = plots - (columns - maps)
        rows = [row(columns, 2.0 * _PANEL_HEIGHT)] + [plain] * -(-left // 2)
    else:
        rows = [row(2) if 2 * k + 1 < maps else plain for k in range(-(-(maps + plots) // 2))]
    look: dict[str, Any] = {"width": width, "below": below, "title": title}
    return _in_rows(rows, maps + plots, bars=range(maps), **look)


def _in_rows(
    rows: Sequence[tuple[int, float]],
    count: int,
    *,
    width: float = FULL_WIDTH,
    bars: Sequence[int] = (),
    below: float = MARGINS["below"],
    title: str = "",
    height: float = 0.0,
) -> tuple[Figure, list[Any]]:
    """Return a figure with rows of panels, of which the number and the height [inch] are given."""
    above = MARGINS["title"] * len(title.split("\n")) * bool(title)
    height = height or sum(high for _, high in rows) + above
    figure, top, axes = StyledFigure(figsize=(width, height)), height - above, list[Any]()
    scale = top / sum(high for _, high in rows)  # of rows that share a height with the title
    for columns, high in rows:
        top -= scale * high
        for column in range(columns):
            beside = MARGINS["left"] + MARGINS["bar" if len(axes) in bars else "right"]
            left = column * width / columns + MARGINS["left"]
            wide, tall = width / columns - beside, scale * high - below - MARGINS["above"]
            place = (left / width, (top + below) / height, wide / width, tall / height)
            axes.append(figure.add_axes(place))
            for axis, most in ((axes[-1].xaxis, wide / 0.31), (axes[-1].yaxis, tall / 0.21)):
                axis.set_major_locator(_Ticks(max(1, min(6, int(most))), steps=[1, 2, 2.5, 5, 10]))
            # a fixed place, as finding one takes as long as drawing the ticks anew
            under = ScaledTranslation(0.0, -_X_LABEL, figure.dpi_scale_trans)
            axes[-1].xaxis.set_label_coords(0.5, 0.0, axes[-1].transAxes + under)
    if title:
        figure.suptitle(title, y=1.0 - 0.08 / height)
    for spare in axes[count:]:
        spare.remove()
    return figure, axes[:count]


def encoded(figure: Figure, kinds: Sequence[str] = ("png",)) -> dict[str, bytes]:
    """Return a figure as the contents of files; equal figures give equal bytes.

    Args:
        figure: The figure.
        kinds: ``"png"``, with `DOTS_PER_INCH`, and ``"svg"``.

    Returns:
        The contents by kind.
    """
    contents = {}
    for kind in kinds:
        content = BytesIO()
        figure.savefig(content, format=kind, **_FILES[kind])
        contents[kind] = content.getvalue()
    return contents


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, and as SVG beside it; for scripts.

    Args:
        figure: The figure.
        path: The PNG file; its folder is made when missing.

    Returns:
        The PNG file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for kind, content in encoded(figure, ("png", "svg")).items():
        path.with_suffix(f".{kind}").write_bytes(content)
    return path


DRAWN = {"mm": 1e-3, "%": 0.01}
"""Sizes of the units that curves are drawn in, µm and %; others in their own unit."""


def show_unit(axis: Any, text: str, unit: str, values: Any) -> None:
    """Label an axis in the unit that suits its values, whatever unit they are drawn in.

    Args:
        axis: The x or y axis.
        text: What it shows, without the unit.
        unit: Unit of the values, mm, N or MPa, or "%" of shares.
        values: The values.
    """
    (name, size), drawn = shown_unit(np.ravel(values).tolist(), unit), DRAWN.get(unit, 1.0)
    axis.set_label_text(f"{text} [{name}]")
    if size != drawn:
        axis.set_major_formatter(lambda place, _: number(place * drawn / size))


def logarithmic(axis: Any) -> None:
    """Label a logarithmic axis, by more than powers of ten where these are too few.

    It has no ticks without labels, which took as long to draw as all the rest. Numbers far from 1
    are powers of ten, without mathtext, whose parser is slow.

    Args:
        axis: The x or y axis, with its limits.
    """
    low, high = axis.get_view_interval()
    if high < 5.0 * low:
        axis.set_major_locator(_Ticks(4))
    elif high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    far = high >= 100.0 * low and not 1e-4 < low < high < 1e5
    axis.set_major_formatter(
        lambda value, _: power_of_ten(round(math.log10(value))) if far else number(value)
    )
    axis.set_minor_locator(NullLocator())


def literal(text: str) -> str:
    """Return a text of the user's so that matplotlib takes no dollars in it for a formula."""
    return text.replace("$", r"\$")


def add_legend(figure: Figure) -> None:
    """Draw a legend in the first panel when it has more than one line."""
    first = figure.axes[0]
    if len(first.get_legend_handles_labels()[0]) > 1:
        first.legend()


def legend_above(figure: Figure) -> None:
    """Draw the legend of the first panel where the title of a figure stands."""
    handles = figure.axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="upper center", ncol=len(handles[0]))


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
    axes: Any,
    place: Any,
    values: Any,
    label: str = "",
    unit: tuple[str, float] = ("", 1.0),
    *,
    ends: tuple[float | None, float | None] = (None, None),
    largest: bool = True,
    extend: str = "neither",
    **look: Any,
) -> Any:
    """Draw a field of cells as an image, one of nodes as triangles, on few enough to be seen.

    Args:
        axes: Axes, which become those of a map.
        place: Sides of the face along x and y [mm], or a contact on nodes, a `ContactRecord`.
        values: The field, shape (nx, ny) or (n,); what is masked is not drawn.
        label: What the colour bar says, without the unit; empty draws none.
        unit: The unit that values are shown in, and its size.
        ends: Values of the first and of the last colour; those of the field by default.
        largest: Whether blocks of cells, and triangles, show their largest value instead of their
            mean.
        extend: As of `colour_bar`.
        **look: The colours, as `imshow` takes them.

    Returns:
        What is drawn, for a colour bar.
    """
    lengths, (name, size) = getattr(place, "lengths_mm", place), unit
    scale, shown = map_axes(axes, lengths), values / size
    low, high = (None if one is None else one / size for one in ends)
    look = {"vmin": low, "vmax": (high or 1.0) if low == 0.0 else high} | look
    if shown.ndim == 2:
        extent = (0.0, scale * lengths[0], 0.0, scale * lengths[1])
        shown = coarsened(shown, largest=largest).T
        image = axes.imshow(shown, origin="lower", extent=extent, **look)
    else:
        from matplotlib.tri import Triangulation

        mesh = Triangulation(scale * place.x_mm, scale * place.y_mm)
        corners = shown[mesh.triangles]
        open_ = np.ma.getmaskarray(corners).any(axis=1)
        # a triangle belongs to the contact as soon as one of its nodes does
        shown = corners.max(axis=1) if largest else np.ma.masked_where(open_, corners.mean(axis=1))
        image = axes.tripcolor(mesh, facecolors=shown, rasterized=True, **look)
    if label:
        colour_bar(image, axes, f"{label} [{name}]", extend=extend)
    return image


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
    bar.locator = _Ticks(min(6, max(2, int(high / 0.25))), steps=[1, 2, 5, 10])
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


def draw_face(axes: Any, facets: Array, pressures: Array, what: str = "contact pressure") -> None:
    """Draw the pressures on a contact face of any outline, facet by facet.

    What bears no pressure is pale grey, so that the outline is seen.

    Args:
        axes: Axes to draw into.
        facets: Vertices of the facets, shape (n, 3 or 4, 2) [mm].
        pressures: Their mean pressures, shape (n,) [MPa].
        what: What they are.
    """
    name, unit = usual_unit([float(pressures.max(initial=0.0))], "MPa")
    shown, label = np.ma.masked_less_equal(pressures / unit, 0.0), f"{what} [{name}]"
    draw_facets(axes, facets, shown, float(shown.max()) if shown.count() else 1.0, label)


def face_axes(axes: Any, facets: Array) -> Array:
    """Turn axes into those of a map of a face, and return its facets in the map's unit.

    Args:
        axes: The axes.
        facets: Vertices of the facets, shape (n, 3 or 4, 2) [mm].
    """
    places = map_axes(axes, tuple(np.ptp(facets, axis=(0, 1)).tolist())) * facets
    (left, front), (right, back) = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    axes.set(xlim=(left, right), ylim=(front, back))
    return places


def draw_facets(
    axes: Any, facets: Array, values: Any, top: float, label: str, colours: Any = PRESSURES
) -> None:
    """Draw values of the facets of a contact face; masked ones are pale grey.

    Args:
        axes: Axes to draw into.
        facets: Vertices of the facets, shape (n, 3 or 4, 2) [mm].
        values: Their values, masked where they do not touch, shape (n,).
        top: End of the colour scale, which begins at 0.
        label: What the colour bar says; empty draws none.
        colours: The colours.
    """
    places = face_axes(axes, facets)
    # hair lines close the gaps between neighbours
    look: dict[str, Any] = {"lw": 0.2, "edgecolors": "face", "rasterized": True}
    loaded = ~np.ma.getmaskarray(values)
    axes.add_collection(PolyCollection(places[~loaded], facecolors="0.92", **look))
    if not loaded.any():
        say(axes, "no contact")
        return
    drawn = PolyCollection(places[loaded], array=values[loaded], cmap=colours, **look)
    drawn.set_clim(0.0, top)
    axes.add_collection(drawn)
    if label:
        colour_bar(drawn, axes, label)


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


def means_at_corners(field: Array) -> Array:
    """Return the means of all four neighbours, shape (nx − 1, ny − 1)."""
    rows = field[1:] + field[:-1]
    return 0.25 * (rows[:, 1:] + rows[:, :-1])


def rounded_down(value: float, least: float = 1.0) -> float:
    """Return the largest of …, 1, 2, 5, 10, 20, … that is not above a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(least, next(lead * power for lead in (5, 2, 1) if lead * power <= value))
