"""Refuses scenes that could never fit, before anything is made; settles the block's cells."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from geometry.errors import InputError
from geometry.files import BYTES_PER_HEIGHT
from geometry.surface import Surface
from multiscale.machine.nodes import ClusterNodes, MemoryRequest
from multiscale.scene.scene import Scene

BYTES_PER_CELL = 5000
"""Memory that mesh, stiffness and multigrid take per cell, roughly, over all ranks [B]."""

BYTES_PER_SENT_HEIGHT = 17
"""Memory of a height and its spline on every rank, once the surface is made [B]."""

BYTES_PER_PAIR = 40
"""Memory that dense matrices take per pair of patches: compliance, tangent, factors [B]."""

BYTES_PER_LAW = 3_600
"""Memory of a law with 65 rows of 7 numbers on every rank [B]."""

BYTES_PER_NEW_LAW = 11_400
"""Memory that it takes besides where it is made, while rows are put between others [B]."""

BYTES_PER_STATE = 24
"""Memory of what a patch carries at one load step [B]."""

LAW_BLOCK_CELLS = (40, 40, 25)
"""Cells of a block that carries the laws itself: those of Waddad et al. 2016."""

FIELD_CELLS = (20, 20, 12)
"""Cells of a block that is meshed for its fields alone, after the load."""

PROVISIONAL_PATCHES = (4, 4)
"""Patches of a scene that leaves them open, until they are chosen."""


def block_cells(scene: Scene) -> tuple[int, int, int]:
    """Return the cells of the flat block's mesh: those asked for, or as many as its part needs.

    Laws need it fine under every patch; fields do not.
    """
    cells = scene.block.cells
    if cells is None or cells == "auto":
        return LAW_BLOCK_CELLS if scene.coupling.on_mesh else FIELD_CELLS
    return cells


def meshes_block(scene: Scene) -> bool:
    """Tell whether the flat block is meshed: under laws, or for fields after the load."""
    return scene.coupling.on_mesh or (
        scene.output.fields and scene.coupling.kind not in ("analytic", "reference")
    )


def patch_grid(scene: Scene) -> tuple[int, int]:
    """Return the patches along x and y: those asked for, or what stands for them until chosen."""
    grid = scene.patches.grid
    return PROVISIONAL_PATCHES if grid == "auto" else grid


def check_memory(scene: Scene, nodes: ClusterNodes) -> None:
    """Refuse what could never fit into the memory of the nodes, before anything is allocated.

    Keys that are left to the plan are passed over: it takes nothing that would be refused.

    Args:
        scene: The scene.
        nodes: The nodes of the run.

    Raises:
        InputError: Names the key, its value and what is allowed.
    """
    for key, value, what, need in memory_requests(scene):
        if not nodes.fits(need):
            raise InputError(
                f"{what}needs about {need.total / 1e9:.3g} GB of memory",
                key=key,
                value=list(value) if isinstance(value, tuple) else value,
                allowed=f"what fits into {nodes.remedy(need)}",
                file=scene.file,
            )


def memory_requests(scene: Scene) -> Iterator[tuple[str, object, str, MemoryRequest]]:
    """Yield keys, their values, what of them takes memory, and how much.

    Args:
        scene: The scene.
    """
    grid, patches = scene.surface.grid, scene.patches.grid
    if isinstance(grid, tuple):
        kept = math.prod(grid) * BYTES_PER_SENT_HEIGHT
        made = math.prod(grid) * BYTES_PER_HEIGHT - kept
        yield "surface.grid", grid, "", MemoryRequest(per_rank=kept, root_only=made)
    if meshes_block(scene):  # a reference checks its meshes itself
        nx, ny, nz = block_cells(scene)
        yield "block.cells", (nx, ny, nz), "", MemoryRequest(shared=nx * ny * nz * BYTES_PER_CELL)
        if scene.block.margin:
            more = 2 * scene.block.margin_cells
            need = MemoryRequest(shared=(nx + more) * (ny + more) * nz * BYTES_PER_CELL)
            yield "block.margin_cells", scene.block.margin_cells, "", need
    if not isinstance(patches, tuple):
        return
    count, steps = math.prod(patches), scene.loading.steps * len(scene.loading.load_history.points)
    yield "patches.grid", patches, "", MemoryRequest(per_rank=count * BYTES_PER_HEIGHT)
    if scene.coupling.kind not in ("analytic", "reference"):
        what = "the interaction of all patches with each other "
        yield "patches.grid", patches, what, MemoryRequest(per_rank=count**2 * BYTES_PER_PAIR)
    if scene.coupling.kind in ("isolated", "consistent"):
        law, new = count * BYTES_PER_LAW, count * BYTES_PER_NEW_LAW
        dealt = scene.coupling.kind == "isolated"  # to the ranks; else all are made by rank 0
        need = (
            MemoryRequest(per_rank=law, shared=new)
            if dealt
            else MemoryRequest(per_rank=law, root_only=new)
        )
        yield "patches.grid", patches, "a law for every patch ", need
    what = f"the history of {count} patches "
    need = MemoryRequest(per_rank=steps * (count * BYTES_PER_STATE + 1000))
    yield "load.steps", scene.loading.steps, what, need


def check_patches(scene: Scene, surface: Surface) -> None:
    """Refuse patches that no element or no height can resolve."""
    limits: list[tuple[str, Sequence[int]]] = [("heights of the surface", surface.grid)]
    if meshes_block(scene):
        limits.append(("cells of the interface (block.cells)", block_cells(scene)[:2]))
    grid = patch_grid(scene)
    for what, limit in limits:
        if any(patches > most for patches, most in zip(grid, limit, strict=True)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(grid),
                allowed=f"at most {list(limit)}",
                file=scene.file,
            )


def check_load(scene: Scene, surface: Surface) -> None:
    """Refuse loads that would press a linear elastic block to nothing."""
    if scene.coupling.kind == "analytic":
        return
    block, loading = scene.block, scene.loading
    most, named, unit = block.height_under(surface.lengths), "the block's height", "mm"
    if loading.force is not None:
        most, named, unit = block.young_modulus * surface.area, "E times area", "N"
    key, points = "load.force", loading.force
    if points is None:
        key, points = "load.approach", loading.approach or ()
    if max(points) > most:
        raise InputError(
            "presses the block to nothing",
            key=key,
            value=list(points),
            allowed=f"at most {named}, {most:.6g} {unit}",
            file=scene.file,
        )
