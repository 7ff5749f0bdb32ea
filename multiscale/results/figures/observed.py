"""Figures of what is read off load steps: leaks and natural modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from patchlaw.micro.transport import GapFlow, gap_flows
from patchlaw.multiscale.results.figures import style
from patchlaw.support import Array
from patchlaw.support.readable import percent, quantity, usual_unit

_CONTACT = "0.5"
"""Grey of what is in contact."""
_FLUID = ListedColormap(colormaps["Blues"](np.linspace(0.1, 0.62, 256)), name="fluid")
"""Colours of fluid pressures, on which flow lines are seen."""
_COLOURS = {"x": style.BLUE, "y": style.ORANGE, "face": style.BLUE}
"""Colours of curves by the way of the flow."""
_LOOKS = {"x": "o-", "y": "s-", "face": "o-"}
"""Markers and lines of these curves."""


@style.styled()
def leak_figure(
    history: Any, record: Any, section: Any, periodic: bool, fluid: Any = None
) -> Figure:
    """Draw the flow at the last recorded load step, and the leak at all of them.

    Args:
        history: A `multiscale.results.history.History`.
        record: A `multiscale.results.contacts.ContactRecord` with gaps of cells; None draws
            the curves alone.
        section: A `multiscale.scene.sections.LeakSection`.
        periodic: Whether the map continues over the sides along the flow.
        fluid: A `multiscale.observers.leak.FluidMap` of the last load step; None draws the
            curve alone.
    """
    over_face = section.between_edges
    ways = ["face"] if over_face else list(section.directions)
    if over_face and fluid is not None:
        return _face_figure(history, section, fluid)
    shown = section.directions if record is not None and not over_face else ()
    title = ""
    if shown:
        title = f"flow at load step {record.step}; grey: contact, white: gaps that no fluid reaches"
    if shown:
        plots = 2 if len(shown) == 2 else 1
        figure, axes = style.map_panels(record.lengths_mm, len(shown), plots, title=title)
    else:
        columns, width = (1, style.ONE_COLUMN) if over_face else (2, style.FULL_WIDTH)
        figure, axes = style.panels(1, columns, 2.9, width=width)
    flows = []
    if shown:
        gap = np.where(record.pressure_MPa > 0.0, 0.0, np.maximum(record.gap_mm, 0.0))
        along = ["xy".index(direction) for direction in shown]
        flows = gap_flows(gap, record.lengths_mm, axes=along, periodic=periodic)
    for place, direction, flow in zip(axes, shown, flows, strict=False):
        _draw_flow(place, flow, section)
        place.set_title(f"along {direction}: {_channel_text(flow)}")
    _draw_leak(axes[len(shown)], history, ways)
    if len(axes) > len(shown) + 1:
        _draw_factors(axes[-1], history, ways)
    return figure


def _face_figure(history: Any, section: Any, fluid: Any) -> Figure:
    """Draw the fluid pressure on a contact face at the last load step, and the leak at all."""
    triangles, pressure = fluid.triangles, fluid.pressure_MPa
    figure, (left, right) = style.panels(1, 2, 3.2, bars=[0])
    places = style.face_axes(left, triangles)
    wet = ~np.isnan(pressure).any(axis=1)
    dry = PolyCollection(places[~wet], facecolor=_CONTACT, edgecolor="none")
    left.add_collection(dry)
    name, unit = usual_unit(list(section.pressures), "MPa")
    first, second = sorted(one / unit for one in section.pressures)
    if wet.any():
        net = Triangulation(*places[wet].reshape(-1, 2).T, np.arange(3 * wet.sum()).reshape(-1, 3))
        values = pressure[wet].ravel() / unit
        look = {"cmap": "Blues", "vmin": first, "vmax": second, "shading": "gouraud"}
        image = left.tripcolor(net, values, rasterized=True, **look)
        style.colour_bar(image, left, f"fluid pressure [{name}]")
        levels = np.linspace(first, second, 9)[1:-1]
        if ((values.min() < levels) & (levels < values.max())).any():  # none of a closed leak
            left.tricontour(net, values, levels, colors=style.INK, linewidths=0.5)
    step = history.steps[-1]
    left.set_title(f"fluid at load step {step.step}")
    _draw_leak(right, history, ["face"])
    return figure


def _channel_text(flow: GapFlow) -> str:
    if flow.constriction is None:
        return "closed"
    return f"{percent(flow.constriction.share)} through the ring"


def _draw_flow(axes: Any, flow: GapFlow, section: Any) -> None:
    """Draw fluid pressure in blue, contact in grey, flow lines, and a ring about a constriction."""
    scale, _ = style.map_unit(flow.lengths)
    first, second = section.pressures
    pressure = second + flow.pressure * (first - second)
    contact, fluid = np.ma.masked_greater(flow.gap, 0.0), np.ma.masked_invalid(pressure)
    grey, ends = ListedColormap([_CONTACT]), (min(first, second), max(first, second))
    style.draw_image(axes, flow.lengths, 0.0 * contact, largest=False, cmap=grey)
    unit, look = usual_unit([first, second], "MPa"), {"ends": ends, "cmap": _FLUID}
    style.draw_image(axes, flow.lengths, fluid, "fluid pressure", unit, largest=False, **look)
    if flow.constriction is None:
        return
    _draw_lines(axes, flow, scale, 1.0 if first > second else -1.0)
    x, y = (scale * one for one in flow.constriction.place)
    axes.plot(x, y, "o", ms=9.0, mfc="none", mec=style.VERMILLION, mew=1.6, clip_on=False, zorder=5)


def _draw_lines(axes: Any, flow: GapFlow, scale: float, sign: float) -> None:
    """Draw flow lines, the thicker the more flows."""
    steps = [-(-count // 100) for count in flow.gap.shape]
    along, across = (sign * style.blocks_of(part, steps).mean(axis=(1, 3)) for part in flow.flux)
    x, y = (
        scale * (np.arange(count) + 0.5) * step * length / whole
        for count, step, length, whole in zip(
            along.shape, steps, flow.lengths, flow.gap.shape, strict=True
        )
    )
    speed = np.hypot(along, across)
    if not speed.max() > 0.0:
        return
    width = 0.25 + 1.2 * np.sqrt(speed / np.quantile(speed, 0.99))
    axes.streamplot(
        x, y, along.T, across.T, color=style.INK, linewidth=np.minimum(width, 1.6).T, density=1.1,
        arrowsize=0.5,
    )  # fmt: skip
    style.map_axes(axes, flow.lengths)


def _draw_leak(axes: Any, history: Any, ways: Sequence[str]) -> None:
    """Draw the leak over the mean pressure, with error bars; closed load steps at the bottom."""
    pressure, any_closed = history.mean_pressure_MPa, False
    for way in ways:
        rate, error = np.abs(_values(history, way, "rate")), _values(history, way, "error")
        leaks, error = rate > 0.0, np.nan_to_num(error)
        look: dict[str, Any] = {"color": _COLOURS[way], "ms": 3.0, "lw": 1.2, "elinewidth": 0.8}
        look |= {"fmt": _LOOKS[way], "label": f"along {way}"}
        axes.errorbar(pressure[leaks], rate[leaks], error[leaks], **look)
        closed = ~leaks & ~np.isnan(rate)
        any_closed |= bool(closed.any())
        # those along y stand below those along x
        mark: dict[str, Any] = {"mfc": "white", "clip_on": False, "color": _COLOURS[way]}
        low = np.full(closed.sum(), 0.03 if way == "y" else 0.07)
        axes.plot(pressure[closed], low, "v", transform=axes.get_xaxis_transform(), **mark)
        most = error[unsure := closed & (error > 0.0)]  # on cells that are fine enough
        look |= {"fmt": "_", "label": ""}
        axes.errorbar(pressure[unsure], most, [most, np.zeros(len(most))], **look)
    title = "leak" + "; triangles: closed" * any_closed
    axes.set(yscale="log", ylabel="leak [mm³/s]", title=title)
    _over_pressure(axes, pressure)
    if len(ways) > 1:
        axes.legend()


def _values(history: Any, way: str, part: str) -> Any:
    """Return a part of the leaks along a way at all load steps; NaN where it is not known."""
    leaks = [step.leak(way) for step in history]
    values = [None if leak is None else getattr(leak, part) for leak in leaks]
    return np.array(values, float)


def _draw_factors(axes: Any, history: Any, ways: Sequence[str]) -> None:
    """Draw the flow factors over the mean pressure."""
    pressure = history.mean_pressure_MPa
    for way in ways:
        factor = _values(history, way, "flow_factor")
        leaks = factor > 0.0
        axes.plot(pressure[leaks], factor[leaks], _LOOKS[way], ms=3.0, color=_COLOURS[way])
    axes.set(yscale="log", ylabel="flow factor T/ḡ³", title="against parallel plates")
    _over_pressure(axes, pressure)


def _over_pressure(axes: Any, pressure: Array) -> None:
    """Label axes, logarithmic upwards, over all load steps, whichever of them are drawn."""
    axes.set_xlim(0.0, 1.05 * float(np.max(pressure)) or None)
    style.logarithmic(axes.yaxis)
    style.show_unit(axes.xaxis, "mean pressure", "MPa", pressure)


_SHARE = 0.12
"""Largest displacement that is drawn, over the size of the bodies."""
_VIEW = {"elev": 22.0, "azim": -60.0}


@style.styled()
def modes_figure(rows: Sequence[Any], surfaces: Sequence[tuple[Array, Array]], load: Any) -> Figure:
    """Draw bodies as they move in their first modes, coloured by how far.

    Args:
        rows: A `multiscale.loading.column.Mode` each.
        surfaces: Of every body corners of its facets, shape (n, corners, 3) [mm], and their
            displacements in the modes, shape (modes, n, corners, 3).
        load: A `multiscale.results.history.History`.
    """
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # slow to import

    columns = min(3, len(rows))
    lines = -(-len(rows) // columns)
    figure = style.new_figure(style.FULL_WIDTH * columns / 3.0, 2.3 * lines)
    corners = np.concatenate([places.reshape(-1, 3) for places, _ in surfaces])
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    size = float(np.linalg.norm(upper - lower))
    lower, upper = lower - _SHARE * size, upper + _SHARE * size
    for k, row in enumerate(rows):
        axes: Any = figure.add_subplot(lines, columns, k + 1, projection="3d")
        largest = max(float(abs(moved[k]).max(initial=0.0)) for _, moved in surfaces) or 1.0
        for places, moved in surfaces:
            far = np.linalg.norm(moved[k], axis=-1).mean(axis=-1) / largest
            drawn = Poly3DCollection(
                places + _SHARE * size / largest * moved[k],
                facecolors=colormaps["viridis"](np.clip(far, 0.0, 1.0)),
                edgecolors="none" if len(places) > 3000 else "0.25",
                linewidths=0.15,
                rasterized=True,
            )
            axes.add_collection3d(drawn)
        axes.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
        axes.set_box_aspect(upper - lower, zoom=1.2)
        axes.view_init(**_VIEW)
        axes.set_axis_off()
        grows = f", grows by {-row.damping_per_s:.3g} 1/s" if row.damping_per_s < 0.0 else ""
        axes.set_title(f"mode {row.mode}: {quantity(row.frequency_Hz, 'Hz', 4)}{grows}")
    about = f"modes about load step {load.steps[-1].step}"
    figure.suptitle(f"{about}; yellow moves most, dark violet not at all")
    return figure
