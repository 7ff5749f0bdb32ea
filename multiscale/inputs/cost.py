"""What a run computes and the memory it takes, counted; and the order of magnitude of its time.

The work of a contact problem is its cells times its products with the compliance, that of a mesh
its unknowns times its multigrid cycles. Two rates of one core make seconds of them. No clock is
read: the same scene has the same work on every machine, and a run tells its own pace after its
first load step. Memory that the nodes do not have is refused before anything is allocated.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from patchlaw.geometry.files.content import BYTES_PER_HEIGHT
from patchlaw.multiscale.inputs.bodies import Cells, block_section
from patchlaw.multiscale.inputs.scene_parts import SceneParts
from patchlaw.multiscale.machine import ClusterNodes, MemoryRequest
from patchlaw.multiscale.readable import duration, number
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.errors import InputError


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
            sent = math.prod(heights) * 17  # a height and its spline, once the surface is made
            made = math.prod(heights) * BYTES_PER_HEIGHT - sent
            yield MemoryRequest(key=key, value=heights, per_rank=sent, root_only=made)
    if cells is not None:
        yield from _block_requests(scene, cells)
    if isinstance(scene.patches.grid, tuple):
        yield from _patch_requests(scene, scene.patches.grid, interact, made_by)


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
        and not (scene.output.fields or scene.rubs_on_mesh or scene.loads_bodies)
        and (counter is None or counter.mesh is None)
    )


def _patch_requests(
    scene: Scene, patches: tuple[int, int], interact: bool, made_by: str
) -> Iterator[MemoryRequest]:
    """Yield the memory that patches need: their history, their interaction, and their laws.

    A law has 65 rows of 7 numbers on every rank; where it is made it takes more besides, while rows
    are inserted.
    """
    count, loading = math.prod(patches), scene.loading
    asked = partial(MemoryRequest, key="patches.grid", value=patches)
    yield asked(per_rank=count * BYTES_PER_HEIGHT)
    purpose = f"the history of {count} patches"
    size = loading.count * (24 * count + 1000)
    yield MemoryRequest(key="load.steps", value=loading.steps, purpose=purpose, per_rank=size)
    if interact:
        purpose = "the interaction of all patches with each other"
        yield asked(purpose=purpose, per_rank=40 * count**2)  # matrices, factors
    if made_by:
        sizes: dict[str, Any] = {made_by: 11_400 * count}
        yield asked(purpose="a law for every patch", per_rank=3_600 * count, **sizes)


def body_request(
    key: str, element: str, unknowns: int, steps: int, *, in_parts: bool = False
) -> MemoryRequest:
    """Return the memory that a body on a mesh takes: mesh, stiffness, multigrid and solve.

    Brake pads took 2350 B an unknown over all ranks (2.5·10⁵ unknowns) with P1, 1320 to 1560
    (2·10⁵ to 10⁶) with P2, 4000 (1.9·10⁵) with Q1; an L took 2690 (1.3·10⁵) with Q2. Beside it rank
    0 holds the file while gmsh reads it. Up to 32 earlier states start load steps, and the vectors
    of Newton's method took 107 B an unknown in two steps.

    Args:
        key: Its section of the scene.
        element: Its element, such as ``"P1"``.
        unknowns: Degrees of freedom.
        steps: Load steps.
        in_parts: Its file is read by all ranks in parts, as ``.xdmf`` is, and not by rank 0 whole.
    """
    each = {"P1": 2400, "P2": 1600, "Q1": 4200, "Q2": 2800}[element] + 8 * min(steps, 32) + 100
    read = {"P1": 800, "P2": 120, "Q1": 500, "Q2": 80}[element]
    return MemoryRequest(
        key=f"{key}.mesh",
        value=None,
        purpose=f"the mesh of [{key}], its stiffness and multigrid,",
        shared=float(unknowns) * each,
        root_only=0.0 if in_parts else float(unknowns) * read,
    )


_CELL_PRODUCTS = 3e7
"""Cells × products a second. Load steps on 128², 256² and 512² cells without finite slopes took 21,
66 and 260 ms (docs/speed.md, 2026-11-22), with some 30 products each."""
_UNKNOWN_CYCLES = 1e6
"""Unknowns × multigrid cycles a second. Hexahedra and tetrahedra, linear and quadratic, took 0.5 to
2.6 µs per unknown and cycle (8 to 131 thousand unknowns, 2026-11-22)."""
SOLUTIONS_OF_LAWS = 84
"""Solutions of the contact problem that a table of laws takes. Models of cells took 75 to 105 for
45 to 65 rows, models of summits 60 to 150."""
SET_UP_CYCLES, FACE_CYCLES = 20.0, 1000.0
"""Multigrid cycles that meshing, the stiffness and its multigrid are worth, 9 to 70; and those of
the compliance of a meshed body's face in 64 modes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What a run computes.

    Attributes:
        size: Cells of its contact problem, which isolated laws share; of asperities the pairs that
            interact; 0 where contact is meshed.
        solutions: Contact problems that are solved, error check and rows of laws included.
        rows: Rows of laws; 0 without laws.
        finite_slopes: Whether finite slopes count.
        finer: Cells of the largest contact problem, that of an error check, over those of the run.
        unknowns: Degrees of freedom of all meshes; 0 without meshes.
        cycles: Unknowns times multigrid cycles, of all meshes.
        ranks: Processes that share the meshes.
        of_pairs: Whether pairs of asperities are counted instead of cells.
    """

    size: int = 0
    solutions: float = 0.0
    rows: int = 0
    finite_slopes: bool = False
    finer: float = 1.0
    unknowns: int = 0
    cycles: float = 0.0
    ranks: int = 1
    of_pairs: bool = False

    @property
    def products(self) -> float:
        """Cells or pairs times products with the compliance, of all contact problems."""
        # 15 to 60 products on 64² to 1024² cells, finite slopes 2.4 times as many
        return self.solutions * self.size * (72.0 if self.finite_slopes else 30.0)

    @property
    def memory(self) -> float:
        """Memory of the largest contact problem of cells [B]."""
        # Of a cell with kernel, work arrays and the maps of a load step 95 B were measured where
        # few cells could touch, 101 where 9/16 could; sides and body add 40, finite slopes 40.
        return 0.0 if self.of_pairs else 165.0 * self.finer * self.size

    @property
    def computing(self) -> float:
        """Time of contact problems and meshes, to an order of magnitude [s].

        It is that of cores of the kind that the rates were measured on.
        """
        meshes = self.cycles / _UNKNOWN_CYCLES / self.ranks
        return self.products / _CELL_PRODUCTS + meshes

    def statements(self) -> Iterator[tuple[str, str]]:
        """Yield what was counted, with its topic."""
        counted = []
        if self.size:
            laws = f", {self.rows} of them rows of laws" if self.rows else ""
            what = "pairs" if self.of_pairs else "cells"
            counted.append(
                f"about {self.solutions:.0f} contact problems{laws}, on {self.size} {what} each: "
                f"{_millions(self.products)} {what} × products"
            )
        if self.cycles:
            counted.append(
                f"meshes of about {_millions(self.unknowns)} unknowns: "
                f"{_millions(self.cycles)} unknowns × multigrid cycles"
            )
        if counted:
            yield "work", "; ".join(counted)


def _millions(count: float) -> str:
    return f"{number(1e-6 * count, 2)} million"


def cost_statement(
    parts: SceneParts, work: Work, requests: Iterable[MemoryRequest], program: float
) -> tuple[str, str]:
    """Return the order of magnitude of a run's time, and its memory, with their topic.

    Args:
        parts: What is known of the scene.
        work: What its coupling computes.
        requests: The memory that it needs.
        program: Memory of a process before anything of the scene is in it [B].
    """
    output = parts.scene.output
    # 2 s for imports and tables, 4 s for figures and report
    seconds = work.computing + 2.0 + 4.0 * bool(output.figures or output.report)
    memory = memory_parts(parts, work, requests, program)
    largest = max(memory, key=lambda part: memory[part])
    return (
        "cost",
        f"of the order of {magnitude(seconds)}, more on slow or busy cores; the run tells its own "
        f"pace after its first load step; {sum(memory.values()) / 1e6:.0f} MB, most of it for the "
        f"{largest}",
    )


def memory_parts(
    parts: SceneParts, work: Work, requests: Iterable[MemoryRequest], program: float
) -> dict[str, float]:
    """Return the memory of the first process by part [B].

    Args:
        parts: What is known of the scene.
        work: What its coupling computes.
        requests: The memory that it needs.
        program: Memory of a process before anything of the scene is in it [B].
    """
    # dolfinx and matplotlib take 70 MB each
    libraries = parts.has_body + bool(parts.scene.output.figures)
    asked = (one for one in requests if not one.key.startswith("surface"))
    return {
        "program": program + 70e6 * libraries,
        "surface": 87.0 * parts.surface.heights.size,  # with its spline and figures
        "meshes and laws": sum(
            one.shared / work.ranks + one.per_rank + one.root_only for one in asked
        ),
        "contact problem": work.memory,
    }


def magnitude(seconds: float) -> str:
    """Return the order of magnitude of a time, such as ``10 s`` or ``3 h``.

    Args:
        seconds: The time [s].
    """
    minutes, hours = (30, 120, 300, 900), (1, 3, 10, 24, 72, 240)
    orders = (1, 3, 10, *minutes, *(3600 * each for each in hours))
    return duration(min(orders, key=lambda one: abs(math.log(one / max(seconds, 1e-3)))))
