"""States what a reference is meshed with, before anything expensive starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from geometry.meshes.block import BlockShape
from multiscale.planning.block_plan import locking
from multiscale.scene.scene import Scene
from multiscale.setup.checks import patch_grid
from multiscale.setup.reference_meshes import ReferenceMeshes

LEAST_ACROSS = {1: 12.0, 2: 3.0}
"""Edges across a typical contact below which the force is wrong by several per cent, by the
element's degree."""

NO_MICRO_MODEL = "none: contacts are meshed, and the keys of [micro] are not used"


def reference_coupling(scene: Scene) -> str:
    """Say how a reference finds contact."""
    nx, ny = patch_grid(scene)
    return (
        f"reference: the rough surface itself, meshed and pressed by {scene.reference.method}; "
        f"{nx} × {ny} patches gather the results"
    )


def reference_statement(scene: Scene, meshes: ReferenceMeshes) -> str:
    """Say what a reference is meshed with, and at what price.

    Args:
        scene: The scene.
        meshes: Its meshes.
    """
    finest = meshes.shapes[-1]
    if isinstance(finest, BlockShape):
        cells = " × ".join(map(str, finest.cells))
        kind = f"{cells} hexahedra ({finest.element}), grading {finest.grading:g}"
        where, about = "edges", ""
    else:
        kind = f"tetrahedra ({finest.element}), small only where contact can occur"
        where, about = "edges there", "about "
    count = {1: "one mesh", 2: "two meshes", 3: "three meshes"}[len(meshes.shapes)]
    edges = _listed([f"{1e3 * size:.3g}" for size in meshes.sizes])
    unknowns = _listed([f"{about}{_rounded(n) if about else n}" for n in meshes.unknowns])
    return (
        f"{count} of {kind}; {where} of {edges} µm, {meshes.across:.2g} across a typical contact; "
        f"{unknowns} unknowns, about {meshes.bytes / 1e9:.2g} GB of memory; "
        f"{scene.block.sides} sides"
    )


def reference_warnings(scene: Scene, meshes: ReferenceMeshes) -> Iterator[str]:
    """Yield what a user should know of a reference's meshes.

    Args:
        scene: The scene.
        meshes: Its meshes.
    """
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
    yield from locking(meshes.degree, scene.block.poisson_ratio)
    finest = meshes.shapes[-1]
    if isinstance(finest, BlockShape):
        top = float(finest.ticks[2][-1] - finest.ticks[2][-2])
        if top > 2.0 * float(meshes.sizes[-1]):
            yield (
                f"the top layer is {1e3 * top:.3g} µm high, more than twice the width of its "
                "cells, which see the contacts no better than cubes would: take more layers, or a "
                "larger block.grading"
            )


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _rounded(number: int) -> int:
    """Round to two digits, which is what an estimate is worth."""
    return int(float(f"{number:.2g}"))
