"""Predicts the largest memory of the first process of a run, part by part."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

from micro import HalfSpaceModel
from multiscale.loading.stepper import LoadHistory
from multiscale.machine import MemoryRequest, peak_memory
from multiscale.measured_errors import MOST_CHECKED_CELLS
from multiscale.scene.bodies import CounterBodySection
from multiscale.setup.memory import body_request, memory_requests
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import reference_requests

_LIBRARIES = {"dolfinx": 70e6, "matplotlib": 70e6}
"""Memory of libraries that runs import when they need them [B]."""
_SURFACE, _SUMMITS = 37.0, 100.0
"""Memory per height of the surface with its spline, and of finding its summits [B]."""
_SOLVED, _BODY, _MAPS, _SLOPES = 90.0, 40.0, 35.0, 40.0
"""Memory per cell of a contact problem with its kernel, work array and arrays of the cells that can
touch, of free sides and body, of the maps of a load step, and of finite slopes [B]. With maps 95
were measured where few cells could touch, 101 where 9/16 of 512² and of 1024² cells could."""
_FACE, _CUBE, _FACTORISATION = 1.25e9, 11_271, 1.2
"""Memory of the compliance of the face of a cube in 64 modes [B], the unknowns of its 16 × 16 × 12
trilinear hexahedra, which are raised to quadratic ones and whose stiffness is factorised, and the
power of them that the memory grows with."""
_KEPT = 60.0
"""Memory per cell that the run keeps while an error check solves a finer grid [B]."""
_FIGURES = 25.0
"""Memory per height of figures, and of the maps of a contact that are written [B]."""


@dataclass(frozen=True, kw_only=True)
class Launch:
    """How a run is started.

    Attributes:
        ranks: Processes of the MPI job.
        memory: Memory of a process before anything of the scene is in it [B].
        imported: Tells whether a library has been imported by then.
        solves_face: Whether the compliance of a meshed body is yet to be solved for.
    """

    ranks: int = 1
    memory: float = field(default_factory=peak_memory)
    imported: Callable[[str], bool] = sys.modules.__contains__
    solves_face: bool = False

    @classmethod
    def anew(cls, memory: float, ranks: int = 1, *, solves_face: bool = False) -> Launch:
        """Return the start of a program of its own, in which no library has been imported.

        Args:
            memory: Memory of this process when it had imported the same [B].
            ranks: Processes of the MPI job.
            solves_face: As the attribute.
        """
        return cls(ranks=ranks, memory=memory, imported=lambda _: False, solves_face=solves_face)


def step_count(load_history: LoadHistory) -> int:
    """Return the number of load steps, as far as it is known before the run.

    Args:
        load_history: The loads, whose steps may be halved by a largest change of the force.
    """
    change = load_history.force_change or math.inf
    return max(load_history.count, math.ceil(load_history.legs / change))


def run_memory_requests(setup: ProblemSetup) -> list[MemoryRequest]:
    """Return what a run needs memory for, key by key of its scene.

    Args:
        setup: The problem.
    """
    meshes, scene = setup.meshes, setup.scene
    steps = step_count(scene.loading)
    of_bodies = [
        body_request(key, face.element, face.unknowns, steps, in_parts=_in_parts(section))
        for key, face, section in (
            ("body", setup.face, scene.body),
            ("counter_body", setup.counter_face, scene.counter_body),
        )
        if face is not None and face.digest
    ]
    of_meshes = reference_requests(scene, meshes) if meshes else ()
    return [*memory_requests(scene), *of_bodies, *of_meshes]


def _in_parts(section: CounterBodySection | None) -> bool:
    """Return whether all ranks read a body's mesh in parts."""
    mesh = section.mesh if section else None
    return mesh is not None and mesh.lower().endswith(".xdmf")


def memory_parts(setup: ProblemSetup, launch: Launch) -> dict[str, float]:
    """Return the memory of the parts of the first process that are held at its largest [B].

    Args:
        setup: The problem.
        launch: How the run is started.
    """
    output, heights = setup.scene.output, setup.surface.heights.size
    program, figures = launch.memory, _FIGURES * heights
    if setup.has_block and not launch.imported("dolfinx"):
        program += _LIBRARIES["dolfinx"]
    if output.figures:
        figures += _FIGURES * heights
        figures += 0.0 if launch.imported("matplotlib") else _LIBRARIES["matplotlib"]
    requests = [one for one in run_memory_requests(setup) if not one.key.startswith("surface")]
    asked = sum(one.shared / launch.ranks + one.per_rank + one.root_only for one in requests)
    summits = _SUMMITS if setup.uses_summits else 0.0
    parts = {
        "program": program,
        "surface": (_SURFACE + summits) * heights,
        "meshes and laws": asked,
        "body term": _face_bytes(setup) if launch.solves_face else 0.0,
        **_contact_or_figures(setup, figures),
    }
    return {part: size for part, size in parts.items() if size}


def checks_finer(setup: ProblemSetup, cells: int) -> bool:
    """Tell whether an error check is expected to solve a grid twice as fine.

    Where finite slopes are left out their error outweighs that of the grid.

    Args:
        setup: The problem.
        cells: Cells of the half-space.
    """
    return setup.finite_slopes and 4 * cells <= MOST_CHECKED_CELLS


def _face_bytes(setup: ProblemSetup) -> float:
    """Return the memory of the compliance of the meshed bodies' faces [B]."""
    faces = [face for face in (setup.face, setup.counter_face) if face is not None and face.digest]
    return _FACE * sum((face.unknowns / _CUBE) ** _FACTORISATION for face in faces)


def _contact_or_figures(setup: ProblemSetup, figures: float) -> dict[str, float]:
    """Return the memory of an error check, or of the contact problem and figures after it [B]."""
    if not isinstance(setup.micro, HalfSpaceModel):
        return {"figures": figures}
    cells = setup.micro.surface.heights.size
    solved = _SOLVED
    if setup.scene.kind == "isolated":
        return {"contact problem": solved * cells / setup.patches.count, "figures": figures}
    solved += _BODY * (setup.has_block and not setup.samples)
    run = (solved + _MAPS + _SLOPES * setup.finite_slopes) * cells
    check = (_KEPT + 4.0 * solved) * cells
    checks = setup.scene.output.check != "none" and not setup.samples
    if checks and checks_finer(setup, cells) and check > run + figures:
        return {"error check": check}
    return {"contact problem": run, "figures": figures}
