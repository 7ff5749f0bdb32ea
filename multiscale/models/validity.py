"""What a user should know about the validity of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING

from patchlaw.geometry import misalignment, roughness
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.scene.parts import SceneParts
from patchlaw.multiscale.scene.schema import bare_quantities
from patchlaw.multiscale.scene.surfaces import RegionSamples
from patchlaw.support.readable import Caution, percent, quantities, quantity

if TYPE_CHECKING:  # others than references do without
    from patchlaw.multiscale.models.reference_meshes import ReferenceMeshes


SMALL_STRAIN = 0.02
"""Mean strain of a body up to which strains are small: by twice Poisson's ratio times it sections
widen, and by half of it natural strains differ, neither of which linear elasticity knows."""


def warnings(parts: SceneParts, meshes: ReferenceMeshes | None) -> Iterator[str]:
    """Yield what a user should know about the validity of a scene.

    Args:
        parts: What is known of the scene.
        meshes: The meshes of a reference; None of other couplings.
    """
    yield from large_strains(parts)
    yield from _of_surface(parts)
    yield from _of_contact(parts)
    yield from _of_output(parts)
    if parts.scene.has_body:
        yield from _compressibility(parts)
        yield from _of_bodies(parts, meshes)
    if parts.decision is not None and parts.decision.warning:
        yield parts.decision.warning


def large_strains(parts: SceneParts, steps: Sequence[LoadStep] = ()) -> Iterator[Caution]:
    """Yield a caution where the largest load strains a body, as a whole, too much to be linear.

    A force does so by the mean pressure over Young's modulus. An approach compresses a block, which
    does not bend, by what it exceeds the height of the roughness above its mean, at least; what it
    does to other bodies is known from its forces.

    Args:
        parts: What is known of the scene.
        steps: Load steps, whose forces count where what is prescribed does not tell.
    """
    scene, path = parts.scene, parts.path
    moduli = [
        math.inf if one is None else one.young_modulus
        for one in (parts.materials.first, parts.materials.second)
    ]
    young = min(moduli)
    strained = ("the body", "the counter-body")[moduli.index(young)]
    found = [_by_force(path.largest("force"), parts.area, young)]
    blocks = [one for one in (parts.body, parts.counter) if one is not None and scene.has_body]
    moves = scene.loads_bodies or (scene.counter_body is not None and parts.counter is None)
    if blocks and not moves and all(one.shape for one in blocks) and scene.law.crown is None:
        approach = path.largest("approach")
        rough = max(one.highest - one.mean_height for one in parts.rough_surfaces)
        # the softer one takes most of it
        depth = sum(one.depth * young / moduli[one is parts.counter] for one in blocks)
        strain = (approach - rough) / depth
        found.append((f"an approach of {quantity(approach, 'mm', 3)}", "at least", strain))
    if max(strain for *_, strain in found) <= SMALL_STRAIN:
        found = [_by_force(step.force_N, parts.area, young) for step in steps]
        found = [max(found, key=itemgetter(2))] if found else []
    for load, size, strain in found:
        if strain > SMALL_STRAIN:
            yield Caution(
                f"{load} strains {strained} by {size} {percent(strain)} as a whole: strains of "
                f"more than {percent(SMALL_STRAIN)} are not small, and results of linear "
                "elasticity are off by as much and more"
            )


def _by_force(force: float, area: float, young_modulus: float) -> tuple[str, str, float]:
    """Return the mean pressure of a force in words, and the strain by it."""
    pressure = force / area
    return f"a mean pressure of {quantity(pressure, 'MPa', 3)}", "about", pressure / young_modulus


def _of_contact(parts: SceneParts) -> Iterator[str]:
    """Yield what is doubtful of the contact and of its micro model."""
    if parts.plane_at_largest_load is not None and not parts.samples:
        of_cells = parts.cells is not None and not parts.scene.by_laws
        if not (parts.interfering_cells if of_cells else parts.interfering_patches):
            yield "nothing lies within the largest approach: no force will act"
    if (summits := parts.summits) is None:
        return
    if cut := parts.interfering_border_maxima:
        yield (
            "maxima on the surface's border within the largest approach: "
            f"{cut}; an 8-neighbour search cannot confirm them, and they carry no load here"
        )
    if summits.flat:
        yield (
            f"{summits.flat} summits are flat, as heights in steps are: without radii "
            "they carry no load here; take micro.model = 'half-space'"
        )


def _of_bodies(parts: SceneParts, meshes: ReferenceMeshes | None) -> Iterator[str]:
    """Yield what is doubtful of the bodies, of their meshes, and of laws on them."""
    scene, body, shape = parts.scene, parts.body, parts.body.shape
    if shape is not None and not parts.samples:
        yield from _proportions(parts)
    if meshes is not None:
        yield from body.notes
        yield from meshes.warnings()
        yield from _locking(body.poisson_ratio, meshes.degree)
        return
    if shape is None or parts.samples:
        for facts in filter(None, (parts.body, parts.counter)):
            yield from facts.notes
            yield from _locking(facts.poisson_ratio, facts.degree, "body", "element = 'quadratic'")
    elif not scene.decomposed:
        yield from _coarse_cells(parts)
    if parts.samples:
        yield from _of_samples(parts.samples, body.area)
    elif shape is not None and scene.patches_alone:
        if max(parts.patches.size) > 0.5 * min(shape.height, *shape.widths):
            yield (
                "the patches are not small against the block: the half-space correction (Love) "
                "inside their laws is an approximation there"
            )


def _of_surface(parts: SceneParts) -> Iterator[str]:
    """Yield what a user should know about the surface and the numbers of the scene."""
    rough_surface = parts.surface
    known = parts.plane_at_largest_load is not None
    size = parts.largest_interference if known else roughness(rough_surface).sq
    yield from rough_surface.notes
    if bare := list(bare_quantities(parts.scene.written)):
        yield f"numbers without a unit: {', '.join(bare)}"
    excess = rough_surface.highest - rough_surface.heights.max()
    if not parts.zero and excess > 0.1 * size:
        x, y = rough_surface.highest_point
        yield (
            "the approach counts from the interpolant's highest point, "
            f"{quantity(excess, 'mm', 3)} above the highest of the given heights, at "
            f"x = {x:.4g} mm, y = {y:.4g} mm: the heights are too coarse or too noisy there"
        )


def _of_output(parts: SceneParts) -> Iterator[str]:
    """Yield what of the requested output there will not be."""
    output = parts.scene.output
    without = ("auto", "none") if parts.scene.by_laws else ("none",)
    cells = parts.cells is not None and output.contact not in without
    if output.fields and not parts.scene.has_body:
        yield (
            "output.fields: there is no block, and no fields are written; the analytic coupling "
            "presses a half-space (a block has coupling.kind = 'concurrent', 'consistent', "
            "'isolated' or 'reference')"
        )
    if output.figures == "all" and not cells:
        yield (
            "output.figures = 'all': no block.png is drawn, for no pressures of cells are known; "
            "micro.model = 'half-space' has them, with laws where output.contact = 'last'"
        )


def _of_samples(samples: Sequence[RegionSamples], area: float) -> Iterator[str]:
    """Yield what is doubtful of samples that stand for a face.

    Args:
        samples: The samples of all regions.
        area: Area of the face [mm²].
    """
    side = math.sqrt(area)
    for region in samples:
        largest = max(max(surface.lengths) for surface in region.surfaces)
        if side < 4.0 * largest:
            sample, face = quantities((largest, side), "mm")
            yield (
                f"the sample of {region.name} is {sample} long and the face about {face}: a sample "
                "stands for faces that are much larger"
            )
        if region.mirrored:
            yield (
                f"the heights of {region.name} do not continue periodically: their sample is "
                "four mirror images, twice as long and wide"
            )


def _proportions(parts: SceneParts) -> Iterator[str]:
    """Yield what is doubtful of the proportions of a block."""
    shape = parts.body.shape
    assert shape is not None
    widths = shape.widths
    (least, most), high, height = sorted(widths), shape.height, ""
    unequal = 3.0  # few mean such edges, and many forget a unit
    if high > unequal * least:
        height = "most of the approach may be the compression of the column below the surface"
    elif least > unequal * high:
        height = "the fixed bottom is near, and stiffens what lies above it"
    if height:
        ratio = max(high / least, least / high)
        yield (
            f"the block is {high:g} mm high and {least:g} mm wide, a ratio of {ratio:.3g}: "
            f"{height}; block.height is the shorter side when not given"
        )
    if most > unequal * least:
        yield (
            f"the block is {widths[0]:g} × {widths[1]:g} mm wide, a ratio of {most / least:.3g}: "
            "are these the lengths along x and y of the whole map?"
        )


def _compressibility(parts: SceneParts) -> Iterator[str]:
    """Yield warnings of Poisson's ratios that are negative, or so large that bodies take long."""
    usual, most = 0.45, 0.49
    for facts in filter(None, (parts.body, parts.counter)):
        nu = facts.poisson_ratio
        if nu < 0.0:
            yield f"a Poisson's ratio of {nu:g} is negative, which few materials have"
        if nu > most:
            times = math.sqrt((1.0 - 2.0 * usual) / (1.0 - 2.0 * nu))
            stiffer = (1.0 - most**2) / (1.0 - nu**2) - 1.0
            yield (
                f"a Poisson's ratio of {nu:g} takes up to {times:.2g} times the iterations of "
                f"{usual:g}, which grow as (1 − 2ν)^-½ in nearly incompressible bodies; with "
                f"{most:g} the contact modulus is {100.0 * stiffer:.2g} % smaller"
            )


def _locking(
    poisson_ratio: float, degree: int, what: str = "block", take: str = ""
) -> Iterator[str]:
    """Yield a warning where linear elements lock.

    Two by two patches on 8 × 8 × 6 trilinear cells are 1.6 % too stiff at a Poisson's ratio of
    0.45, 6 % at 0.49 and 57 % at 0.4999. As many nodes of quadratic cells are 0.5, 1.1 and 1.5 %
    too stiff.

    Args:
        poisson_ratio: Poisson's ratio of the body.
        degree: Degree of the displacements.
        what: The body.
        take: What does not lock; by default what blocks can have.
    """
    if degree == 1 and poisson_ratio > 0.45:
        take = take or "block.element = 'Q2' or 'P2'"
        yield (
            f"linear elements lock as Poisson's ratio comes near 0.5 (here {poisson_ratio:g}): the "
            f"{what} is too stiff by several per cent or more; take {take}"
        )


def _coarse_cells(parts: SceneParts) -> Iterator[str]:
    """Yield what is doubtful of the cells of a meshed block under its patches."""
    shape = parts.body.shape
    assert shape is not None
    counts = zip(shape.cells[:2], parts.patches.grid, strict=True)
    cells = min(cells / patches for cells, patches in counts)
    if cells * shape.degree < 4:
        yield (
            f"{cells:.3g} cells along a patch: fewer than four linear (two quadratic) ones "
            "make the block stiffer by several per cent under a patch's pressure; refine "
            "block.cells"
        )
    yield from _locking(parts.materials.first.poisson_ratio, shape.degree)
    if sentence := misalignment(shape, parts.patches):
        yield sentence
