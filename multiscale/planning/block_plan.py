"""Says what the block or the meshes of a run are, whether they fit its patches and the memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from geometry.meshes.block import BlockShape, misalignment
from multiscale.machine import ClusterNodes
from multiscale.planning.body_plan import LOCKING_FROM, body_statement, body_warnings
from multiscale.planning.memory_costs import run_memory_requests
from multiscale.readable import quantity
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import ReferenceMeshes
from multiscale.setup.surface_and_block import block_section

LEAST_ACROSS = {1: 12.0, 2: 3.0}
"""Edges across a typical contact below which the force is wrong by several per cent, by the
element's degree."""
MOST_UNEQUAL = 3.0
"""Ratio of two edges of the block that deserves a note: few mean it, and many forget a unit."""
LEAST_CELLS_PER_PATCH = 4
"""Linear cells along a patch below which the block is too stiff under a patch's pressure."""


def block_statement(setup: ProblemSetup) -> str:
    """Say what the block is made of.

    Args:
        setup: The problem, with a block.
    """
    if setup.face is not None:
        return body_statement(setup)
    if setup.meshes is not None:
        return f"{_meshes(setup.meshes)}; {block_section(setup.scene).sides} sides"
    shape = setup.shape
    sizes = [quantity(side, "mm") for side in (*setup.surface.lengths, shape.height)]
    sides, modulus = block_section(setup.scene).sides, setup.materials.contact_modulus
    text = (
        "decomposed: the half-space's own near field, and what the finite block adds to it in "
        "smooth modes of its contact face, from finite elements of high order"
    )
    if not setup.scene.decomposed:
        split = "" if shape.hexahedral else " split into tetrahedra"
        margin = f", {shape.margin:g} mm beyond it in {shape.margin_cells} cells"
        text = (
            f"finite elements under the patches, {_times(shape.cells)} hexahedra{split} "
            f"({shape.element}) under the interface, grading {shape.grading:g}"
            f"{margin if shape.margin else ''}"
        )
    return (
        f"{text}, {sizes[0]} × {sizes[1]} and {sizes[2]} high, "
        f"{sides} sides, contact modulus {quantity(modulus, 'MPa')}"
    )


def block_warnings(setup: ProblemSetup) -> Iterator[str]:
    """Yield what a user should know about the proportions and the cells of the block.

    Args:
        setup: The problem, with a block.
    """
    if setup.face is not None:
        yield from body_warnings(setup)
        return
    yield from _proportions(setup)
    yield from _patch_warnings(setup)
    if setup.meshes is not None:
        yield from _mesh_warnings(setup.meshes)
    elif setup.scene.decomposed:
        return
    else:
        counts = zip(setup.shape.cells[:2], setup.patches.grid, strict=True)
        cells = min(cells / patches for cells, patches in counts)
        if cells * setup.shape.degree < LEAST_CELLS_PER_PATCH:
            yield (
                f"{cells:.3g} cells along a patch: fewer than four linear (two quadratic) ones "
                "make the block stiffer by several per cent under a patch's pressure; refine "
                "block.cells"
            )
    mesh, poisson_ratio = setup.meshes or setup.shape, setup.materials.first.poisson_ratio
    if mesh.degree == 1 and poisson_ratio > LOCKING_FROM:
        yield (
            f"linear elements lock as Poisson's ratio comes near 0.5 (here {poisson_ratio:g}): the "
            "block is too stiff by several per cent or more; take block.element = 'Q2' or 'P2', or "
            "coupling.compliance = 'decomposed', whose elements are of high order"
        )
    if setup.meshes is None:
        if sentence := misalignment(setup.shape, setup.patches):
            yield sentence


def memory_warnings(setup: ProblemSetup, nodes: ClusterNodes) -> Iterator[str]:
    """Yield what a run needs more memory for than the nodes have.

    Args:
        setup: The problem.
        nodes: The nodes there are.
    """
    for request in run_memory_requests(setup):
        if not nodes.fits(request):
            key = "" if request.value is None else f"{request.key} = {request.value}: "
            yield f"{key}{request.sentence}; there is {nodes.remedy(request)}"


def _proportions(setup: ProblemSetup) -> Iterator[str]:
    widths, height = [side + 2.0 * setup.shape.margin for side in setup.surface.lengths], ""
    (least, most), high = sorted(widths), setup.shape.height
    if high > MOST_UNEQUAL * least:
        height = "most of the approach may be the compression of the column below the surface"
    elif least > MOST_UNEQUAL * high:
        height = "the fixed bottom is near, and stiffens what lies above it"
    if height:
        ratio = max(high / least, least / high)
        yield (
            f"the block is {high:g} mm high and {least:g} mm wide, a ratio of {ratio:.3g}: "
            f"{height}; block.height is the shorter side when not given"
        )
    if most > MOST_UNEQUAL * least:
        yield (
            f"the block is {widths[0]:g} × {widths[1]:g} mm wide, a ratio of {most / least:.3g}: "
            "are these the lengths along x and y of the whole map?"
        )


def _patch_warnings(setup: ProblemSetup) -> Iterator[str]:
    if setup.scene.kind != "isolated":
        return
    widths = [length + 2.0 * setup.shape.margin for length in setup.surface.lengths]
    if max(setup.patches.size) > 0.5 * min(setup.shape.height, *widths):
        yield (
            "the patches are not small against the block: the half-space correction (Love) inside "
            "their laws is an approximation there"
        )


def _meshes(meshes: ReferenceMeshes) -> str:
    finest = meshes.shapes[-1]
    if isinstance(finest, BlockShape):
        kind = f"{_times(finest.cells)} hexahedra ({finest.element}), grading {finest.grading:g}"
        where, unknowns = "edges", [f"{count}" for count in meshes.unknowns]
    else:  # unknowns are an estimate, which is worth two digits
        kind = f"tetrahedra ({finest.element}), small only where contact can occur"
        where = "edges there"
        unknowns = [f"about {int(float(f'{count:.2g}'))}" for count in meshes.unknowns]
    count = {1: "one mesh", 2: "two meshes", 3: "three meshes"}[len(meshes.shapes)]
    return (
        f"{count} of {kind}; {where} of {_listed(f'{1e3 * size:.3g}' for size in meshes.sizes)} "
        f"µm, {meshes.across:.2g} across a typical contact; {_listed(unknowns)} unknowns, about "
        f"{meshes.bytes / 1e9:.2g} GB of memory"
    )


def _mesh_warnings(meshes: ReferenceMeshes) -> Iterator[str]:
    finest = meshes.shapes[-1]
    if len(meshes.shapes) == 1:
        yield (
            "one mesh: the discretisation error stays unknown, and the results have no error bar; "
            "reference.meshes = 2 gives one"
        )
    if meshes.across < LEAST_ACROSS[meshes.degree]:
        yield (
            f"{meshes.across:.2g} edges across a typical contact at the largest load: the force is "
            f"wrong by several per cent; refine {meshes.key}"
        )
    if isinstance(finest, BlockShape):
        top = float(finest.ticks[2][-1] - finest.ticks[2][-2])
        if top > 2.0 * float(meshes.sizes[-1]):
            yield (
                f"the top layer is {1e3 * top:.3g} µm high, more than twice the width of its "
                "cells, which see the contacts no better than cubes would: take more layers, or a "
                "larger block.grading"
            )


def _listed(parts: Iterable[str]) -> str:
    *first, last = parts
    return f"{', '.join(first)} and {last}" if first else last


def _times(cells: tuple[int, ...]) -> str:
    return " × ".join(map(str, cells))
