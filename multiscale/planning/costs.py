"""Predicts time and memory of a run, phase by phase, before anything expensive starts.

Work is counted. That of contact problems is counted in products with the compliance, which are
timed on this machine and its threads (`contact_costs`). All other times were measured on one core,
and two benchmarks compare this machine with that one. Other programs on the cores make a run
longer: the prediction is for the cores as they are, and beside it stands that for idle ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from geometry.cores import cores
from multiscale.couplings.assembly import CYCLES_PER_PATCH, full_cycles, newton_choice
from multiscale.planning.busy_cores import Competition
from multiscale.planning.contact_costs import ContactCosts, Speed
from multiscale.planning.machine_speed import THIS_MACHINE, Machine
from multiscale.planning.memory_costs import Launch, memory_parts, step_count
from multiscale.planning.mesh_costs import face_seconds, mesh_seconds, reference_seconds
from multiscale.setup.problem import ProblemSetup

ROWS = {"cells": 84, "summits": 105}
"""Solutions that a table of laws takes. Models of cells took 75 to 105 for 45 to 65 rows, models of
summits 60 to 150."""
_PATCH_SUMS = 4e-6
"""Time of a patch's sums in a row of consistent laws [s]."""
_CYCLES_PER_ROW = 3.0
"""Multigrid cycles of a row of consistent laws on a mesh, whose displacements it takes."""
_NEWTON_STEPS = 2.7
"""Newton steps of a load step of laws whose compliance is condensed to the patches."""

# times on one core [s]
_SURFACE, _SURFACE_HEIGHT = 2e-3, 0.25e-6
_IMPORT, _BODY = 0.52, 0.05
"""Times of importing dolfinx, PETSc and gmsh, and of the body correction of a cube. Thin blocks
take several times longer."""
_DRAWING, _FIGURE, _BLOCK_FIGURE = 0.25, 0.36, 0.9
"""Times of importing matplotlib, of a figure, and of that in three dimensions."""
_WRITING, _WRITTEN_HEIGHT = 0.04, 0.1e-6
"""Time of writing tables and report, and per height of a map of the contact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a run is predicted to take.

    Attributes:
        seconds: Time of each phase that the run has, in their order, on the cores as they are [s].
        idle: Time of all phases on idle cores [s].
        parts: Memory of each part of the first process, held together at its largest [B].
        cores: Cores of a rank that it counts on; of all ranks together in contact problems.
        competition: What other programs take of the cores.
    """

    seconds: dict[str, float]
    idle: float
    parts: dict[str, float]
    cores: int = 1
    competition: Competition = field(default_factory=Competition)

    @property
    def total(self) -> float:
        """Time of all phases on the cores as they are [s]."""
        return sum(self.seconds.values())

    @property
    def memory(self) -> float:
        """Largest memory of the first process [B]."""
        return sum(self.parts.values())


@dataclass(frozen=True)
class _Shared:
    """The speed of a machine whose cores other programs use, for ranks that share the meshes."""

    machine: Machine
    competition: Competition
    ranks: int

    @property
    def arrays(self) -> float:
        return self.machine.arrays * self.competition.delay(1)

    @property
    def sparse(self) -> float:
        return self.machine.sparse * self.competition.delay(self.ranks) / self.ranks

    def product(self, cells: float) -> float:
        return self.machine.product(cells) * self.competition.delay(cores())


def predicted_cost(
    setup: ProblemSetup, machine: Machine = THIS_MACHINE, launch: Launch | None = None
) -> Cost:
    """Predict what a run takes.

    Args:
        setup: The problem.
        machine: How fast the machine is; by default the one that runs this process.
        launch: How the run is started; by default in this process.
    """
    launch = launch or Launch()
    found, idle = machine.competition, Competition(cores=machine.competition.cores)
    as_is, alone = (
        _seconds(setup, _Shared(machine, one, launch.ranks), launch) for one in (found, idle)
    )
    return Cost(
        seconds=as_is,
        idle=sum(alone.values()),
        parts=memory_parts(setup, launch),
        cores=cores(),
        competition=found,
    )


def _seconds(setup: ProblemSetup, speed: Speed, launch: Launch) -> dict[str, float]:
    """Return the time of each phase [s]."""
    scene, output = setup.scene, setup.scene.output
    steps, heights = step_count(scene.loading.load_history), setup.surface.heights.size
    seconds = {"surface": speed.arrays * (_SURFACE + _SURFACE_HEIGHT * heights)}
    on_mesh = setup.uses_laws and not newton_choice(setup).condensed
    imports = 0.0 if launch.imported("dolfinx") else speed.arrays * _IMPORT
    if setup.meshes is not None:
        made, pressed = reference_seconds(setup, setup.meshes, steps, speed)
        seconds |= {"block": imports + made, "load steps": pressed}
    else:
        costs = ContactCosts(setup, speed)
        if estimate := costs.estimate():
            seconds["load estimate"] = estimate
        if setup.uses_laws:
            seconds["laws"] = _law_seconds(costs, launch.ranks)
        block, pressed = _contact_seconds(costs, steps, on_mesh=on_mesh)
        block += setup.has_block * imports
        block += face_seconds(setup, speed) if launch.solves_face else 0.0
        seconds |= {"block": block, "load steps": pressed}
        seconds |= _read_off_seconds(costs, steps)
    if output.fields and setup.has_block and not (on_mesh or setup.meshes):
        fields = sum(output.wants_fields(one, last=one == steps) for one in range(1, steps + 1))
        seconds["field"] = mesh_seconds(setup, speed, CYCLES_PER_PATCH * fields)
    if output.figures:
        figures = (5 if setup.uses_laws else 4) * _FIGURE / launch.ranks
        figures += (output.figures == "all") * _BLOCK_FIGURE
        drawing = 0.0 if launch.imported("matplotlib") else _DRAWING
        seconds["output"] = speed.arrays * (figures + drawing)
    maps = _WRITTEN_HEIGHT * heights * (not setup.uses_laws)
    seconds["writing"] = speed.arrays * (_WRITING + maps)
    return seconds


def _read_off_seconds(costs: ContactCosts, steps: int) -> dict[str, float]:
    """Return the time of showing contacts and of measuring errors, by phase [s]."""
    output, seconds = costs.setup.scene.output, {}
    if not costs.on_cells or costs.setup.samples:
        return {}
    if costs.setup.uses_laws:
        shown = {"all": float(steps), "last": 1.0}.get(output.contact, 0.0) * costs.step()
    else:
        shown = 0.0 if output.contact == "none" else steps * costs.stiffness()
    if shown:
        seconds["contact"] = shown
    if output.check != "none":
        seconds["check"] = (steps if output.check == "all" else 1) * costs.check()
    return seconds


def _law_seconds(costs: ContactCosts, ranks: int) -> float:
    """Return the time of tabulating laws [s]."""
    setup = costs.setup
    rows = ROWS["summits" if setup.uses_summits else "cells"]
    if setup.samples:
        samples = sum(len(region.surfaces) for region in setup.samples)
        return rows * samples * costs.step()
    if setup.scene.kind == "isolated":
        return rows * setup.interfering_patches * costs.patch() / ranks
    each = costs.step() + costs.speed.arrays * _PATCH_SUMS * setup.patches.count
    if not newton_choice(setup).condensed:
        each += mesh_seconds(setup, costs.speed, 1, made=False) * _CYCLES_PER_ROW
    return rows * each


def _contact_seconds(costs: ContactCosts, steps: int, *, on_mesh: bool) -> tuple[float, float]:
    """Return the time of making a flat block, and of the load steps [s]."""
    setup, speed = costs.setup, costs.speed
    patches, block = setup.patches.count, 0.0
    if setup.has_block and setup.scene.decomposed:
        block = speed.arrays * _BODY
    elif setup.has_block:
        block = mesh_seconds(setup, speed, 0 if on_mesh else CYCLES_PER_PATCH * patches)
    if on_mesh:
        return block, mesh_seconds(setup, speed, full_cycles(setup, steps), made=False)
    if setup.uses_laws:
        dense = 0.3e-3 + 33e-9 * patches**2 + 14e-12 * patches**3  # a dense factorisation
        return block, speed.arrays * _NEWTON_STEPS * steps * dense
    return block, steps * costs.step()
