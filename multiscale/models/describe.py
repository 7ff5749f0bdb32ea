"""Sentences on a scene as it is planned: surface, contact, materials, body, loads."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from patchlaw.geometry import Material, roughness
from patchlaw.multiscale.loading.load_history import LOADS, LoadHistory
from patchlaw.multiscale.loading.path import BodyLoads
from patchlaw.multiscale.scene.parts import BodyFacts, SceneParts, block_section
from patchlaw.multiscale.scene.surfaces import RegionSamples, most_waves
from patchlaw.support.readable import number, quantities, quantity, times

MESHED_CONTACTS = "none: contacts are meshed, and the keys of [micro] are not used"
TOPICS = (
    "inputs", "surface", "contact", "two rough sides", "micro model", "coupling", "block", "body",
    "body term", "newton", "friction", "load", "choice", "memory", "error",
)  # fmt: skip
"""What is said of a scene, in this order."""


def materials(parts: SceneParts) -> str:
    """Say the elastic constants of both sides."""
    second = parts.materials.second
    other = "a half-space" if parts.counter is None else "a body"
    against = f", against {other} with {_constants(second)}" if second else ""
    return f"{_constants(parts.materials.first)}{against}"


def dimensions(parts: SceneParts, *, has_body: bool) -> str:
    """Say the dimensions of the surface and of what it lies on."""
    lx, ly = quantities(parts.surface.lengths, "mm")
    what = "body" if parts.body.on_mesh else "block"
    solid = "a half-space"
    if has_body:
        solid = f"a {what} {quantity(parts.body.depth, 'mm')} high"
    return f"{'samples of ' if parts.regions else ''}{lx} × {ly} on {solid}"


def _constants(material: Material) -> str:
    return f"E = {quantity(material.young_modulus, 'MPa')}, ν = {material.poisson_ratio:g}"


def surface(parts: SceneParts) -> str:
    """Say what the surface is."""
    rough_surface, spectrum = parts.surface, parts.scene.surface.spectrum
    rough = roughness(rough_surface)
    lx, ly = quantities(rough_surface.lengths, "mm")
    continued = ", continued periodically" if parts.scene.surface.periodic else ""
    text = (
        f"{rough_surface.source}; {times(rough_surface.grid)} heights on "
        f"{lx} × {ly}{continued}, "
        f"rms height {quantity(rough.sq, 'mm', 3)}, rms gradient {number(rough.sdq, 3)}"
    )
    if spectrum is None:
        return text
    heights = np.divide(rough_surface.grid, most_waves(spectrum, rough_surface.lengths)).min()
    return f"{text}, {heights:.3g} heights along the shortest wavelength"


def two_sides(parts: SceneParts) -> str:
    """Say how two rough sides lie on each other, and whose slopes count."""
    section = parts.scene.counter_surface
    text = "[counter_surface], turned over, lies on [surface]"
    if section is not None and section.rotation:
        text += f", turned by {section.rotation:g}°"
    if section is not None and any(section.shift):
        text += f", moved by {' and '.join(quantities(section.shift, 'mm'))}"
    if not parts.finite_slopes or parts.regions:
        return f"{text}; the heights of both add"
    if parts.materials.second is None:
        rigid = "the slopes of [surface] alone count: the other side is rigid"
        return f"{text}; the heights of both add, {rigid}"
    return f"{text}; the heights of both add, and the slopes of each count on its own body"


def contact(parts: SceneParts) -> str:
    """Say what contact problems consist of, and how much of it the largest approach brings near."""
    if parts.summits is not None:
        within = f"{int(parts.interfering_summits.sum())} within the largest approach"
        return f"{len(parts.summits)} summits, {within}; the others cost nothing"
    count = math.prod(parts.cells or parts.surface.grid)
    if parts.plane_at_largest_load is None:
        return f"{count} cells"
    return f"{count} cells, {parts.interfering_cells} within the largest approach"


def gathered(parts: SceneParts) -> str:
    """Say what patches are for without laws."""
    return f"{times(parts.patches.grid)} patches gather the results"


def load(parts: SceneParts) -> str:
    """Say the load steps."""
    history = parts.scene.loading
    key, points = history.stated
    if not points:
        text = f"{history.count} steps: {'; '.join(stages(parts))}"
    else:
        unit, what, _ = LOADS[key]
        way = ", ".join(quantities(points, unit, 6))
        again = f", {history.cycles} times" * (history.cycles > 1)
        text = f"{history.count} steps to {what} of {way}{again}"
    sections = (("body", parts.scene.body), ("counter-body", parts.scene.counter_body))
    known = [one for name, section in sections if section for one in body_loads(section, name)]
    if known:
        text += f"; from the start {', '.join(known)}"
    if parts.zero:
        depth = quantity(parts.zero, "mm", 4)
        text += f", approaches from the {parts.scene.loading.zero}, {depth} below first touch"
    if history.shear_key and not history.stage:
        text += f"; {_shear(history)}"
    if history.force_change is not None:
        text += f", halved where the force changes by more than {history.force_change:.3g}"
    if history.slopes is None:
        text += ", the plane free to tilt"
    elif any(history.slopes):
        tx, ty = history.slopes
        text += f", tilted by {1e3 * tx:.3g} and {1e3 * ty:.3g} µm/mm along x and y"
    return text


def _shear(history: LoadHistory) -> str:
    """Say the shear of a load history."""
    way = ", ".join(_pair(history, pair) for pair in history.stated_shear)
    what = "a shift" if history.shear_key == "shear" else "a shear force"
    again = f", {history.shear_cycles} times" * (history.shear_cycles > 1)
    if history.shear_path == "along":
        return f"along with it {what} of {way}"
    return f"then in {history.shear_steps or history.steps} steps each to {what} of {way}{again}"


def _pair(history: LoadHistory, pair: tuple[float, float]) -> str:
    """Say a shear along x and y."""
    unit = "mm" if history.shear_key == "shear" else "N"
    return f"({', '.join(quantities(pair, unit, 6))})"


def stages(parts: SceneParts) -> Iterator[str]:
    """Yield what every stage of the load history does."""
    for index, stage in enumerate(parts.scene.loading.stage):
        loads: list[str] = []
        if stage.hold is not None:
            loads.append(f"{stage.hold} held")
        elif stage.approach is not None:
            loads.append(f"approach to {quantity(stage.approach, 'mm', 6)}")
        elif stage.pressure is not None:
            loads.append(f"mean pressure to {quantity(stage.pressure, 'MPa', 6)}")
        elif stage.force is not None:
            loads.append(f"force to {quantity(stage.force, 'N', 6)}")
        for name, part in (("body", stage.body), ("counter-body", stage.counter_body)):
            if part is not None:
                loads += body_loads(part, name)
        for what, pairs in (("shift", stage.shear), ("shear force", stage.shear_force)):
            loads += [f"{what} to {_pair(parts.scene.loading, pair)}" for pair in pairs or ()]
        cyclic = f", {stage.cycles} times there and back" if stage.cycles else ""
        steps = sum(step.stage == index + 1 for step in parts.path)
        change = ", ".join(loads) or "nothing changes"
        yield f"stage {stage.name or index + 1} in {steps}: {change}{cyclic}"


def body_loads(loads: BodyLoads, name: str) -> Iterator[str]:
    """Yield what loads a body beside the contact.

    Args:
        loads: The loads.
        name: What the body is called.
    """
    for one in loads.tractions:
        if one.stress is None:
            how = f"a pressure of {quantity(one.pressure or 0.0, 'MPa')}"
        else:
            how = f"({', '.join(f'{part:.6g}' for part in one.stress)}) MPa"
        yield f"{how} on {one.surface!r} of the {name}"
    for bolt in loads.pretension:
        yield f"bolts on {bolt.surface!r} pulling with {quantity(bolt.pull, 'N', 6)}"
    for volume, rise in loads.rises.items():
        yield f"{rise:+.6g} K in {f'{volume!r} of ' if volume else ''}the {name}"


def body(parts: SceneParts) -> str:
    """Say what the bodies are made of, of meshes or under laws of samples."""
    modulus = quantity(parts.materials.contact_modulus, "MPa")
    text = f"{_mesh(parts.body)}, contact modulus {modulus}"
    if parts.counter is not None:
        text += f"; counter-body {_mesh(parts.counter)}; unknowns of both are one problem"
    return text


def samples(region: RegionSamples) -> str:
    """Say what the laws of a region are made from."""
    x, y = quantities(region.surfaces[0].lengths, "mm")
    count = len(region.surfaces)
    what = f"{count} periodic samples" if count > 1 else "a periodic sample"
    return f"{region.name}: {what} of {x} × {y}"


def hardnesses(parts: SceneParts) -> str:
    """Say the hardness of all regions of a face; nothing where contacts are elastic."""
    known = parts.scene.hardnesses
    texts = ("none" if one is None else quantity(one, "MPa") for one in known)
    return of_zones(parts, texts) if any(known) else ""


def of_zones(parts: SceneParts, texts: Iterable[str]) -> str:
    """Say what all regions of a face have: once, where all have the same.

    Args:
        parts: What is known of the scene.
        texts: What the face and its further regions have.
    """
    first, *others = texts
    if all(one == first for one in others):
        return first
    names = (region.name for region in parts.samples)
    return ", ".join(f"{one} on {name}" for name, one in zip(names, [first, *others], strict=True))


def _mesh(facts: BodyFacts) -> str:
    degree = "linear" if facts.degree == 1 else "quadratic"
    x, y = facts.lengths
    return (
        f"{facts.cells} ({degree}), {facts.unknowns} unknowns, contact face of {facts.area:.6g} "
        f"mm² within {x:.6g} × {y:.6g} mm, {facts.depth:.6g} mm of body below it"
    )


def body_term(parts: SceneParts) -> str:
    """Say how contact problems of the whole surface see a body on a mesh, and why."""
    if parts.scene.patches_alone:
        return "none: every patch is taken alone on a half-space"
    if parts.body.above:
        return (
            "the compliance of the mesh itself under smooth modes of pressure, as parts of the "
            "body lie above the plane of its contact face, where no half-space is"
        )
    return (
        "the half-space's own near field, and what the body adds to it in smooth modes of the "
        "surface's rectangle, from the mesh: the body lies below the plane of its contact face"
    )


def block(parts: SceneParts) -> str:
    """Say what a block is made of."""
    shape = parts.body.shape
    assert shape is not None
    sizes = quantities((*parts.surface.lengths, shape.height), "mm")
    sides, modulus = block_section(parts.scene).sides, parts.materials.contact_modulus
    text = (
        "decomposed: the half-space's own near field, and what the finite block adds to it in "
        "smooth modes of its contact face, from finite elements of high order"
    )
    if not parts.scene.decomposed:
        split = "" if shape.hexahedral else " split into tetrahedra"
        margin = f", {shape.margin:g} mm beyond it in {shape.margin_cells} cells"
        text = (
            f"finite elements under the patches, {times(shape.cells)} hexahedra{split} "
            f"({shape.element}) under the interface, grading {shape.grading:g}"
            f"{margin if shape.margin else ''}"
        )
    return (
        f"{text}, {sizes[0]} × {sizes[1]} and {sizes[2]} high, "
        f"{sides} sides, contact modulus {quantity(modulus, 'MPa')}"
    )
