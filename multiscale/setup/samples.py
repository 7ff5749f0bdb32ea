"""The periodic samples that representative laws are made from, region by region.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from dataclasses import dataclass

from geometry import Material, MaterialPair, Surface, facing, mirrored
from multiscale.scene.scene import Scene
from multiscale.scene.sections import SurfaceSection
from multiscale.setup.surface_and_block import laid_counter_surface, located, sample_surface

WHOLE = "face"
"""Name of the contact face where the mesh gives it none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RegionSamples:
    """The samples of one region of a contact face.

    Attributes:
        name: Name of the region.
        surfaces: The samples, which continue periodically, with the heights of both sides.
        materials: The materials on both sides there.
        mirrored: Whether they do not continue periodically themselves, and are mirrored to do so.
    """

    name: str
    surfaces: tuple[Surface, ...]
    materials: MaterialPair
    mirrored: bool = False


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
    found = []
    for (name, section, key), material in zip(parts, materials, strict=True):
        surfaces = [sample_surface(scene, one, key) for one in _seeded(section, scene.law.seeds)]
        if above is not None:
            laid = [laid_counter_surface(scene, above, surface) for surface in surfaces]
            with located(scene, "counter_surface"):
                surfaces = [facing(*pair) for pair in zip(surfaces, laid, strict=True)]
        samples = tuple(one if one.periodic else mirrored(one) for one in surfaces)
        pair = MaterialPair(first=material, second=second)
        region = RegionSamples(
            name=name,
            surfaces=samples,
            materials=pair,
            mirrored=not all(one.periodic for one in surfaces),
        )
        found.append(region)
    return tuple(found)


def _seeded(section: SurfaceSection, seeds: tuple[int, ...]) -> list[SurfaceSection]:
    """Return the section of every seed; the section itself where it is no spectrum."""
    if section.spectrum is None or not seeds:
        return [section]
    spectra = [section.spectrum.model_copy(update={"seed": seed}) for seed in seeds]
    return [section.model_copy(update={"spectrum": spectrum}) for spectrum in spectra]
