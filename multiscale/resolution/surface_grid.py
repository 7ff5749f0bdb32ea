"""Chooses the first grid of a synthesised surface, by its shortest wave."""

from __future__ import annotations

import math

from multiscale.scene.scene import Scene
from multiscale.scene.sections import SpectrumSection

MOST_HEIGHTS = 2048
"""Heights along a side, at most, of grids that are chosen."""

_LEAST = 32


def heights_per_wave(
    spectrum: SpectrumSection, grid: tuple[int, int], lengths: tuple[float, float]
) -> float:
    """Return the heights along the shortest wavelength of a spectrum.

    Args:
        spectrum: The spectrum.
        grid: Heights in x and y.
        lengths: Sides of the surface [mm].
    """
    waves = _most_waves(spectrum, lengths)
    return min(n / most for n, most in zip(grid, waves, strict=True))


def _most_waves(spectrum: SpectrumSection, lengths: tuple[float, float]) -> list[float]:
    """Return the most waves along each side."""
    if spectrum.waves is not None:  # counted along x
        return [spectrum.waves[1], spectrum.waves[1] * lengths[1] / lengths[0]]
    return [band[1] for band in (spectrum.waves_x, spectrum.waves_y) if band]


def on_waves(scene: Scene, cells: int) -> Scene:
    """Return a scene on a grid with so many heights along the shortest wavelength.

    Args:
        scene: The scene, of a spectrum.
        cells: Heights along a wave.
    """
    section = scene.surface
    if section.spectrum is None or section.lengths is None:  # refused when the scene was read
        return scene
    waves = _most_waves(section.spectrum, section.lengths)
    grid = tuple(min(max(8 * math.ceil(cells * k / 8), _LEAST), MOST_HEIGHTS) for k in waves)
    return scene.model_copy(update={"surface": section.model_copy(update={"grid": grid})})
