"""A surface: its map with summits and patches, heights, spectrum and bearing ratio."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from patchlaw.geometry.asperities import Asperities
from patchlaw.geometry.patches import PatchGrid
from patchlaw.geometry.spectrum import Spectrum, random_waves
from patchlaw.geometry.statistics import Roughness, power_spectrum, roughness
from patchlaw.geometry.surface import Surface
from patchlaw.multiscale.figures.style import (
    BLUE,
    GREY,
    HEIGHTS,
    INK,
    VERMILLION,
    colour_bar,
    draw_image,
    draw_patch_borders,
    map_panels,
    map_unit,
    plain_logarithmic,
    powers_of_ten,
    styled,
)
from patchlaw.multiscale.readable import usual, usual_unit
from patchlaw.support.arrays import Array

MOST_SUMMITS = 200
"""Summits that are marked on a map; of more, the highest, which come into contact first."""


@styled()
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
    figure, axes = map_panels(surface.lengths, 1, 3, below=0.6)
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
    unit, heights = _centred(surface)
    image = draw_image(axes, surface.lengths, heights, largest=False, cmap=HEIGHTS)
    colour_bar(image, axes, f"height over the mean plane [{unit}]")
    if patches is not None and 1 < patches.count <= 1024:
        draw_patch_borders(axes, patches, colour="white")
    title = f"{surface.grid[0]} × {surface.grid[1]} heights"
    if asperities is not None:
        title = _draw_summits(axes, asperities, map_unit(surface.lengths)[0])
    axes.set_title(title)


def _draw_summits(axes: Any, asperities: Asperities, scale: float) -> str:
    """Mark the highest summits and maxima of the border, and return a title that says so."""
    highest = np.argsort(-asperities.z, kind="stable")[:MOST_SUMMITS]
    lowest = asperities.z[highest].min() if len(highest) < len(asperities) else -np.inf
    edge = np.flatnonzero(asperities.border_z >= lowest)
    dot: dict[str, Any] = {"marker": "o", "ms": 3.0, "mfc": VERMILLION, "mec": "white", "mew": 0.4}
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
    axes.stairs(shares, edges, fill=True, color=BLUE, alpha=0.55, label="heights")
    if sq > 0.0:
        h = np.linspace(float(heights.min()), float(heights.max()), 200)
        normal = np.exp(-0.5 * (h / sq) ** 2) / (np.sqrt(2.0 * np.pi) * sq)
        axes.plot(h, normal, "--", color=INK, lw=1.1, label="normal distribution")
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
    axes.loglog(found.wavenumber[kept], found.density[kept], color=BLUE, label="surface", **few)
    if target is not None:
        waves, cell = random_waves(target, surface.lengths), 4.0 * np.pi**2 / surface.area
        q = 2.0 * np.pi * np.hypot(waves.kx / surface.lengths[0], waves.ky / surface.lengths[1])
        ends = [q.argmin(), q.argmax()]
        density = waves.amplitude[ends] ** 2 / cell
        axes.loglog(q[ends], density, "--", color=VERMILLION, lw=1.1, label="target")
        axes.legend()
    axes.set(xlabel="angular wavenumber [rad/mm]", ylabel="power spectral density [mm⁴]")
    axes.minorticks_off()  # drawing them takes as long as all the rest
    powers_of_ten(axes.xaxis)
    powers_of_ten(axes.yaxis)
    if axes.get_xlim()[1] < 100.0 * axes.get_xlim()[0]:
        plain_logarithmic(axes.xaxis)
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
    axes.plot(share, np.percentile(heights, 100.0 - share), color=BLUE)
    axes.axhline(0.0, color=GREY, lw=0.8, zorder=1)
    axes.set(xlabel="share of the surface above [%]", xlim=(0.0, 100.0))
    axes.set(
        ylabel=f"height over the mean plane [{unit}]", title="bearing ratio (Abbott–Firestone)"
    )


def _centred(surface: Surface) -> tuple[str, Array]:
    """Return the unit that suits the heights, and the heights over their mean in it."""
    heights = surface.heights - surface.mean_height
    name, size = usual_unit([float(np.abs(heights).max())], "mm")
    return name, heights / size
