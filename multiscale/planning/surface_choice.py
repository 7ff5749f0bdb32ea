"""Chooses the grid of a synthesised surface, and how much error its micro model may have."""

from __future__ import annotations

import math

from geometry.surface import Surface
from micro import MODELS
from micro.auto.errors import grid_error
from micro.auto.measures import contact_measures
from multiscale.ingredients import make_surface
from multiscale.planning.choices import accuracy_of, open_keys
from multiscale.planning.contact_estimate import nearest
from multiscale.planning.expected_errors import block_error, coupling_error
from multiscale.planning.micro_choice import estimated_contacts, estimated_plane
from multiscale.scene import Scene, SpectrumSection
from multiscale.stage_checks import block_cells, patch_grid

CELLS_PER_WAVE = (8, 12, 16, 24, 32, 48, 64)
"""Heights along the shortest wavelength that are tried."""

_FOR_SUMMITS = 16  # heights per wavelength that show the curvature of summits
_LEAST, _MOST = 32, 2048  # heights along a side
_LEAST_SHARE = 0.3  # of the accuracy, that is left to the micro model in any case
_SPARE = 0.9  # of the tolerance, that a grid is chosen for


def chosen_surface(given: Scene, scene: Scene) -> tuple[Scene, Surface]:
    """Return the coarsest grid whose half-space model is expected to do, and the surface on it.

    Args:
        given: The scene as it was given, with a spectrum and an open grid.
        scene: The same with values for its other open keys.
    """
    if scene.micro.model in MODELS:
        scene = _on(scene, _FOR_SUMMITS)
        return scene, make_surface(scene)
    coarse = _on(scene, CELLS_PER_WAVE[0])
    surface = make_surface(coarse)
    tolerance = _SPARE * micro_tolerance(given, coarse, surface)
    plane = nearest(estimated_plane(coarse, surface), surface)
    loads = [contact_measures(surface, part * plane, periodic=False) for part in (0.5, 1.0)]
    for cells in CELLS_PER_WAVE:
        scene = _on(scene, cells)
        factor = cells / CELLS_PER_WAVE[0]
        if max(grid_error(at, factor) for at in loads) <= tolerance:
            break
    return scene, make_surface(scene)


def micro_tolerance(given: Scene, scene: Scene, surface: Surface) -> float:
    """Return the error that the micro model may have, after what coupling and block leave.

    Args:
        given: The scene as it was given.
        scene: The scene with values for its open keys.
        surface: The surface, or one on another grid.
    """
    accuracy = accuracy_of(given)
    if scene.micro.tolerance is not None:
        return scene.micro.tolerance
    alone = given.accuracy is None and open_keys(given) <= {"micro.model"}
    if alone or scene.coupling.kind == "analytic":
        return accuracy
    at = estimated_contacts(scene, surface)
    rest = block_error(scene, block_cells(scene), patch_grid(scene), at)
    rest += coupling_error(scene, patch_grid(scene), max(surface.lengths), at)
    return max(accuracy - rest, _LEAST_SHARE * accuracy)


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


def _on(scene: Scene, cells: int) -> Scene:
    """Return the scene on a grid with so many heights along the shortest wavelength."""
    section = scene.surface
    if section.spectrum is None or section.lengths is None:  # refused when the scene was read
        return scene
    waves = _most_waves(section.spectrum, section.lengths)
    grid = tuple(min(max(8 * math.ceil(cells * k / 8), _LEAST), _MOST) for k in waves)
    return scene.model_copy(update={"surface": section.model_copy(update={"grid": grid})})
