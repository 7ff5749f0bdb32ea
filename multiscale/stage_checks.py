"""Refuses scenes that could never fit, before anything is made; settles the block's cells."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

from geometry.errors import InputError
from geometry.surface import Surface
from multiscale.scene import Scene

BYTES_PER_HEIGHT = 100
"""Memory that surface, spline and spectrum take per height, roughly [B]."""

BYTES_PER_CELL = 5000
"""Memory that mesh, stiffness and multigrid take per cell, roughly [B]."""

EMBEDDED_CELLS = (40, 40, 25)
"""Cells of a block that carries the laws itself: those of Waddad et al. 2016."""

DECOMPOSED_CELLS = (16, 16, 12)
"""Cells of a block that only corrects the half-space: a cube's compliance to 0.05 %."""


def block_cells(scene: Scene) -> tuple[int, int, int]:
    """Return the cells of the block: those asked for, or as many as its part needs.

    Laws on the plain mesh need it fine under every patch; the smooth correction of the half-space
    does not.
    """
    return scene.block.cells or (DECOMPOSED_CELLS if scene.coupling.decomposed else EMBEDDED_CELLS)


def check_size(scene: Scene) -> None:
    """Refuse what could never fit into this machine's memory, before anything is allocated."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    sizes: list[tuple[str, Sequence[int] | None, int]] = [
        ("surface.grid", scene.surface.grid, BYTES_PER_HEIGHT),
        ("patches.grid", scene.patches.grid, BYTES_PER_HEIGHT),
    ]
    if scene.coupling.kind not in ("analytic", "reference"):  # which checks its meshes itself
        sizes.append(("block.cells", block_cells(scene), BYTES_PER_CELL))
    for key, counts, each in sizes:
        if counts is not None and math.prod(counts) * each > memory:
            raise InputError(
                f"needs about {math.prod(counts) * each / 1e9:.3g} GB of memory",
                key=key,
                value=list(counts),
                allowed=f"what fits into {memory / 1e9:.3g} GB",
                file=scene.file,
            )


def check_patches(scene: Scene, surface: Surface) -> None:
    """Refuse patches that no element or no height can resolve."""
    limits: list[tuple[str, Sequence[int]]] = [("heights of the surface", surface.grid)]
    alone = scene.coupling.kind == "isolated"
    # it cuts patches out, and a surface has at least 4 × 4 heights
    if alone and scene.micro.model == "islands":
        fourths = (surface.grid[0] // 4, surface.grid[1] // 4)
        limits = [("fourths of the surface's heights", fourths)]
    on_mesh = not scene.coupling.decomposed or scene.output.fields
    if scene.coupling.kind not in ("analytic", "reference") and on_mesh:
        limits.append(("cells of the interface (block.cells)", block_cells(scene)[:2]))
    for what, limit in limits:
        if any(patches > most for patches, most in zip(scene.patches.grid, limit, strict=True)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(scene.patches.grid),
                allowed=f"at most {list(limit)}",
                file=scene.file,
            )
