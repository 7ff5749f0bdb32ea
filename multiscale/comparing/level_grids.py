"""Grids of the levels of a scene: heights of coarser surfaces, patches to compare on."""

from __future__ import annotations

from multiscale.scene import Scene, SpectrumSection
from multiscale.stage_checks import patch_grid

Grid = tuple[int, int]

FEWEST_HEIGHTS = 32
"""Heights along a side, at least, of coarser versions of a surface."""

HEIGHTS_PER_WAVE = 3
"""Heights per shortest wave of the spectrum, at least, of coarser versions."""


def pressure_grid(scene: Scene) -> Grid:
    """Return the patches that pressures are compared on: the scene's, divided to at least 4 × 4."""
    nx, ny = (count * -(-4 // count) for count in patch_grid(scene))
    return nx, ny


def coarser_grids(heights: Grid, spectrum: SpectrumSection | None) -> list[Grid]:
    """Return the grids that a surface can be made on, coarsest first.

    Args:
        heights: Its own grid, the last.
        spectrum: What it is made from; heights from a file are taken as they are.
    """
    grids = [heights]
    while spectrum is not None and all(count % 2 == 0 for count in grids[0]):
        coarser = (grids[0][0] // 2, grids[0][1] // 2)
        fewest = [max(FEWEST_HEIGHTS, HEIGHTS_PER_WAVE * count) for count in _shortest(spectrum)]
        if any(count < least for count, least in zip(coarser, fewest, strict=True)):
            break
        grids.insert(0, coarser)
    return grids


def _shortest(spectrum: SpectrumSection) -> tuple[float, float]:
    """Return the largest numbers of waves per side."""
    x, y = (band or spectrum.waves or (0.0, 0.0) for band in (spectrum.waves_x, spectrum.waves_y))
    return x[1], y[1]
