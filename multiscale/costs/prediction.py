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
from multiscale.setup.problem import ProblemSetup

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


def predicted_cost(setup: ProblemSetup, machine: Machine) -> Cost:
    """Predict what a run takes.

    Args:
        setup: The scene's ingredients.
        machine: How fast it is; only the rates that are needed are measured.
    """
    works = run_work(setup)
    seconds = {phase: works[phase].seconds(machine) for phase in PHASES if phase in works}
    return Cost(seconds=seconds, memory=_memory(setup))


def run_work(setup: ProblemSetup) -> dict[str, Work]:
    """Return the work of every phase that a run of a scene has.

    Args:
        setup: The scene's ingredients.
    """
    works = {"surface": _surface(setup.surface.heights.size)}
    if setup.choice is not None:
        works["micro choice"] = _micro_choice(setup)
    if setup.uses_laws:
        works["laws"] = law_work(setup)
    if setup.meshes is not None:
        load_history = setup.scene.loading.load_history
        works["block"], works["load steps"] = reference_work(
            setup.meshes, step_count(load_history), turning=load_history.tilt is None
        )
    else:
        works["block"], works["load steps"] = _block(setup), _load_steps(setup)
    output = setup.scene.output
    if isinstance(setup.micro, HalfSpaceModel) and output.check != "none":
        checks = step_count(setup.scene.loading.load_history) if output.check == "all" else 1
        works["check"] = checks * check_work(setup)
    if output.fields and setup.has_block and not (setup.meshes or _on_mesh(setup)):
        works["field"] = mesh_work(setup.shape) + cycle_work(setup.shape, CYCLES_PER_PATCH)
    if output.figures:
        works["output"] = (4 if setup.uses_laws else 3) * _FIGURE
        works["output"] += Work() if "matplotlib" in sys.modules else _DRAWING
    return works


def _surface(heights: int) -> Work:
    return Work(call=25_000, passes=400.0 * heights)


def _micro_choice(setup: ProblemSetup) -> Work:
    """Count a cold solution on a grid of twice the sides, and what the candidates ask for."""
    heights = 4.0 * setup.surface.heights.size
    return Work(call=200_000, passes=300.0 * heights, transform=350.0 * heights * np.log2(heights))


def _on_mesh(setup: ProblemSetup) -> bool:
    return setup.uses_laws and not newton_choice(setup).condensed


def _block(setup: ProblemSetup) -> Work:
    if not setup.has_block:
        return Work(call=1_000)
    coupling = setup.scene.coupling
    if coupling.decomposed:
        return import_work() + BODY
    work = import_work() + mesh_work(setup.shape)
    if newton_choice(setup).condensed:
        work += cycle_work(setup.shape, CYCLES_PER_PATCH * setup.patches.count)
    return work


def _load_steps(setup: ProblemSetup) -> Work:
    steps = step_count(setup.scene.loading.load_history)
    if not setup.uses_laws:
        return steps * press_work(setup)
    if _on_mesh(setup):
        return cycle_work(setup.shape, full_cycles(setup, steps))
    patches = setup.patches.count
    dense = Work(call=1_200, passes=60.0 * patches**2, flop=patches**3 / 3)
    return (_LAW_NEWTON * steps) * dense


def _memory(setup: ProblemSetup) -> float:
    """Return what is in use now, and what the largest phase adds."""
    model, shape = setup.micro, setup.shape
    cells = float(np.prod(model.surface.grid)) if isinstance(model, HalfSpaceModel) else 0.0
    micro = _BYTES_PER_CELL * cells + _BYTES_PER_HEIGHT * setup.surface.heights.size
    patches, steps = setup.patches.count, step_count(setup.scene.loading.load_history)
    kept = 8.0 * (10.0 * patches**2 + 3.0 * steps * patches)
    block = 0.0
    if setup.has_block:
        block = 0.0 if "dolfinx" in sys.modules else _FINITE_ELEMENTS
        if setup.meshes is not None:
            block += setup.meshes.bytes
        elif not setup.scene.coupling.decomposed:
            block += mesh_bytes(shape)
    drawn = setup.scene.output.figures and "matplotlib" not in sys.modules
    return peak_memory() + max(micro, block) + kept + _PICTURES * drawn


def peak_memory() -> float:
    """Return the largest memory of this process so far [B]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)
