"""The memory that a scene needs, and its refusal before anything is allocated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

from geometry import InputError
from geometry.files.content import BYTES_PER_HEIGHT
from multiscale.inputs.bodies import Cells, block_section
from multiscale.machine import ClusterNodes, MemoryRequest
from multiscale.scene.scene import Scene

BYTES_PER_CELL = 5000
"""Memory that mesh, stiffness and multigrid take per cell, roughly, over all ranks [B]."""
BYTES_PER_SENT_HEIGHT = 17
"""Memory of a height and its spline on every rank, once the surface is made [B]."""
BYTES_PER_PAIR = 40
"""Memory of dense matrices per pair of patches: compliance, tangent and factors [B]."""
BYTES_PER_LAW, BYTES_PER_NEW_LAW = 3_600, 11_400
"""Memory of a law with 65 rows of 7 numbers on every rank, and of what it takes besides where it
is made, while rows are inserted [B]."""
BYTES_PER_STATE, BYTES_PER_STEP = 24, 1000
"""Memory of a patch's results and of the other results of a load step [B]."""

BYTES_PER_BODY_UNKNOWN = {"P1": 2400, "P2": 1600, "Q1": 4200, "Q2": 2800}
"""Memory of a body on a mesh per unknown, over all ranks: mesh, stiffness, multigrid and solve [B].
Brake pads took 2350 (2.5·10⁵ unknowns) with P1, 1320 to 1560 (2·10⁵ to 10⁶) with P2, 4000 (1.9·10⁵)
with Q1; an L took 2690 (1.3·10⁵) with Q2."""
BYTES_READ_PER_UNKNOWN = {"P1": 800, "P2": 120, "Q1": 500, "Q2": 80}
"""Memory that rank 0 takes besides, per unknown, while gmsh reads the mesh of a body [B]."""
_BYTES_PER_EARLIER_STATE, _MOST_STATES, _WORK_VECTORS = 8, 32, 100
"""Memory per unknown of an earlier state for initial guesses, the largest number of them, and the
vectors of Newton's method [B]. Two load steps took 107."""


class MemoryLacking(InputError):
    """What a scene asks for does not fit into the memory of the nodes; others may have more."""


def check_memory(scene: Scene, nodes: ClusterNodes, requests: Iterable[MemoryRequest]) -> None:
    """Refuse what does not fit into the memory of the nodes, before it is allocated.

    Args:
        scene: The scene.
        nodes: The nodes of the run.
        requests: The memory that is needed.

    Raises:
        MemoryLacking: Names the key, its value and what is allowed.
    """
    for request in requests:
        if not nodes.fits(request):
            value, other = request.value, request.alternative
            raise MemoryLacking(
                request.sentence,
                key=request.key,
                value=list(value) if isinstance(value, tuple) else value,
                allowed=f"what fits into {nodes.remedy(request)}{'; or ' * bool(other)}{other}",
                file=scene.file,
            )


def shortage_warnings(requests: Iterable[MemoryRequest], nodes: ClusterNodes) -> Iterator[str]:
    """Yield what needs more memory than the nodes have.

    Args:
        requests: The memory that is needed.
        nodes: The nodes there are.
    """
    for request in requests:
        if not nodes.fits(request):
            key = "" if request.value is None else f"{request.key} = {request.value}: "
            yield f"{key}{request.sentence}; there is {nodes.remedy(request)}"


def scene_requests(
    scene: Scene, cells: Cells | None, *, interact: bool, made_by: str = ""
) -> Iterator[MemoryRequest]:
    """Yield the memory that a scene needs, key by key, as far as its file tells.

    Auto values are left out: none is chosen that would not fit.

    Args:
        scene: The scene.
        cells: Cells of the block, where it is meshed.
        interact: Whether all patches interact in the compliance of the bodies.
        made_by: Which ranks make laws of patches, ``"shared"`` or ``"root_only"``; empty without.
    """
    grids = {"surface.grid": scene.surface.grid, "surface.resample": scene.surface.resample}
    for key, heights in grids.items():
        if isinstance(heights, tuple):
            sent = math.prod(heights) * BYTES_PER_SENT_HEIGHT
            made = math.prod(heights) * BYTES_PER_HEIGHT - sent
            yield MemoryRequest(key=key, value=heights, per_rank=sent, root_only=made)
    if cells is not None:
        yield from _block_requests(scene, cells)
    if isinstance(scene.patches.grid, tuple):
        yield from _patch_requests(scene, scene.patches.grid, interact, made_by)


def _block_requests(scene: Scene, cells: Cells) -> Iterator[MemoryRequest]:
    """Yield the memory that the mesh of a block needs."""
    nx, ny, nz = cells
    size = nx * ny * nz * BYTES_PER_CELL
    yield MemoryRequest(key="block.cells", value=cells, shared=size)
    if block_section(scene).margin:
        margin = block_section(scene).margin_cells
        size = (nx + 2 * margin) * (ny + 2 * margin) * nz * BYTES_PER_CELL
        yield MemoryRequest(key="block.margin_cells", value=margin, shared=size)


def _patch_requests(
    scene: Scene, patches: tuple[int, int], interact: bool, made_by: str
) -> Iterator[MemoryRequest]:
    """Yield the memory that patches need: their history, their interaction, and their laws."""
    count, loading = math.prod(patches), scene.loading
    asked = partial(MemoryRequest, key="patches.grid", value=patches)
    yield asked(per_rank=count * BYTES_PER_HEIGHT)
    purpose = f"the history of {count} patches"
    size = loading.count * (count * BYTES_PER_STATE + BYTES_PER_STEP)
    yield MemoryRequest(key="load.steps", value=loading.steps, purpose=purpose, per_rank=size)
    if interact:
        purpose = "the interaction of all patches with each other"
        yield asked(purpose=purpose, per_rank=count**2 * BYTES_PER_PAIR)
    if made_by:
        sizes: dict[str, Any] = {made_by: count * BYTES_PER_NEW_LAW}
        yield asked(purpose="a law for every patch", per_rank=count * BYTES_PER_LAW, **sizes)


def body_request(
    key: str, element: str, unknowns: int, steps: int, *, in_parts: bool = False
) -> MemoryRequest:
    """Return the memory that a body on a mesh takes.

    Args:
        key: Its section of the scene.
        element: Its element, such as ``"P1"``.
        unknowns: Degrees of freedom.
        steps: Load steps.
        in_parts: Its file is read by all ranks in parts, as ``.xdmf`` is, and not by rank 0 whole.
    """
    states = min(steps, _MOST_STATES) * _BYTES_PER_EARLIER_STATE
    each = BYTES_PER_BODY_UNKNOWN[element] + states + _WORK_VECTORS
    return MemoryRequest(
        key=f"{key}.mesh",
        value=None,
        purpose=f"the mesh of [{key}], its stiffness and multigrid,",
        shared=float(unknowns) * each,
        root_only=0.0 if in_parts else float(unknowns) * BYTES_READ_PER_UNKNOWN[element],
    )
