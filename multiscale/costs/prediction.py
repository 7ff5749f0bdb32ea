"""Predicts time and memory of a run, phase by phase, before anything expensive starts.

Times are sums of counted work, in seconds on the machine where it was measured. Multigrid cycles
and set-ups were measured on meshes of 8 to 131 thousand unknowns.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

from geometry.meshes.block import BlockShape
from micro import HalfSpaceModel, ScaledModel
from micro.choice.models import contact_box_share, solution_seconds
from multiscale.costs.work import Machine, Work, this_machine
from multiscale.couplings.newton_choice import CYCLES_PER_PATCH, full_cycles, newton_choice
from multiscale.loading.stepper import LoadHistory
from multiscale.machine.nodes import peak_memory
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import ReferenceMeshes, mesh_unknowns

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
_PATCH_SUMS = 4e-6
"""Time of a patch's sums in a row of consistent laws [s]."""

# times on one core [s]
_SURFACE, _SURFACE_HEIGHT = 6.5e-3, 0.22e-6
_MICRO_CHOICE, _MICRO_CHOICE_HEIGHT = 0.05, 6e-6
"""Time of choosing a micro model, and of it per height of the surface."""
_IMPORT, _BODY = 0.7, 0.065
"""Times of importing dolfinx, PETSc and gmsh, and of the body correction of a cube. Thin blocks
take several times longer."""
_MESH, _REFERENCE_MESH, _ACTIVE_SETS = 0.026, 0.052, 0.013
"""Times of meshing a block, of meshing a rough block, and of a load step by active sets."""
_DRAWING, _FIGURE = 0.21, 0.16
"""Times of importing matplotlib, and of a figure."""
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
_REFERENCE_CYCLES = {"Q1": 15, "Q2": 60, "P1": 40, "P2": 60}
"""Multigrid cycles of a load step of a reference. 15 to 22, 31 to 44 and 51 to 76 were counted with
Q1, P1 and P2. Q2 is taken to be like P2."""
_FREE_TILT = 1.4
"""Factor of these cycles where the plane is free to tilt: up to 90 were counted with P2."""

# memory [B]
_BYTES_PER_HEIGHT, _BYTES_PER_CELL, _BYTES_PER_ENTRY = 120.0, 700.0, 30.0
"""Memory of surface, spline and spectrum per height; of the half-space per cell; of a block per
entry of its stiffness."""
_FINITE_ELEMENTS, _PICTURES = 95e6, 60e6
"""Memory of the libraries for finite elements, and of matplotlib."""


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


def predicted_cost(setup: ProblemSetup, machine: Machine | None = None) -> Cost:
    """Predict what a run takes.

    Args:
        setup: The problem.
        machine: How fast the machine is; by default the one that runs this process.
    """
    machine, scene = machine or this_machine(), setup.scene
    steps, heights = step_count(scene.loading.load_history), setup.surface.heights.size
    works = {"surface": Work(arrays=_SURFACE + _SURFACE_HEIGHT * heights)}
    if setup.choice is not None:
        works["micro choice"] = Work(arrays=_MICRO_CHOICE + _MICRO_CHOICE_HEIGHT * heights)
    if setup.uses_laws:
        works["laws"] = law_work(setup)
    if setup.meshes is not None:
        works |= reference_work(setup.meshes, steps, free_tilt=scene.loading.tilt == "free")
    else:
        works["block"], works["load steps"] = _block_work(setup), _load_step_work(setup, steps)
    if isinstance(setup.micro, HalfSpaceModel) and scene.output.check != "none":
        checks = steps if scene.output.check == "all" else 1
        works["check"] = checks * error_check_work(setup)
    meshed = setup.meshes is not None or _is_solved_on_mesh(setup)
    if scene.output.fields and setup.has_block and not meshed:
        works["field"] = _mesh_work(setup.shape) + _cycle_work(setup.shape, CYCLES_PER_PATCH)
    if scene.output.figures:
        figures = (4 if setup.uses_laws else 3) * _FIGURE
        works["output"] = Work(arrays=figures + _import_time("matplotlib", _DRAWING))
    seconds = {phase: machine.seconds(work) for phase, work in works.items()}
    return Cost(seconds=seconds, memory=_memory(setup, steps))


def reference_work(
    meshes: ReferenceMeshes, steps: int, *, free_tilt: bool = False
) -> dict[str, Work]:
    """Return the work of meshing a rough block and of its load steps by active sets, by phase.

    Args:
        meshes: The meshes.
        steps: Load steps.
        free_tilt: Whether the plane is free to tilt.
    """
    element = ("Q" if meshes.hexahedral else "P") + str(meshes.degree)
    product = _ENTRY * _ENTRIES[element] * sum(meshes.unknowns)
    cycles = steps * _REFERENCE_CYCLES[element] * (_FREE_TILT if free_tilt else 1.0)
    made = _REFERENCE_MESH + _import_time("dolfinx", _IMPORT)
    return {
        "block": Work(arrays=made, sparse=_SET_UP * product),
        "load steps": Work(arrays=_ACTIVE_SETS * steps, sparse=_CYCLE * cycles * product),
    }


def solution_work(setup: ProblemSetup, *, one_patch: bool = False) -> Work:
    """Return the work of one solution of a scene's micro model, started from one nearby.

    Args:
        setup: The problem.
        one_patch: Whether only the surface of one patch is solved for.
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
    work = Work(arrays=solution_seconds(kind, cells, box=box, summits=summits))
    if one_patch or not isinstance(model, HalfSpaceModel):
        return work
    if setup.has_block:
        work = _BLOCK * work + Work(arrays=_BLOCK_EACH)
    return _SLOPES * work + Work(arrays=_SLOPES_EACH) if setup.finite_slopes else work


def law_work(setup: ProblemSetup) -> Work:
    """Return the work of tabulating the laws of a scene.

    Args:
        setup: The problem.
    """
    rows = ROWS["summits" if setup.uses_summits else "cells"]
    if setup.scene.coupling.kind == "isolated":
        return rows * setup.interfering_patches * solution_work(setup, one_patch=True)
    return rows * (_ROW * solution_work(setup) + Work(arrays=_PATCH_SUMS * setup.patches.count))


def error_check_work(setup: ProblemSetup) -> Work:
    """Return the work of measuring the errors of one load step.

    Args:
        setup: The problem.
    """
    return (_ERROR_CHECK + float(setup.uses_laws)) * solution_work(setup)


def step_count(load_history: LoadHistory) -> int:
    """Return the number of load steps, as far as it is known before the run.

    Args:
        load_history: The loads, whose steps may be halved by a largest change of the force.
    """
    if load_history.force_change is None:
        return load_history.count
    halved = math.ceil(len(load_history.points) / load_history.force_change)
    return max(load_history.count, halved)


def _block_work(setup: ProblemSetup) -> Work:
    if not setup.has_block:
        return Work()
    imported = Work(arrays=_import_time("dolfinx", _IMPORT))
    if setup.scene.coupling.decomposed:
        return imported + Work(arrays=_BODY)
    work = imported + _mesh_work(setup.shape)
    if newton_choice(setup).condensed:
        work += _cycle_work(setup.shape, CYCLES_PER_PATCH * setup.patches.count)
    return work


def _load_step_work(setup: ProblemSetup, steps: int) -> Work:
    if not setup.uses_laws:
        return steps * solution_work(setup)
    if _is_solved_on_mesh(setup):
        return _cycle_work(setup.shape, full_cycles(setup, steps))
    patches = setup.patches.count
    dense = 0.3e-3 + 33e-9 * patches**2 + 14e-12 * patches**3  # a dense factorisation
    return Work(arrays=_NEWTON_STEPS * steps * dense)


def _is_solved_on_mesh(setup: ProblemSetup) -> bool:
    return setup.uses_laws and not newton_choice(setup).condensed


def _mesh_work(shape: BlockShape) -> Work:
    """Return the work of mesh, stiffness and multigrid."""
    return Work(arrays=_MESH, sparse=_SET_UP * _ENTRY * _entries(shape))


def _cycle_work(shape: BlockShape, cycles: float) -> Work:
    """Return the work of multigrid cycles on a mesh."""
    return cycles * Work(arrays=_CYCLE_OVERHEAD, sparse=_CYCLE * _ENTRY * _entries(shape))


def _entries(shape: BlockShape) -> float:
    """Return the entries of the stiffness of a block under laws, roughly."""
    return _ENTRIES[shape.element] * mesh_unknowns(shape)


def _import_time(module: str, seconds: float) -> float:
    """Return the time of importing a library [s], which is none when it has been imported."""
    return 0.0 if module in sys.modules else seconds


def _memory(setup: ProblemSetup, steps: int) -> float:
    """Return the largest memory so far and what the largest phase adds [B]."""
    micro = _BYTES_PER_HEIGHT * setup.surface.heights.size
    if isinstance(setup.micro, HalfSpaceModel):
        micro += _BYTES_PER_CELL * setup.micro.surface.heights.size
    block, patches = 0.0, setup.patches.count
    if setup.has_block:
        block = 0.0 if "dolfinx" in sys.modules else _FINITE_ELEMENTS
        if setup.meshes is not None:
            block += setup.meshes.bytes
        elif not setup.scene.coupling.decomposed:
            block += _BYTES_PER_ENTRY * _entries(setup.shape)
    results = 8.0 * (10.0 * patches**2 + 3.0 * steps * patches)
    draws = setup.scene.output.figures and "matplotlib" not in sys.modules
    return peak_memory() + max(micro, block) + results + _PICTURES * draws
