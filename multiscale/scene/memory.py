"""The memory that a run takes; what the nodes do not have is refused before it is allocated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

from patchlaw.geometry.files.content import BYTES_PER_HEIGHT
from patchlaw.multiscale.machine import ClusterNodes, MemoryRequest
from patchlaw.multiscale.scene.parts import Cells, SceneParts, block_section, meshed_cells
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support import InputError


class MemoryLacking(InputError):
    """What a scene asks for does not fit into the memory of the nodes; others may have more."""


def check_memory(nodes: ClusterNodes, requests: Iterable[MemoryRequest]) -> None:
    """Refuse what does not fit into the memory of the nodes, before it is allocated.

    Args:
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


_ALONE = ("analytic", "reference")
"""Couplings whose patches do not interact in the compliance of the bodies."""
_LAWS_MADE_BY = {"consistent": "root_only", "isolated": "shared"}
"""Which ranks make laws of patches."""


def scene_requests(scene: Scene) -> Iterator[MemoryRequest]:
    """Yield the memory that a scene needs, key by key, as far as its file tells.

    Auto values are left out: none is chosen that would not fit.

    Args:
        scene: The scene.
    """
    grids = {"surface.grid": scene.surface.grid, "surface.resample": scene.surface.resample}
    grids["micro.cells"] = scene.micro.cells
    for key, heights in grids.items():
        if isinstance(heights, tuple):
            sent = math.prod(heights) * 17  # a height and its spline, once the surface is made
            made = math.prod(heights) * BYTES_PER_HEIGHT - sent
            yield MemoryRequest(key=key, value=heights, per_rank=sent, root_only=made)
    if (cells := meshed_cells(scene)) is not None:
        yield from _block_requests(scene, cells)
    yield from _patch_requests(scene)


_CELL_WITHOUT_MESH = 320.0
"""Memory of a linear hexahedron where a block is solved for without a mesh [B]: 320 on 40 × 40 × 25
cells under 64 patches, 200 on 80 × 80 × 48 under 16."""


def _block_requests(scene: Scene, cells: Cells) -> Iterator[MemoryRequest]:
    """Yield the memory that a block takes, meshed or solved for without a mesh."""
    nx, ny, nz = cells
    section = block_section(scene)
    each = 5000.0  # mesh, stiffness and multigrid of a cell, roughly
    if _needs_no_mesh(scene):
        each = _CELL_WITHOUT_MESH * int(section.element[1]) ** 3
    yield MemoryRequest(key="block.cells", value=cells, shared=nx * ny * nz * each)
    if section.margin:
        margin = section.margin_cells
        size = (nx + 2 * margin) * (ny + 2 * margin) * nz * each
        yield MemoryRequest(key="block.margin_cells", value=margin, shared=size)


def _needs_no_mesh(scene: Scene) -> bool:
    """Whether a block's patches can be solved for without a mesh, see `bodies.needs_no_mesh`."""
    counter, section = scene.counter_body, block_section(scene)
    return (
        scene.on_mesh
        and section.element.startswith("Q")
        and scene.coupling.interface == "patchwise"
        and not (scene.output.fields or scene.needs_mesh)
        and (counter is None or counter.mesh is None)
    )


def _patch_requests(scene: Scene) -> Iterator[MemoryRequest]:
    """Yield the memory that patches need: their history, their interaction, and their laws.

    A law has 65 rows of 7 numbers on every rank; where it is made it takes more besides, while rows
    are inserted.
    """
    count, loading = math.prod(scene.patches.grid), scene.loading
    asked = partial(MemoryRequest, key="patches.grid", value=scene.patches.grid)
    yield asked(per_rank=count * BYTES_PER_HEIGHT)
    purpose = f"the history of {count} patches"
    size = loading.count * (24 * count + 1000)
    yield MemoryRequest(key="load.steps", value=loading.steps, purpose=purpose, per_rank=size)
    if scene.kind not in _ALONE:
        purpose = "the interaction of all patches with each other"
        yield asked(purpose=purpose, per_rank=40 * count**2)  # matrices, factors
    if made_by := _LAWS_MADE_BY.get(scene.kind):
        sizes: dict[str, Any] = {made_by: 11_400 * count}
        yield asked(purpose="a law for every patch", per_rank=3_600 * count, **sizes)


def body_request(
    key: str, element: str, unknowns: int, steps: int, *, in_parts: bool = False
) -> MemoryRequest:
    """Return the memory that a body on a mesh takes: mesh, stiffness, multigrid and solve.

    Brake pads took 2350 B an unknown over all ranks (2.5·10⁵ unknowns) with P1, 1320 to 1560
    (2·10⁵ to 10⁶) with P2, 4000 (1.9·10⁵) with Q1; an L took 2690 (1.3·10⁵) with Q2, and factors
    of the vertices of a cube 600 more than multigrid (2.9·10⁵). Beside it rank
    0 holds the file while gmsh reads it. Up to 32 earlier states start load steps, and the vectors
    of Newton's method took 107 B an unknown in two steps.

    Args:
        key: Its section of the scene.
        element: Its element, such as ``"P1"``.
        unknowns: Degrees of freedom.
        steps: Load steps.
        in_parts: Its file is read by all ranks in parts, as ``.xdmf`` is, and not by rank 0 whole.
    """
    each = {"P1": 2400, "P2": 1600, "Q1": 4200, "Q2": 3400}[element] + 8 * min(steps, 32) + 100
    read = {"P1": 800, "P2": 120, "Q1": 500, "Q2": 80}[element]
    return MemoryRequest(
        key=f"{key}.mesh",
        value=None,
        purpose=f"the mesh of [{key}], its stiffness and multigrid,",
        shared=float(unknowns) * each,
        root_only=0.0 if in_parts else float(unknowns) * read,
    )


def modes_request(unknowns: int, modes: int) -> MemoryRequest:
    """Return the memory that natural modes take, those kept for the next load step included.

    A cube of 104,544 unknowns took 10 kB an unknown for 20 modes
    (``benchmarks/vibration_size.py``): 3 vectors for each of 6 times as many as are found at a
    time, 8 more than asked for, beside copies of stiffness and mass.

    Args:
        unknowns: Degrees of freedom of all bodies.
        modes: Number of modes.
    """
    each = 6000.0 + 8.0 * (3 * 6 * (modes + 8) + 2 * modes)
    size, purpose = unknowns * each, "finding natural modes"
    return MemoryRequest(key="vibration.modes", value=modes, purpose=purpose, shared=size)


CELL_OF_CONTACT = 165.0
"""Memory of a cell of a contact problem [B]: of one with kernel, work arrays and the maps of a load
step 95 were measured where few cells could touch, 101 where 9/16 could; sides and body add 40,
finite slopes 40."""


def memory_statement(
    parts: SceneParts,
    contact: float,
    requests: Iterable[MemoryRequest],
    program: float,
    ranks: int,
    leak: float = 0.0,
) -> str:
    """Say the memory of the first process, and what takes most of it.

    Args:
        parts: What is known of the scene.
        contact: Memory of the largest contact problem of cells [B].
        requests: The memory that the coupling asks for.
        program: Memory of a process with its libraries, before anything of the scene is in it [B].
        ranks: Processes that share meshes.
        leak: Memory of the largest flow through gaps [B].
    """
    asked = (one for one in requests if not one.key.startswith("surface"))
    sizes = {
        "program": program,
        "surface": 87.0 * parts.surface.heights.size,  # with its spline and figures
        "meshes and laws": sum(one.shared / ranks + one.per_rank + one.root_only for one in asked),
        "contact problem": contact,
        "leak": leak,
    }
    largest = max(sizes, key=lambda part: sizes[part])
    return f"about {sum(sizes.values()) / 1e6:.0f} MB, most of it for the {largest}"
