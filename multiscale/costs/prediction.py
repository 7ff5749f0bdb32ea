"""Predicts the time and the memory of a run, phase by phase, before anything expensive starts."""

from __future__ import annotations

import resource
import sys
from dataclasses import dataclass

import numpy as np

from micro import HalfSpaceModel
from multiscale.costs.block_work import (
    BODY,
    cycle_work,
    import_work,
    mesh_bytes,
    mesh_work,
    reference_work,
)
from multiscale.costs.contact_work import check_work, law_work, press_work, step_count
from multiscale.costs.work import Work
from multiscale.couplings.newton_choice import CYCLES_PER_PATCH, full_cycles, newton_choice
from multiscale.machine.rates import Machine
from multiscale.setup.problem import Stage

PHASES = ("surface", "micro choice", "laws", "block", "load steps", "check", "field", "output")
"""Phases of a run, in their order."""

_FIGURE = Work(call=600_000)
_DRAWING = Work(call=800_000)  # loading matplotlib
_LAW_NEWTON = 2.7  # Newton steps of a load step of laws
_BYTES_PER_HEIGHT = 120.0  # surface, spline and spectrum
_BYTES_PER_CELL = 700.0  # half-space on a box of twice the sides
_FINITE_ELEMENTS, _PICTURES = 95e6, 60e6  # of the libraries


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a run is predicted to take on one core.

    Attributes:
        seconds: Time of each phase that there is [s].
        memory: Largest memory of the process [B].
    """

    seconds: dict[str, float]
    memory: float

    @property
    def total(self) -> float:
        """Time of all phases [s]."""
        return sum(self.seconds.values())


def predicted_cost(stage: Stage, machine: Machine) -> Cost:
    """Predict what a run takes.

    Args:
        stage: The scene's ingredients.
        machine: How fast it is; only the rates that are needed are measured.
    """
    works = run_work(stage)
    seconds = {phase: works[phase].seconds(machine) for phase in PHASES if phase in works}
    return Cost(seconds=seconds, memory=_memory(stage))


def run_work(stage: Stage) -> dict[str, Work]:
    """Return the work of every phase that a run of a scene has.

    Args:
        stage: The scene's ingredients.
    """
    works = {"surface": _surface(stage.surface.heights.size)}
    if stage.choice is not None:
        works["micro choice"] = _micro_choice(stage)
    if stage.by_laws:
        works["laws"] = law_work(stage)
    if stage.meshes is not None:
        programme = stage.scene.loading.programme
        works["block"], works["load steps"] = reference_work(
            stage.meshes, step_count(programme), turning=programme.tilt is None
        )
    else:
        works["block"], works["load steps"] = _block(stage), _load_steps(stage)
    output = stage.scene.output
    if isinstance(stage.micro, HalfSpaceModel) and output.check != "none":
        checks = step_count(stage.scene.loading.programme) if output.check == "all" else 1
        works["check"] = checks * check_work(stage)
    if output.fields and stage.embedded and not (stage.meshes or _on_mesh(stage)):
        works["field"] = mesh_work(stage.shape) + cycle_work(stage.shape, CYCLES_PER_PATCH)
    if output.figures:
        works["output"] = (4 if stage.by_laws else 3) * _FIGURE
        works["output"] += Work() if "matplotlib" in sys.modules else _DRAWING
    return works


def _surface(heights: int) -> Work:
    return Work(call=25_000, passes=400.0 * heights)


def _micro_choice(stage: Stage) -> Work:
    """Count a cold solution on a grid of twice the sides, and what the candidates ask for."""
    heights = 4.0 * stage.surface.heights.size
    return Work(call=200_000, passes=300.0 * heights, transform=350.0 * heights * np.log2(heights))


def _on_mesh(stage: Stage) -> bool:
    return stage.by_laws and not newton_choice(stage).condensed


def _block(stage: Stage) -> Work:
    if not stage.embedded:
        return Work(call=1_000)
    coupling = stage.scene.coupling
    if coupling.decomposed:
        return import_work() + BODY
    work = import_work() + mesh_work(stage.shape)
    if newton_choice(stage).condensed:
        work += cycle_work(stage.shape, CYCLES_PER_PATCH * stage.patches.count)
    return work


def _load_steps(stage: Stage) -> Work:
    steps = step_count(stage.scene.loading.programme)
    if not stage.by_laws:
        return steps * press_work(stage)
    if _on_mesh(stage):
        return cycle_work(stage.shape, full_cycles(stage, steps))
    patches = stage.patches.count
    dense = Work(call=1_200, passes=60.0 * patches**2, flop=patches**3 / 3)
    return (_LAW_NEWTON * steps) * dense


def _memory(stage: Stage) -> float:
    """Return what is in use now, and what the largest phase adds."""
    model, shape = stage.micro, stage.shape
    cells = float(np.prod(model.surface.grid)) if isinstance(model, HalfSpaceModel) else 0.0
    micro = _BYTES_PER_CELL * cells + _BYTES_PER_HEIGHT * stage.surface.heights.size
    patches, steps = stage.patches.count, step_count(stage.scene.loading.programme)
    kept = 8.0 * (10.0 * patches**2 + 3.0 * steps * patches)
    block = 0.0
    if stage.embedded:
        block = 0.0 if "dolfinx" in sys.modules else _FINITE_ELEMENTS
        if stage.meshes is not None:
            block += stage.meshes.bytes
        elif not stage.scene.coupling.decomposed:
            block += mesh_bytes(shape)
    drawn = stage.scene.output.figures and "matplotlib" not in sys.modules
    return peak_memory() + max(micro, block) + kept + _PICTURES * drawn


def peak_memory() -> float:
    """Return the largest memory of this process so far [B]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)
