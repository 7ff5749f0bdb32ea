"""States what the block of a run is made of, before anything expensive starts."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.meshes import alignment
from geometry.smooth_shape import smooth_shape
from multiscale.couplings.blocks import correction_known, scene_loads
from multiscale.planning.block_work import smooth_need, smooth_work
from multiscale.planning.machine import this_machine
from multiscale.stage import Stage
from multiscale.stage_checks import DECOMPOSED_CELLS

STIFF_FROM = 0.45
"""Poisson's ratio above which linear elements lock. Two by two patches on 8 × 8 × 6 trilinear
cells are 1.6 % too stiff there, 6 % at 0.49 and 57 % at 0.4999; as many nodes of quadratic ones
0.5, 1.1 and 1.5 %."""

_LONG = 5.0  # seconds that a user should know of


def block_statement(stage: Stage) -> str:
    """Say what the block is made of, and at what price."""
    block, decomposed = stage.scene.block, stage.scene.coupling.decomposed
    text = _smooth_rest(stage) if decomposed else _elements(stage)
    return f"{text}, {block.sides} sides, contact modulus {stage.model.contact_modulus:.6g} MPa"


def block_warnings(stage: Stage) -> Iterator[str]:
    """Yield what a user should know about the block's cells."""
    decomposed = stage.scene.coupling.decomposed
    yield from _smooth_warnings(stage) if decomposed else _element_warnings(stage)


def _elements(stage: Stage) -> str:
    shape = stage.shape
    margin = (
        f", {shape.margin:g} mm beyond it in {shape.margin_cells} cells" if shape.margin else ""
    )
    kind = "hexahedra" if shape.hexahedral else "hexahedra split into tetrahedra"
    return (
        f"finite elements under the patches, {_times(shape.cells)} {kind} ({shape.element}) under "
        f"the interface, grading {shape.grading:g}{margin}"
    )


def _smooth_rest(stage: Stage) -> str:
    unknowns, seconds, _ = _smooth_cost(stage)
    made = f"made once in about {seconds:.2g} s"
    if correction_known(stage):
        made = "kept on disk by an earlier run"
    return (
        "decomposed, for contacts feel the half-space's own near field: finite elements only for "
        f"the smooth rest, quadratic hexahedra with the nodes of {_times(stage.shape.cells)} "
        f"trilinear ones under the interface, {unknowns} unknowns, {made}"
    )


def _smooth_warnings(stage: Stage) -> Iterator[str]:
    unknowns, seconds, memory = _smooth_cost(stage)
    if seconds > _LONG and not correction_known(stage):
        yield (
            f"the smooth rest of the block has {unknowns} unknowns, and takes about {seconds:.2g} "
            f"s and {memory / 1e9:.2g} GB on every rank: "
            f"{_times(DECOMPOSED_CELLS)} cells give the compliance of a cube to 0.05 %"
        )


def _element_warnings(stage: Stage) -> Iterator[str]:
    cells = min(c / n for c, n in zip(stage.shape.cells[:2], stage.patches.grid, strict=True))
    if cells * stage.shape.degree < 4:
        yield (
            f"{cells:.3g} cells along a patch: fewer than four linear (two quadratic) ones make "
            "the block stiffer by several per cent under a patch's pressure; refine block.cells"
        )
    yield from locking(stage.shape.degree, stage.scene.block.poisson_ratio)
    fit = alignment(stage.shape, stage.patches)
    if not fit:
        yield fit.sentence


def locking(degree: int, poisson_ratio: float) -> Iterator[str]:
    """Yield a warning where elements are much too stiff for a nearly incompressible block.

    Args:
        degree: Polynomial degree of the elements.
        poisson_ratio: Of the block.
    """
    if degree == 1 and poisson_ratio > STIFF_FROM:
        yield (
            f"linear elements lock as Poisson's ratio comes near 0.5 (here {poisson_ratio:g}): the "
            "block is too stiff by several per cent or more; take block.element = 'Q2' or 'P2', or "
            "coupling.compliance = 'decomposed', whose elements are quadratic"
        )


def _smooth_cost(stage: Stage) -> tuple[int, float, float]:
    """Return unknowns, seconds and bytes of the smooth rest."""
    loads = scene_loads(stage).shape
    seconds = smooth_work(stage.shape, loads).seconds(this_machine())
    return smooth_shape(stage.shape).unknowns, seconds, smooth_need(stage.shape, loads).alone


def _times(cells: tuple[int, ...]) -> str:
    return " × ".join(map(str, cells))
