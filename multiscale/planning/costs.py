"""Predicts time and memory of a run, phase by phase, before anything expensive starts.

Work is counted, and its time was measured on one core of an Intel Xeon (Rocket Lake, 3 GHz). Two
benchmarks compare this machine with that one. Multigrid cycles and set-ups were measured on meshes
of 8 to 131 thousand unknowns.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

from micro import HalfSpaceModel, ScaledModel
from micro.choice.models import contact_box_share, solution_seconds
from multiscale.couplings.assembly import CYCLES_PER_PATCH, full_cycles, newton_choice
from multiscale.loading.stepper import LoadHistory
from multiscale.machine import MemoryRequest, peak_memory
from multiscale.planning.machine_speed import THIS_MACHINE, Machine
from multiscale.setup.memory import body_request, memory_requests
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import (
    ReferenceMeshes,
    mesh_unknowns,
    reference_requests,
)

# contact problems
ROWS = {"cells": 56, "summits": 70}
"""Rows of a table of laws. Models of cells took 45 to 65, models of summits 60 to 150."""
_ROW = 1.5
"""Solutions that a row of consistent laws is worth, with its derivative; measured on 64² cells."""
_BLOCK, _BLOCK_EACH = 1.9, 5e-3
"""Factor of the work of a solution, and time besides [s], where the half-space has free sides and
the correction of a body; measured on 64² to 256² cells, like the next two."""
_SLOPES, _SLOPES_EACH = 1.8, 20e-3
"""Factor of the work of a solution, and time besides [s], with finite slopes."""
_ERROR_CHECK = 5.0
"""Solutions that measuring the errors of a load step is worth; 2 to 7 were measured with finite
slopes."""
_STIFFNESS = 0.3
"""Solutions that the interfacial stiffness of a load step is worth, with its maps at the last one;
0.28 on 64² cells with finite slopes and a body, 0.26 on 1024² cells of a half-space."""
_PATCH_SUMS = 4e-6
"""Time of a patch's sums in a row of consistent laws [s]."""

# times on one core [s]
_SURFACE, _SURFACE_HEIGHT = 6.5e-3, 0.22e-6
_CHOICE, _CHOICE_HEIGHT = 0.05, 6e-6
"""Time of choosing a micro model, and of it per height of the surface."""
_IMPORT, _BODY = 0.7, 0.065
"""Times of importing dolfinx, PETSc and gmsh, and of the body correction of a cube. Thin blocks
take several times longer."""
_MESH, _REFERENCE_MESH, _ACTIVE_SETS = 0.026, 0.052, 0.013
"""Times of meshing a block, of meshing a rough block, and of a load step by active sets."""
_DRAWING, _FIGURE, _BLOCK_FIGURE = 0.21, 0.28, 0.9
"""Times of importing matplotlib, of a figure, and of that in three dimensions."""
_NEWTON_STEPS = 2.7
"""Newton steps of a load step of laws whose compliance is condensed to the patches."""

# sparse matrices
_ENTRY = 1.15e-9
"""Time of an entry of the stiffness in a product with a vector [s]."""
_ENTRIES = {"Q1": 81.0, "P1": 45.0, "Q2": 190.0, "P2": 85.0}
"""Entries of the stiffness per unknown."""
_SET_UP, _CYCLE, _CYCLE_OVERHEAD = 250.0, 6.6, 0.13e-3
"""Products with the stiffness that mesh, stiffness and multigrid take as long as; those of a
multigrid cycle; and the time of a cycle besides [s]."""
_ALGEBRAIC_SET_UP, _ALGEBRAIC_CYCLE = {"Q1": 1000.0, "P1": 500.0}, 17.0
"""The same of meshes without a lattice, reading included: a pad of 10⁶ unknowns of tetrahedra took
490 and 17, a ring of 10⁵ of flat hexahedra 1000 and 14. Quadratic elements are taken to be like
linear ones."""
_REFERENCE_CYCLES = {"Q1": 15.0, "Q2": 60.0, "P1": 40.0, "P2": 60.0}
"""Multigrid cycles of a load step of a reference. 15 to 22, 31 to 44 and 51 to 76 were counted with
Q1, P1 and P2. Q2 is taken to be like P2."""
_FREE_TILT = 1.4
"""Factor of these cycles where the plane is free to tilt: up to 90 were counted with P2."""

# memory [B]
_BYTES_PER_CELL, _FINITE_ELEMENTS, _PICTURES = 700.0, 95e6, 60e6
"""Memory of the half-space per cell, of the libraries for finite elements, and of matplotlib."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a run is predicted to take on one core.

    Attributes:
        seconds: Time of each phase that the run has, in their order [s].
        memory: Largest memory of the process [B].
    """

    seconds: dict[str, float]
    memory: float

    @property
    def total(self) -> float:
        """Time of all phases [s]."""
        return sum(self.seconds.values())


def predicted_cost(setup: ProblemSetup, machine: Machine = THIS_MACHINE) -> Cost:
    """Predict what a run takes.

    Args:
        setup: The problem.
        machine: How fast the machine is; by default the one that runs this process.
    """
    scene, output = setup.scene, setup.scene.output
    steps, heights = step_count(scene.loading.load_history), setup.surface.heights.size
    seconds = {"surface": machine.arrays * (_SURFACE + _SURFACE_HEIGHT * heights)}
    on_mesh = setup.uses_laws and not newton_choice(setup).condensed
    if setup.choice is not None:
        seconds["micro choice"] = machine.arrays * (_CHOICE + _CHOICE_HEIGHT * heights)
    if setup.uses_laws:
        seconds["laws"] = machine.arrays * _law_seconds(setup)
    if setup.meshes is not None:
        seconds |= _reference_seconds(setup, setup.meshes, steps, machine)
    else:
        seconds |= _contact_seconds(setup, steps, machine, on_mesh=on_mesh)
    on_cells = isinstance(setup.micro, HalfSpaceModel) and not setup.samples
    if on_cells and (solutions := _shown_solutions(setup, steps)):
        seconds["contact"] = machine.arrays * solutions * solution_time(setup)
    if on_cells and output.check != "none":
        solutions = (_ERROR_CHECK + setup.uses_laws) * (steps if output.check == "all" else 1)
        seconds["check"] = machine.arrays * solutions * solution_time(setup)
    if output.fields and setup.has_block and not (on_mesh or setup.meshes):
        fields = sum(output.wants_fields(one, last=one == steps) for one in range(1, steps + 1))
        seconds["field"] = _mesh_seconds(setup, machine, CYCLES_PER_PATCH * fields)
    if output.figures:
        figures = (4 if setup.uses_laws else 3) * _FIGURE
        figures += (output.figures == "all") * _BLOCK_FIGURE
        seconds["output"] = machine.arrays * (figures + _unless_imported("matplotlib", _DRAWING))
    return Cost(seconds=seconds, memory=_memory(setup))


def _shown_solutions(setup: ProblemSetup, steps: int) -> float:
    """Return how many solutions of the contact problem the contacts to be shown are worth."""
    asked = setup.scene.output.contact
    if not setup.uses_laws:
        return 0.0 if asked == "none" else _STIFFNESS * steps
    return {"all": float(steps), "last": 1.0}.get(asked, 0.0)


def _reference_seconds(
    setup: ProblemSetup, meshes: ReferenceMeshes, steps: int, machine: Machine
) -> dict[str, float]:
    """Return the time of meshing a rough block and of its load steps by active sets, by phase."""
    element = ("Q" if meshes.hexahedral else "P") + str(meshes.degree)
    product = machine.sparse * _ENTRY * _ENTRIES[element] * sum(meshes.unknowns)
    cycles = steps * _REFERENCE_CYCLES[element]
    if setup.scene.loading.tilt == "free":
        cycles *= _FREE_TILT
    made = machine.arrays * (_REFERENCE_MESH + _unless_imported("dolfinx", _IMPORT))
    return {
        "block": made + _SET_UP * product,
        "load steps": machine.arrays * _ACTIVE_SETS * steps + _CYCLE * cycles * product,
    }


def solution_time(setup: ProblemSetup, *, one_patch: bool = False) -> float:
    """Return the time of one solution of a scene's micro model, started from one nearby [s].

    Args:
        setup: The problem.
        one_patch: Whether only the surface of one patch is solved for.

    Returns:
        The time on the machine where it was measured.
    """
    model, cells = setup.model, setup.surface.heights.size
    if isinstance(model, HalfSpaceModel):
        cells = model.surface.heights.size
    summits = int(setup.interfering_summits.sum())
    if one_patch:
        cells //= setup.patches.count
        summits //= max(setup.interfering_patches, 1)
    kind = "scaled" if isinstance(model, ScaledModel) else model.name
    box = contact_box_share(setup.cell_interference)
    seconds = solution_seconds(kind, cells, box=box, summits=summits)
    if one_patch or not isinstance(model, HalfSpaceModel):
        return seconds
    if setup.has_block:
        seconds = _BLOCK * seconds + _BLOCK_EACH
    return _SLOPES * seconds + _SLOPES_EACH if setup.finite_slopes else seconds


def step_count(load_history: LoadHistory) -> int:
    """Return the number of load steps, as far as it is known before the run.

    Args:
        load_history: The loads, whose steps may be halved by a largest change of the force.
    """
    change = load_history.force_change or math.inf
    return max(load_history.count, math.ceil(load_history.legs / change))


def _law_seconds(setup: ProblemSetup) -> float:
    """Return the time of tabulating laws [s], on the machine where it was measured."""
    rows = ROWS["summits" if setup.uses_summits else "cells"]
    if setup.samples:
        samples = sum(len(region.surfaces) for region in setup.samples)
        return rows * _ROW * samples * solution_time(setup)
    if setup.scene.kind == "isolated":
        return rows * setup.interfering_patches * solution_time(setup, one_patch=True)
    return rows * (_ROW * solution_time(setup) + _PATCH_SUMS * setup.patches.count)


def _contact_seconds(
    setup: ProblemSetup, steps: int, machine: Machine, *, on_mesh: bool
) -> dict[str, float]:
    """Return the time of making a flat block and of its load steps, by phase [s]."""
    patches, block = setup.patches.count, 0.0
    if setup.has_block:
        block = machine.arrays * _unless_imported("dolfinx", _IMPORT)
        if setup.scene.decomposed:
            block += machine.arrays * _BODY
        else:
            block += _mesh_seconds(setup, machine, 0 if on_mesh else CYCLES_PER_PATCH * patches)
    if on_mesh:
        load_steps = _mesh_seconds(setup, machine, full_cycles(setup, steps), made=False)
    elif setup.uses_laws:
        dense = 0.3e-3 + 33e-9 * patches**2 + 14e-12 * patches**3  # a dense factorisation
        load_steps = machine.arrays * _NEWTON_STEPS * steps * dense
    else:
        load_steps = machine.arrays * steps * solution_time(setup)
    return {"block": block, "load steps": load_steps}


def _mesh_seconds(
    setup: ProblemSetup, machine: Machine, cycles: int, *, made: bool = True
) -> float:
    """Return the time of multigrid cycles on a mesh, and of making it and its multigrid [s]."""
    cycle, set_up = machine.arrays * _CYCLE_OVERHEAD, machine.arrays * _MESH
    for face in filter(None, (setup.face, setup.counter_face)):
        product = machine.sparse * _ENTRY * _ENTRIES[face.element] * face.unknowns
        cycle += _ALGEBRAIC_CYCLE * product
        set_up += _ALGEBRAIC_SET_UP[f"{face.element[0]}1"] * product
    if setup.face is None:
        shape = setup.shape
        product = machine.sparse * _ENTRY * _ENTRIES[shape.element] * mesh_unknowns(shape)
        cycle, set_up = cycle + _CYCLE * product, set_up + _SET_UP * product
    return cycles * cycle + made * set_up


def _unless_imported(module: str, cost: float) -> float:
    """Return what importing a library costs, which is nothing when it has been imported."""
    return 0.0 if module in sys.modules else cost


def run_memory_requests(setup: ProblemSetup) -> list[MemoryRequest]:
    """Return what a run needs memory for, key by key of its scene.

    Args:
        setup: The problem.
    """
    meshes, scene = setup.meshes, setup.scene
    steps = step_count(scene.loading.load_history)
    of_bodies = [
        body_request(key, face.element, face.unknowns, steps)
        for key, face in (("body", setup.face), ("counter_body", setup.counter_face))
        if face is not None and face.digest
    ]
    of_meshes = reference_requests(scene, meshes) if meshes else ()
    return [*memory_requests(scene), *of_bodies, *of_meshes]


def _memory(setup: ProblemSetup) -> float:
    """Return the largest memory of this process so far and what the run adds [B]."""
    half_space = 0.0
    if isinstance(setup.micro, HalfSpaceModel):
        half_space = _BYTES_PER_CELL * setup.micro.surface.heights.size
    libraries = setup.has_block * _unless_imported("dolfinx", _FINITE_ELEMENTS)
    pictures = bool(setup.scene.output.figures) * _unless_imported("matplotlib", _PICTURES)
    needs = sum(need.total for need in run_memory_requests(setup))
    return peak_memory() + needs + max(half_space, libraries) + pictures
