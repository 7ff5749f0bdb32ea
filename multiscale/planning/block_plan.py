"""States what the block of a run is made of, before anything expensive starts."""

from __future__ import annotations

from collections.abc import Iterator

from geometry.meshes.block import alignment
from multiscale.setup.problem import ProblemSetup

STIFF_FROM = 0.45
"""Poisson's ratio above which linear elements lock. Two by two patches on 8 × 8 × 6 trilinear
cells are 1.6 % too stiff there, 6 % at 0.49 and 57 % at 0.4999; as many nodes of quadratic ones
0.5, 1.1 and 1.5 %."""


_BODY_TERM = (
    "decomposed: the half-space's own near field, and what the finite block adds to it in smooth "
    "modes of its contact face, from finite elements of high order"
)


def block_statement(setup: ProblemSetup) -> str:
    """Say what the block is made of, and at what price."""
    text = _BODY_TERM if setup.scene.coupling.decomposed else _elements(setup)
    return f"{text}, {_size(setup)}, contact modulus {setup.model.contact_modulus:.6g} MPa"


def _size(setup: ProblemSetup) -> str:
    """Say how large the block is, and what its sides do."""
    (lx, ly), height = setup.surface.lengths, setup.shape.height
    return f"{lx:g} × {ly:g} mm and {height:g} mm high, {setup.scene.block.sides} sides"


def block_warnings(setup: ProblemSetup) -> Iterator[str]:
    """Yield what a user should know about the block's cells."""
    if not setup.scene.coupling.decomposed:
        yield from _element_warnings(setup)


def _elements(setup: ProblemSetup) -> str:
    shape = setup.shape
    margin = (
        f", {shape.margin:g} mm beyond it in {shape.margin_cells} cells" if shape.margin else ""
    )
    kind = "hexahedra" if shape.hexahedral else "hexahedra split into tetrahedra"
    return (
        f"finite elements under the patches, {_times(shape.cells)} {kind} ({shape.element}) under "
        f"the interface, grading {shape.grading:g}{margin}"
    )


def _element_warnings(setup: ProblemSetup) -> Iterator[str]:
    cells = min(c / n for c, n in zip(setup.shape.cells[:2], setup.patches.grid, strict=True))
    if cells * setup.shape.degree < 4:
        yield (
            f"{cells:.3g} cells along a patch: fewer than four linear (two quadratic) ones make "
            "the block stiffer by several per cent under a patch's pressure; refine block.cells"
        )
    yield from locking(setup.shape.degree, setup.scene.block.poisson_ratio)
    fit = alignment(setup.shape, setup.patches)
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
            "coupling.compliance = 'decomposed', whose elements are of high order"
        )


def _times(cells: tuple[int, ...]) -> str:
    return " × ".join(map(str, cells))
