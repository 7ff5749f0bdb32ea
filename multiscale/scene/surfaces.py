"""The surface of a scene, of one side or of both, and the samples of its laws.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.geometry import (
    Material,
    MaterialPair,
    Spectrum,
    Surface,
    facing,
    laid_on,
    mirrored,
    read_surface,
    rough_sides,
    synthesise,
    turned_over,
)
from patchlaw.geometry.files.reading import surface_of
from patchlaw.geometry.preparation import Preparation, prepared
from patchlaw.geometry.statistics import SPECTRA, check_periodic_form
from patchlaw.multiscale.scene.body_sections import CounterSurfaceSection, SurfaceSection
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support import Array, InputError, located, part_of

WHOLE = "face"
"""Name of the contact face where the mesh gives it none."""


def make_surface(scene: Scene) -> Surface:
    """Return the surface of a scene, with the heights of both sides where both are rough.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    return make_surfaces(scene)[0]


def make_surfaces(scene: Scene) -> tuple[Surface, Surface | None]:
    """Return the surface of a scene, and what of it is the counter-body's, turned over.

    Returns:
        The heights of both sides, and those of the counter-body; None where it is smooth.

    Raises:
        InputError: When one cannot be made or read, or they do not fit; names file and key.
    """
    own = sample_surface(scene, scene.surface, "surface")
    if scene.counter_surface is None:
        return own, None
    with located(scene.file, "counter_surface"):
        counter = laid_counter_surface(scene, scene.counter_surface, own)
        return facing(own, counter), counter


def laid_counter_surface(scene: Scene, section: CounterSurfaceSection, own: Surface) -> Surface:
    """Return the counter-body's surface as it lies on the first one: turned over, turned and moved.

    Args:
        scene: The scene.
        section: Its section on the counter-body's surface.
        own: The first surface.

    Raises:
        InputError: When it cannot be made or read, or does not cover the first one; names file and
            key.
    """
    counter = turned_over(sample_surface(scene, section, "counter_surface"))
    if not (any(section.shift) or section.rotation):
        return counter
    key = "rotation" if section.rotation else "shift"
    value: Any = section.rotation if section.rotation else list(section.shift)
    allowed = "a map that continues periodically, or one that is larger by as much"
    try:
        laid = laid_on(own, counter, shift=section.shift, angle=section.rotation)
    except InputError:
        problem = "takes the counter-surface off the surface, which it must cover"
    else:
        if laid.periodic or not section.periodic:
            return laid
        problem = "leaves no counter-surface that continues periodically over these sides"
        allowed = "multiples of 90 deg, of 180 deg on sides that differ"
    raise InputError(problem, key=f"counter_surface.{key}", value=value, allowed=allowed)


def sample_surface(scene: Scene, section: SurfaceSection, key: str) -> Surface:
    """Make or read the surface of one section of a scene.

    Args:
        scene: The scene.
        section: The section.
        key: Its dotted name, for errors.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    extent: dict[str, Any] = {"grid": section.grid, "lengths": section.lengths}
    if section.spectrum is not None:
        with located(scene.file, f"{key}.spectrum"):
            whole = synthesise(section.spectrum, **extent)
            surface = prepared(whole, section, SPECTRA)
            if section.periodic:
                check_periodic_form(whole.heights, surface.heights, section.detrend)
    elif section.heights is not None:
        with located(scene.file, f"{key}.heights"):
            return surface_of(
                section.heights.values,
                lengths=section.lengths or (0.0, 0.0),
                height_unit=section.height_unit or "mm",
                periodic=section.periodic,
                **part_of(section, Preparation),
            )
    else:
        extent |= {"height_unit": section.height_unit, "xy_unit": section.xy_unit}
        extent |= {"channel": section.channel, "periodic": section.periodic}
        extent |= part_of(section, Preparation)
        with located(scene.file, key if key == "law.samples" else f"{key}.file"):
            surface = read_surface(scene.path_of(section.file) or Path(), **extent)
    if section.periodic and not surface.periodic:  # it continues so, whatever was removed of it
        return replace(surface, periodic=True)
    return surface


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RegionSamples:
    """The samples of one region of a contact face.

    Attributes:
        name: Name of the region.
        surfaces: The samples, which continue periodically, with the heights of both sides.
        materials: The materials on both sides there.
        mirrored: Whether they do not continue periodically themselves, and are mirrored to do so.
        above: What of each sample is the counter-body's; nothing where that is smooth.
        hardness: Hardness there [MPa]; None of elastic contacts.
        coefficient: Coefficient of friction there; 0 without friction.
    """

    name: str
    surfaces: tuple[Surface, ...]
    materials: MaterialPair
    mirrored: bool = False
    above: tuple[Surface, ...] = ()
    hardness: float | None = None
    coefficient: float = 0.0

    def above_of(self, sample: Surface) -> Surface | None:
        """Return what of one of the samples is the counter-body's; None where that is smooth."""
        return self.above[self.surfaces.index(sample)] if self.above else None

    def sides_of(self, sample: Surface) -> list[tuple[Surface, Material]]:
        """Return the rough sides of one of the samples with their materials."""
        return rough_sides(sample, self.above_of(sample), self.materials)


def region_samples(
    scene: Scene, materials: tuple[Material, ...], second: Material | None
) -> tuple[RegionSamples, ...]:
    """Return the samples of a contact face and of its further regions.

    Args:
        scene: The scene, with a law of samples.
        materials: Elastic constants of the body at the contact face, and at its further regions.
        second: Those of the counter-body; None where it is rigid.

    Raises:
        InputError: When a sample cannot be made or read; names file and key.
    """
    whole = str(scene.body.contact) if scene.body else WHOLE
    parts: list[tuple[str, SurfaceSection, str]] = [(whole, scene.surface, "surface")]
    parts += [(str(one.surface), one, "law.regions") for one in scene.law.regions]
    above = scene.counter_surface
    bounds = zip(scene.hardnesses, scene.coefficients or [0.0] * len(parts), strict=True)
    found = []
    for (name, section, key), material, bound in zip(parts, materials, bounds, strict=True):
        surfaces = [sample_surface(scene, one, key) for one in _seeded(section, scene.law.seeds)]
        laid = list[Surface]()
        if section is scene.surface:
            others = (replace(section, file=file) for file in scene.law.samples)
            surfaces += [sample_surface(scene, one, "law.samples") for one in others]
            _check_different(scene, surfaces)
        if above is not None:
            with located(scene.file, "counter_surface"):
                laid = [laid_counter_surface(scene, above, surface) for surface in surfaces]
                surfaces = [facing(*pair) for pair in zip(surfaces, laid, strict=True)]
        periodic = [one.periodic for one in surfaces]
        samples, upper = (
            tuple(one if kept else mirrored(one) for one, kept in zip(some, periodic, strict=False))
            for some in (surfaces, laid)
        )
        pair = MaterialPair(first=material, second=second)
        region = RegionSamples(
            name=name,
            surfaces=samples,
            materials=pair,
            mirrored=not all(periodic),
            above=upper,
            hardness=bound[0],
            coefficient=bound[1],
        )
        found.append(region)
    return tuple(found)


def crown_depth(
    scene: Scene, lengths: tuple[float, float]
) -> Callable[[Array, Array], Array] | None:
    """Return the depth of a crowned face at points of its plane [mm]; None without a crown.

    Args:
        scene: The scene.
        lengths: Sides of the face [mm].
    """
    radii = scene.law.crown
    if radii is None:
        return None
    middle = 0.5 * np.asarray(lengths)
    curvature = [0.0 if one == "inf" else 1.0 / float(one) for one in radii]

    def depth(x: Array, y: Array) -> Array:
        along, across = x - middle[0], y - middle[1]
        return 0.5 * (curvature[0] * along**2 + curvature[1] * across**2)

    return depth


def _check_different(scene: Scene, surfaces: Sequence[Surface]) -> None:
    """Refuse a map that is one of the others: it hides the scatter and counts twice in the mean."""
    names = (scene.surface.file, *scene.law.samples)
    for (one, first), (other, second) in combinations(zip(names, surfaces, strict=False), 2):
        if np.array_equal(first.heights, second.heights):
            problem = f"has the heights of '{one}', which would count twice"
            with located(scene.file, "law.samples"):
                raise InputError(problem, value=other, allowed="further maps")


def _seeded(section: SurfaceSection, seeds: tuple[int, ...]) -> list[SurfaceSection]:
    """Return the section of every seed; the section itself where it is no spectrum."""
    if section.spectrum is None or not seeds:
        return [section]
    spectra = [replace(section.spectrum, seed=seed) for seed in seeds]
    return [replace(section, spectrum=spectrum) for spectrum in spectra]


def most_waves(spectrum: Spectrum, lengths: tuple[float, float]) -> list[float]:
    """Return the largest number of waves along each side.

    Args:
        spectrum: The spectrum.
        lengths: Sides of the surface [mm].
    """
    if spectrum.waves is not None:  # counted along x
        return [spectrum.waves[1], spectrum.waves[1] * lengths[1] / lengths[0]]
    return [band[1] for band in (spectrum.waves_x, spectrum.waves_y) if band]
