"""A surface: its map, heights, spectrum and bearing ratio; in three dimensions its contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize, PowerNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from patchlaw.geometry.asperities import Asperities
from patchlaw.geometry.materials import von_mises
from patchlaw.geometry.patches import PatchGrid
from patchlaw.geometry.spectrum import Spectrum, random_waves
from patchlaw.geometry.statistics import Roughness, power_spectrum, roughness
from patchlaw.geometry.surface import Surface
from patchlaw.micro.closed_forms import stresses_below
from patchlaw.multiscale.results.figures import style
from patchlaw.support import Array
from patchlaw.support.readable import usual, usual_unit

MOST_SUMMITS = 200
"""Summits that are marked on a map; of more, the highest, which come into contact first."""


@style.styled()
def surface_figure(
    surface: Surface,
    asperities: Asperities | None,
    patches: PatchGrid,
    target: Spectrum | None = None,
    rough: Roughness | None = None,
) -> Figure:
    """Draw a surface: map, histogram of heights, power spectrum and bearing ratio.

    Args:
        surface: The heights.
        asperities: The summits of the surface; None leaves them out.
        patches: The partition of the interface.
        target: The spectrum that the surface was synthesised from; None for another surface.
        rough: The statistics of the surface, where they are known.
    """
    rough = rough or roughness(surface)
    figure, axes = style.map_panels(surface.lengths, 1, 3, below=0.6)
    map_, heights, spectrum, bearing = axes
    draw_surface(map_, surface, asperities, patches)
    draw_heights(heights, surface, rough)
    draw_spectrum(spectrum, surface, rough, target)
    draw_bearing_ratio(bearing, surface)
    return figure


def draw_surface(
    axes: Any, surface: Surface, asperities: Asperities | None, patches: PatchGrid | None = None
) -> None:
    """Draw the map of the heights, with the highest summits and the borders of patches.

    Args:
        axes: Axes to draw into.
        surface: The heights.
        asperities: The summits of the surface; None leaves them out.
        patches: The partition of the interface; None draws none.
    """
    (unit, heights), look = _centred(surface), {"largest": False, "cmap": style.HEIGHTS}
    label = "height over the mean plane"
    style.draw_image(axes, surface.lengths, heights, label, (unit, 1.0), **look)
    title = f"{surface.grid[0]} × {surface.grid[1]} heights"
    if patches is not None and 1 < patches.count <= 1024:
        style.draw_patch_borders(axes, patches, colour="white")
        title += "; lines: patches"
    if asperities is not None:
        title = _draw_summits(axes, asperities, style.map_unit(surface.lengths)[0])
    axes.set_title(title)


def _draw_summits(axes: Any, asperities: Asperities, scale: float) -> str:
    """Mark the highest summits and maxima of the border, and return a title that says so."""
    highest = np.argsort(-asperities.z, kind="stable")[:MOST_SUMMITS]
    lowest = asperities.z[highest].min() if len(highest) < len(asperities) else -np.inf
    edge = np.flatnonzero(asperities.border_z >= lowest)
    dot: dict[str, Any] = dict(marker="o", ms=3.0, mfc=style.VERMILLION, mec="white", mew=0.4)
    cross: dict[str, Any] = {"marker": "x", "ms": 3.0, "mew": 0.8, "color": "black"}
    for x, y, chosen, look, label in (
        (asperities.x, asperities.y, highest, dot, "summits"),
        (asperities.border_x, asperities.border_y, edge, cross, "maxima on the border, unused"),
    ):
        if chosen.size:
            place = scale * x[chosen], scale * y[chosen]
            axes.plot(*place, ls="none", label=label, clip_on=False, **look)
    if highest.size or edge.size:
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=3.8, ncol=2,
            handletextpad=0.2,
        )  # fmt: skip
    if len(highest) < len(asperities):
        return f"the {len(highest)} highest of {len(asperities):,} summits".replace(",", " ")
    return f"{len(asperities)} summits"


def draw_heights(axes: Any, surface: Surface, rough: Roughness) -> None:
    """Draw the histogram of the heights beside a normal distribution of the same rms height.

    Args:
        axes: Axes to draw into.
        surface: The heights.
        rough: Their statistics.
    """
    unit, centred = _centred(surface)
    heights = centred.ravel()
    sq, bins = float(np.std(heights)), min(80, max(10, int(heights.size**0.4)))
    shares, edges = np.histogram(heights, bins, density=True)
    axes.stairs(shares, edges, fill=True, color=style.BLUE, alpha=0.55, label="heights")
    if sq > 0.0:
        h = np.linspace(float(heights.min()), float(heights.max()), 200)
        normal = np.exp(-0.5 * (h / sq) ** 2) / (np.sqrt(2.0 * np.pi) * sq)
        axes.plot(h, normal, "--", color=style.INK, lw=1.1, label="normal distribution")
        axes.set_title(
            f"Sq {usual(rough.sq, 'mm', 3)}, skewness {rough.ssk:.2f}, kurtosis {rough.sku:.2f}"
        )
    axes.set(xlabel=f"height over the mean plane [{unit}]", ylabel=f"share of heights per {unit}")
    axes.legend(loc="upper left")
    axes.set_ylim(0.0, 1.25 * axes.get_ylim()[1])


def draw_spectrum(
    axes: Any, surface: Surface, rough: Roughness, target: Spectrum | None = None
) -> None:
    """Draw the radially averaged power spectral density.

    Args:
        axes: Axes to draw into.
        surface: The heights.
        rough: Their statistics.
        target: The spectrum that the surface was synthesised from; None draws none.
    """
    found = power_spectrum(surface)
    kept = found.density > 1e-8 * found.density.max()  # the rest is rounding
    few = dict(marker="o", ms=2.5) if kept.sum() <= 40 else {}
    axes.loglog(
        found.wavenumber[kept], found.density[kept], color=style.BLUE, label="surface", **few
    )
    if target is not None:
        waves, cell = random_waves(target, surface.lengths), 4.0 * np.pi**2 / surface.area
        q = 2.0 * np.pi * np.hypot(waves.kx / surface.lengths[0], waves.ky / surface.lengths[1])
        ends = [q.argmin(), q.argmax()]
        density = waves.amplitude[ends] ** 2 / cell
        axes.loglog(q[ends], density, "--", color=style.VERMILLION, lw=1.1, label="target")
        axes.legend()
    axes.set(xlabel="angular wavenumber [rad/mm]", ylabel="power spectral density [mm⁴]")
    style.logarithmic(axes.xaxis)
    style.logarithmic(axes.yaxis)
    axes.set_title(f"rms gradient {rough.sdq:.3g}")


def draw_bearing_ratio(axes: Any, surface: Surface) -> None:
    """Draw the bearing ratio of Abbott and Firestone: the share of the surface above a height.

    Args:
        axes: Axes to draw into.
        surface: The heights.

    Source: ISO 25178-2, areal material ratio.
    """
    share = np.linspace(0.0, 100.0, 401)
    unit, heights = _centred(surface)
    axes.plot(share, np.percentile(heights, 100.0 - share), color=style.BLUE)
    axes.axhline(0.0, color=style.GREY, lw=0.8, zorder=1)
    axes.set(xlabel="share of the surface above [%]", ylabel=f"height over the mean plane [{unit}]")
    axes.set(xlim=(0.0, 100.0), title="bearing ratio (Abbott–Firestone)")


def _centred(surface: Surface) -> tuple[str, Array]:
    """Return the unit that suits the heights, and the heights over their mean in it."""
    heights = surface.heights - surface.mean_height
    name, size = usual_unit([float(np.abs(heights).max())], "mm")
    return name, heights / size


@style.styled()
def block_figure(
    surface: Surface, pressure: Array, poisson_ratio: float, *, title: str = ""
) -> Figure:
    """Draw a rough surface with its contacts, cut along the row of cells that carries most.

    The stresses on the cut are those of a half-space under the pressures.

    Args:
        surface: The surface.
        pressure: Contact pressures of its cells, shape (nx, ny) [MPa].
        poisson_ratio: Poisson's ratio of the body.
        title: What the figure shows.
    """
    view = BlockView(surface, pressure, poisson_ratio)
    figure = style.new_figure(style.FULL_WIDTH, 4.65)
    figure.set_layout_engine("none")  # axes are placed by hand
    axes = figure.add_axes((0.04, 0.0, 0.81, 0.93))
    view.draw(axes)
    for at, scale, colours, label in (
        (0.56, view.pressures, style.PRESSURES, "contact pressure [MPa]"),
        (0.10, view.stresses, style.STRESSES, "von Mises stress [MPa]\n(square-root scale)"),
    ):
        bar = figure.add_axes((0.86, at, 0.02, 0.32))
        bar.grid(False)
        figure.colorbar(ScalarMappable(scale, colours), cax=bar).set_label(label)
    figure.text(0.03, 0.95, title, fontsize=9)
    times = view.exaggeration
    drawn = "to scale" if times == 1.0 else f"heights exaggerated {times:g} times"
    said = f"cut along the row that carries most, half-space stresses; undeformed, {drawn}"
    figure.text(0.03, 0.905, said, fontsize=8, color="0.35")
    return figure


def contact_block(surface: Surface, record: Any, poisson_ratio: float) -> Figure:
    """Draw a rough surface with the contact of a load step, see `block_figure`.

    Args:
        surface: The surface.
        record: A `multiscale.results.contacts.ContactRecord` with pressures of its cells.
        poisson_ratio: Poisson's ratio of the body.
    """
    pressure = np.asarray(record.pressure_MPa)
    return block_figure(surface, pressure, poisson_ratio, title=record.title)


class BlockView:
    """Everything that is drawn, in µm; seen from the front right corner above.

    Args:
        surface: The surface.
        pressure: Contact pressures of its cells, shape (nx, ny) [MPa].
        poisson_ratio: Poisson's ratio of the body.
    """

    def __init__(self, surface: Surface, pressure: Array, poisson_ratio: float) -> None:
        lengths = 1e3 * np.asarray(surface.lengths)
        steps = [-(-count // 256) for count in surface.grid]
        height = style.blocks_of(surface.heights - surface.mean_height, steps).mean(axis=(1, 3))
        largest = style.blocks_of(pressure, steps).max(axis=(1, 3))
        loads = style.blocks_of(pressure, steps).mean(axis=(1, 3))
        row = int(loads.sum(axis=0).argmax())
        # what lies behind the cut is shown: the larger part, from the other side if need be
        self.turned = row >= largest.shape[1] / 2
        if self.turned:
            height, largest, loads = (field[::-1, ::-1] for field in (height, largest, loads))
            row = largest.shape[1] - 1 - row
        self.size = lengths
        self.x, self.y = (
            length * (np.arange(n + 1) / n) for length, n in zip(lengths, height.shape, strict=True)
        )
        side = float(min(lengths))
        self.exaggeration = style.rounded_down(0.12 * side / (1e3 * float(np.ptp(height)) or 1.0))
        self.depth = 0.35 * side
        layers = np.linspace(0.0, 1.0, 41)  # narrow near the surface
        self.layers = self.depth * layers**2
        spacing = surface.lengths[0] / height.shape[0], surface.lengths[1] / height.shape[1]
        below = stresses_below(loads, spacing, poisson_ratio, 1e-3 * self.layers, row)
        self.stress = von_mises(below).T
        self.row = row
        self.pressure = largest[:, row:]
        relief = 1e3 * self.exaggeration * np.pad(height, 1, mode="edge")
        self.relief = style.means_at_corners(relief)[:, row:]
        self.pressures = Normalize(0.0, float(pressure.max()) or 1.0)
        self.stresses = PowerNorm(0.5, 0.0, float(self.stress.max()) or 1.0)

    def seen(self, x: Any, y: Any, z: Any) -> tuple[Array, Array]:
        """Return where points appear on the page, without perspective."""
        x, y, z = (np.asarray(part, float) for part in (x, y, z))
        turn, elevation = np.radians((24.0, 32.0))
        across = -x * np.sin(turn) + y * np.cos(turn)
        along = x * np.cos(turn) + y * np.sin(turn)
        return along, z * np.cos(elevation) + across * np.sin(elevation)

    def draw(self, axes: Any) -> None:
        """Draw the cut block into empty axes, which lose their own."""
        axes.set_aspect("equal")
        axes.axis("off")
        self.draw_side(axes)
        self.draw_cut(axes)
        self.draw_top(axes)
        self.draw_edges(axes)

    def draw_top(self, axes: Any) -> None:
        """Draw the surface in grey, lit from the left, and the contacts in their pressures."""
        y = self.y[self.row :]
        light = LightSource(azdeg=300, altdeg=40)
        middle = style.means_at_corners(self.relief)
        shade = light.hillshade(middle.T, dx=self.x[1], dy=self.y[1], fraction=1.0).T
        grey = 0.45 + 0.5 * shade
        colour = np.stack([grey, grey, grey * 0.98, np.ones_like(grey)], axis=-1)
        loaded = self.pressure > 0.0
        colour[loaded] = style.PRESSURES(self.pressures(self.pressure[loaded]))
        self._draw(axes, self.x[:, None], y, self.relief, colour)

    def draw_cut(self, axes: Any) -> None:
        """Draw the stresses on the cut along x."""
        share, (lx, _) = 1.0 - self.layers / self.depth, self.size
        x = 0.5 * (self.x[1:] + self.x[:-1])
        x[[0, -1]] = 0.0, lx
        top = np.interp(x, self.x, self.relief[:, 0])
        places = self.seen(x[:, None], self.y[self.row], -self.layers + top[:, None] * share)
        mesh = axes.pcolormesh(
            *np.broadcast_arrays(*places), self.stress, cmap=style.STRESSES, norm=self.stresses,
            shading="gouraud",
        )  # fmt: skip
        mesh.set_rasterized(True)

    def draw_side(self, axes: Any) -> None:
        """Draw the side of the block that is not cut, in one colour."""
        y = self.y[self.row :]
        low = np.full(len(y), -self.depth)
        a, b = self.seen(self.size[0], y, self.relief[-1]), self.seen(self.size[0], y, low)
        axes.fill(np.append(a[0], b[0][::-1]), np.append(a[1], b[1][::-1]), color="#d9d9d6", lw=0)

    def _draw(self, axes: Any, x: Any, y: Any, z: Array, colour: Array) -> None:
        """Draw a patch of a surface by quadrangles, those far away first."""
        sx, sy = (np.broadcast_to(part, z.shape) for part in self.seen(x, y, z))
        far_first = slice(None, None, -1)
        mesh = axes.pcolormesh(
            sx.T[far_first], sy.T[far_first], np.zeros(colour.shape[1::-1]), shading="flat"
        )
        mesh.set_array(None)
        mesh.set_facecolor(np.swapaxes(colour, 0, 1)[far_first].reshape(-1, 4))
        mesh.set_edgecolor("face")
        mesh.set_linewidth(0.1)
        mesh.set_rasterized(True)

    def draw_edges(self, axes: Any) -> None:
        """Draw the edges of the block below, with ticks, and what they measure."""
        (lx, ly), front, low = self.size, self.y[self.row], -self.depth
        line: dict[str, Any] = {"color": "0.25", "lw": 0.7, "solid_capstyle": "round"}
        axes.plot(*self.seen(self.x, front, self.relief[:, 0]), **line)
        axes.plot(*self.seen(lx, self.y[self.row :], self.relief[-1]), **line)
        for ends in (
            ((0, front, low), (lx, front, low)),
            ((lx, front, low), (lx, ly, low)),
            ((0, front, low), (0, front, self.relief[0, 0])),
            ((lx, front, low), (lx, front, self.relief[-1, 0])),
            ((lx, ly, low), (lx, ly, self.relief[-1, -1])),
        ):
            axes.plot(*self.seen(*np.transpose(ends)), **line)
        tick = 0.01 * float(sum(self.size))
        x, y = (
            [(value, length - value if self.turned else value) for value in _ticks(length, 5)]
            for length in self.size
        )
        for value, at, out, sides in (
            *((v, (at, front, low), (0, -tick, 0), ("center", "top")) for v, at in x),
            *((v, (lx, at, low), (tick, 0, 0), ("left", "top")) for v, at in y if at >= front),
            *((v, (0, front, -v), (-tick, 0, 0), ("right", "center")) for v in _ticks(-low, 3)),
        ):
            axes.plot(*self.seen(*np.transpose([at, np.add(at, out)])), color="0.25", lw=0.7)
            place = self.seen(*np.add(at, np.multiply(1.6, out)))
            axes.text(*place, f"{value:g}", fontsize=7, ha=sides[0], va=sides[1])
        for at, text, turn, ha in (
            ((0.5 * lx, front - 7 * tick, low), "x [µm]", -12, "center"),
            ((lx + 9 * tick, 0.5 * (front + ly), low), "y [µm]", 45, "center"),
            ((-7.5 * tick, front, 0.5 * low), "depth [µm]", 90, "center"),
        ):
            axes.text(*self.seen(*at), text, fontsize=8, rotation=turn, ha=ha, va="center")
        axes.margins(x=0.08, y=0.06)


def _ticks(length: float, most: int) -> list[float]:
    """Return round numbers from 0 to a length."""
    return [one for one in MaxNLocator(most).tick_values(0, length) if 0 <= one <= length]
