"""The contact at one load step: maps of pressures, gaps, depths; sizes of spots; its shear."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure

from patchlaw.geometry import PatchGrid, Surface
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.surface import draw_surface
from patchlaw.support import Array
from patchlaw.support.readable import number, percent, shown_unit, usual, usual_unit

YIELDED = "0.35"
"""Colour of cells that bear the hardness."""
_SAME, _MANY = 1e-9, 0.05
"""Relative difference of pressures that are the same, and part of the contact from which on they
have a colour of their own."""
_STICK_TO_SLIP = LinearSegmentedColormap.from_list(
    "stick to slip", [style.BLUE, "0.9", style.VERMILLION]
)


def load_text(step: Any) -> str:
    """Return approach and force of a load step, as titles say them."""
    approach, force = usual(step.approach_mm, "mm"), usual(step.force_N, "N")
    return f"approach {approach}, force {force}"


@style.styled()
def contact_figure(record: Any, scales: Any = None) -> Figure:
    """Draw pressures, gaps and plastic depths as maps, and how large spots and values are.

    Spots without fields are drawn as circles of their areas, coloured by their largest pressures.

    Args:
        record: A `multiscale.results.contacts.ContactRecord`.
        scales: `multiscale.results.contacts.ContactScales`; those of this contact by default.
    """
    scales = scales or record.scales
    if record.pressure_MPa is None:
        figure, (spots, sizes, *_) = style.map_panels(record.lengths_mm, 1, 1, title=record.title)
        draw_contact(spots, record, scales)
        _draw_sizes(sizes, record)
        return figure
    figure, (sizes, shares) = _maps(record, scales, 1)
    _draw_sizes(sizes, record)
    more = "contact that bears more"
    _draw_shares(shares, record.pressure_MPa, "contact pressure", scales.pressure_unit, more)
    return figure


@style.styled()
def contact_maps(record: Any, scales: Any) -> Figure:
    """Draw pressures, gaps and plastic depths as maps; spots without fields as circles.

    Args:
        record: A `multiscale.results.contacts.ContactRecord`.
        scales: `multiscale.results.contacts.ContactScales`.
    """
    if record.pressure_MPa is None:
        return contact_figure(record, scales)
    return _maps(record, scales, 0)[0]


def _maps(record: Any, scales: Any, more_rows: int) -> tuple[Figure, list[Any]]:
    """Return a figure with the maps of a contact, and its two panels of each further row."""
    yields = record.plastic_depth_mm is not None
    maps, plots, title = 2 + yields, yields + 2 * more_rows, record.title
    figure, (pressures, gaps, *others) = style.map_panels(
        record.lengths_mm, maps, plots, title=title
    )
    draw_contact(pressures, record, scales)
    draw_gaps(gaps, record, scales.gap)
    if yields:
        depths, shares, *others = others
        depth, unit = np.asarray(record.plastic_depth_mm), usual_unit([scales.depth], "mm")
        most = f", at most {number(float(depth.max()) / unit[1], 3)} {unit[0]}" * bool(depth.any())
        if depth.any():
            _draw_depths(depths, record, depth, scales.depth, "plastic depth")
        else:
            style.map_axes(depths, record.lengths_mm)
            style.say(depths, "nothing has yielded")
        depths.set_title("plastic depth" + most)
        _draw_shares(shares, depth, "plastic depth", unit, "yielded area that is deeper")
    return figure, others


def draw_contact(axes: Any, record: Any, scales: Any = None) -> None:
    """Draw the map of contact pressures, white where there are none; of spots alone circles.

    Args:
        axes: Axes to draw into.
        record: A `multiscale.results.contacts.ContactRecord`.
        scales: `multiscale.results.contacts.ContactScales`; those of this contact by default.
    """
    scales = scales or record.scales
    if not record.force_N > 0.0:
        style.map_axes(axes, record.lengths_mm)
        style.say(axes, f"no contact:\nthe force at load step {record.step} is zero")
        axes.set_title("contact pressure")
        return
    if record.pressure_MPa is None:
        _draw_spots(axes, record, scales)
        return
    unit = scales.pressure_unit
    pressure, colours = np.asarray(record.pressure_MPa), style.PRESSURES
    peak, top = float(np.max(pressure)), scales.pressure
    title = f"contact pressure, at most {number(peak / unit[1], 3)} {unit[0]}"
    alike = pressure >= (1.0 - _SAME) * peak
    at_most = np.count_nonzero(alike) / np.count_nonzero(pressure > 0.0)
    if record.plastic_depth_mm is not None and at_most > _MANY:
        # they bear the hardness: their colour says so, and others have the scale
        colours, pressure = colours.with_extremes(over=YIELDED), np.where(alike, 2 * top, pressure)
        share = f"{percent(at_most, 2)} of the contact, in grey,"
        title = f"{share} bears {number(peak / unit[1], 3)} {unit[0]}"
    look: dict[str, Any] = {"ends": (0.0, top), "cmap": colours, "extend": "max"}
    shown = np.ma.masked_less_equal(pressure, 0.0)
    style.draw_image(axes, record, shown, "contact pressure", unit, **look)
    axes.set_title(title)


def draw_gaps(axes: Any, record: Any, top: float) -> None:
    """Draw the gaps of a contact on cells or on nodes.

    Args:
        axes: Axes to draw into.
        record: The contact, such as a `ContactRecord`.
        top: Gap of the darkest colour [mm].
    """
    closed = np.asarray(record.pressure_MPa) > 0.0
    shown = np.ma.masked_where(closed, np.maximum(np.asarray(record.gap_mm), 0.0))
    colours = style.GAPS.with_extremes(bad=style.VERMILLION)  # not behind what no triangle covers
    look: dict[str, Any] = {"ends": (0.0, top), "cmap": colours, "largest": False}
    style.draw_image(axes, record, shown, "gap", usual_unit([top], "mm"), **look)
    axes.set_title("gap; contact in orange" if closed.any() else "gap; no contact")


def _draw_depths(axes: Any, place: Any, depth: Any, top: float, what: str) -> None:
    """Draw depths by which heights are lower."""
    shown, unit = np.ma.masked_less_equal(depth, 0.0), usual_unit([top], "mm")
    style.draw_image(axes, place, shown, what, unit, ends=(0.0, top), cmap=style.DEPTHS)


def _draw_spots(axes: Any, record: Any, scales: Any) -> None:
    unit = style.map_axes(axes, record.lengths_mm)
    diameter = 2.0 * unit * np.sqrt(record.area_mm2 / np.pi)
    many = len(diameter) > 500  # whose outlines would hide their colours
    spots = EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=unit * record.place_mm,
        offset_transform=axes.transData, cmap=style.PRESSURES, lw=0.0 if many else 0.3,
        edgecolor="0.3", rasterized=many,
    )  # fmt: skip
    name, size = scales.pressure_unit
    spots.set_array(record.peak_pressure_MPa / size)
    spots.set_clim(0.0, scales.spot / size or 1.0)
    axes.add_collection(spots)
    style.colour_bar(spots, axes, f"largest pressure of the spot [{name}]")
    axes.set_title("spots, as circles of their areas")


def _draw_sizes(axes: Any, record: Any) -> None:
    """Draw how many spots have which area."""
    name, size = shown_unit(record.area_mm2, "mm²")
    axes.set(
        xlabel=f"area of a spot [{name}]", ylabel="number of spots", title="sizes of the spots"
    )
    exponent = np.log10(record.area_mm2 / size)
    if not exponent.size:
        axes.set(xticks=[], yticks=[])
        style.say(axes, "no spots")
        return
    low, high = np.floor(exponent.min()), np.floor(exponent.max()) + 1.0
    bins = np.logspace(low, high, int(8 * (high - low)) + 1)
    axes.hist(10.0**exponent, bins, color=style.BLUE, ec="white", lw=0.5)
    axes.set(xscale="log", xlim=(10.0**low, 10.0**high))
    style.logarithmic(axes.xaxis)
    axes.yaxis.get_major_locator().set_params(integer=True)


def _draw_shares(axes: Any, values: Any, text: str, unit: tuple[str, float], share: str) -> None:
    """Draw which share of the points with a value above zero has more than each value."""
    known, (name, size) = np.asarray(values)[np.asarray(values) > 0.0], unit
    axes.set(xlabel=f"{text} [{name}]", ylabel=f"{share} [%]", title=f"{text}s, by share")
    if not known.size:
        axes.set(xticks=[], yticks=[])
        style.say(axes, "none")
        return
    percents = np.linspace(0.0, 100.0, 401)
    axes.plot(np.percentile(known / size, 100.0 - percents), percents, color=style.BLUE)
    axes.set(xlim=(0.0, None), ylim=(0.0, 100.0))


@style.styled()
def pressure_figure(history: Any) -> Figure:
    """Draw the patch pressures of the last load step as a map, with their values.

    Args:
        history: A `multiscale.results.history.History`.
    """
    lengths = history.patches.lengths
    width = style.FULL_WIDTH if lengths[0] > 2.0 * lengths[1] else style.ONE_COLUMN
    figure, (axes,) = style.map_panels(lengths, 1, width=width)
    last = history.steps[-1]
    style.draw_pressures(axes, history.patches, last.patches.pressure_MPa)
    bar = f" ({history.reference.label})" if history.reference else ""
    axes.set_title(load_text(last) + bar)
    return figure


@style.styled()
def overview_figure(
    surface: Surface, is_sample: bool, history: Any, face: tuple[Array, Array] | None
) -> Figure:
    """Draw the surface beside the pressures on it: of cells, spots, the face or patches.

    Args:
        surface: The surface.
        is_sample: Whether it is a sample of a larger one.
        history: A `multiscale.results.history.History`.
        face: Facets of a face with laws of samples and their pressures, see `face_figure`; None
            without.
    """
    figure, (left, right) = style.map_panels(surface.lengths, 2)
    draw_surface(left, surface, None)
    left.set_title("surface" + " of a sample" * is_sample)
    record, last = history.contact, history.steps[-1]
    if record is not None:
        draw_contact(right, record)
    elif face is not None:
        style.draw_face(right, *face)
        right.set_title("contact pressure, averaged over the roughness")
    elif isinstance(history.patches, PatchGrid):
        style.draw_pressures(right, history.patches, last.patches.pressure_MPa)
        right.set_title("mean pressure of every patch; open ones white")
    else:
        right.axis("off")
    return figure


@style.styled()
def face_figure(facets: Array, pressures: Array, step: Any) -> Figure:
    """Draw the pressures on a contact face of any outline at a load step.

    Args:
        facets: Vertices of its facets, shape (n, 3 or 4, 2) [mm].
        pressures: Their mean pressures, shape (n,) [MPa].
        step: The load step.
    """
    figure, (axes,) = style.map_panels(np.ptp(facets, axis=(0, 1)), 1)
    style.draw_face(axes, facets, pressures)
    mean = usual(step.mean_pressure_MPa, "MPa", 3)
    axes.set_title(f"{load_text(step)}, mean pressure {mean}")
    return figure


@style.styled()
def shear_figure(history: Any, record: Any) -> Figure:
    """Draw which cells stick and slip, the tractions on them, and shear force over shift.

    Args:
        history: A `multiscale.results.history.History`.
        record: A `multiscale.results.contacts.ContactRecord` with tractions.
    """
    title = f"load step {record.step}: shear of the contact"
    figure, (cells, tractions, loop, lost) = style.map_panels(record.lengths_mm, 2, 2, title=title)
    _draw_cells(cells, record)
    _draw_tractions(tractions, record)
    _draw_loop(loop, history)
    _draw_lost(lost, history)
    return figure


@style.styled()
def worn_figure(surface: Surface, record: Any, slid: float) -> Figure:
    """Draw the heights as they were made and as they have worn, the depths, and a profile of both.

    Args:
        surface: The surface as it was made, on the cells of the contact.
        record: A `multiscale.results.contacts.ContactRecord` with worn depths.
        slid: Distance slid [mm].
    """
    depth, lengths = np.asarray(record.worn_depth_mm), surface.lengths
    before = surface.heights - surface.mean_height
    after = before - depth - (0.0 if record.plastic_depth_mm is None else record.plastic_depth_mm)
    title = f"load step {record.step}: worn over {usual(slid, 'mm')}"
    figure, (new, worn, depths, profile) = style.map_panels(lengths, 3, 1, title=title)
    unit, size = usual_unit([float(np.abs(before).max())], "mm")
    level = after - after.mean()  # as much may have worn off as the roughness is high
    look: dict[str, Any] = {"ends": (before.min(), before.max()), "cmap": style.HEIGHTS}
    for axes, heights, text in ((new, before, "new"), (worn, level, "worn, over its mean")):
        style.draw_image(axes, lengths, heights, "height", (unit, size), largest=False, **look)
        axes.set_title(text)
    _draw_depths(depths, lengths, depth, float(depth.max()), "worn depth")
    volume = float(depth.mean()) * float(np.prod(lengths))
    depths.set_title(f"worn depth, volume {number(volume, 3)} mm³")
    row = int(np.argmax(depth.sum(axis=0)))
    scaled, along = style.map_unit(lengths)
    profile.plot(scaled * surface.x, before[:, row] / size, color="0.6", label="new")
    profile.plot(scaled * surface.x, after[:, row] / size, color=style.VERMILLION, label="worn")
    at = number(scaled * float(surface.y[row]), 3)
    profile.set(xlabel=f"x [{along}]", ylabel=f"height [{unit}]")
    profile.set_title(f"row that has worn most, y = {at} {along}")
    profile.legend()
    return figure


@style.styled()
def face_shear_figure(history: Any, facets: Array, stress: Array, slips: Array) -> Figure:
    """Draw what of a contact face slips, its shear stresses, and shear force over shift.

    Args:
        history: A `multiscale.results.history.History`.
        facets: Vertices of the facets, shape (n, 3 or 4, 2) [mm].
        stress: Their mean shear stresses along the axes of the face, shape (n, 2) [MPa].
        slips: Share of their contact area that slips, shape (n,); NaN where nothing touches.
    """
    last, title = history.steps[-1], f"load step {history.steps[-1].step}: shear of the face"
    sides = tuple(np.ptp(facets, axis=(0, 1)).tolist())
    figure, (slipping, tractions, loop, lost) = style.map_panels(sides, 2, 2, title=title)
    shown, label = np.ma.masked_invalid(100.0 * slips), "slips, of the contact area [%]"
    style.draw_facets(slipping, facets, shown, 100.0, label, _STICK_TO_SLIP)
    part = (last.slip_area_fraction or 0.0) / (last.contact_area_fraction or 1.0)
    slipping.set_title(f"{percent(part, 3)} of the contact area slips")
    traction = np.where(np.isfinite(slips), np.hypot(*stress.T), 0.0)
    style.draw_face(tractions, facets, traction, "shear stress")
    tractions.set_title("shear stress, averaged over the roughness")
    _draw_loop(loop, history)
    _draw_lost(lost, history)
    return figure


def _draw_lost(axes: Any, history: Any) -> None:
    unit, size = usual_unit(np.nan_to_num(history.dissipated_mJ).tolist(), "mJ")
    axes.plot(history.step, history.dissipated_mJ / size, color=style.BLUE)
    axes.set(xlabel="load step", ylabel=f"lost to friction [{unit}]", title="energy lost so far")
    axes.xaxis.get_major_locator().set_params(integer=True)


def _draw_cells(axes: Any, record: Any) -> None:
    closed, slipping = record.pressure_MPa > 0.0, record.slipping
    shown = np.ma.masked_where(~closed, np.where(slipping, 1.0, 0.0))
    two = ListedColormap([style.BLUE, style.VERMILLION])
    style.draw_image(axes, record, shown, ends=(0.0, 1.0), cmap=two)
    slip = np.count_nonzero(slipping) / max(1, np.count_nonzero(closed))
    axes.set_title(f"blue sticks; {percent(slip, 3)} of the contact slips, in orange")


def _draw_tractions(axes: Any, record: Any) -> None:
    traction = np.hypot(*record.traction_MPa)
    unit = usual_unit([float(traction.max(initial=0.0))], "MPa")
    shown = np.ma.masked_where(record.pressure_MPa <= 0.0, traction)
    # few cells carry the largest tractions
    top = float(np.quantile(shown.compressed(), 0.99)) if shown.count() else unit[1]
    look: dict[str, Any] = {"ends": (0.0, top), "cmap": style.PRESSURES, "extend": "max"}
    style.draw_image(axes, record, shown, "tangential traction", unit, **look)
    axes.set_title("tangential traction")


def _draw_loop(axes: Any, history: Any) -> None:
    """Draw the force over the shift, both along the direction of the largest shift."""
    steps = [step for step in history.steps if step.shear_x_mm is not None]
    shift = np.array([(0.0, 0.0), *((step.shear_x_mm, step.shear_y_mm) for step in steps)])
    force = np.array(
        [(0.0, 0.0), *((step.shear_force_x_N, step.shear_force_y_N) for step in steps)]
    )
    farthest = shift[np.argmax(np.hypot(*shift.T))]
    size = float(np.hypot(*farthest))
    along = farthest / size if size else np.array([1.0, 0.0])
    x, y = shift @ along, force @ along
    names = [usual_unit(values.tolist(), unit) for values, unit in ((x, "mm"), (y, "N"))]
    axes.plot(x / names[0][1], y / names[1][1], color=style.BLUE, marker="o", ms=2.5)
    axes.set(xlabel=f"shift [{names[0][0]}]", ylabel=f"shear force [{names[1][0]}]")
    axes.set_title("shear force along the largest shift")
