"""The leak through the gaps of load steps, where a scene asks for it.

The error of the grid is measured like that of the force: the contact and the flow through its gaps
are solved again on half as many cells a side, under the same load. Channels close as cells become
coarser, so that most of the error is that of the gaps, not that of the flow through them.

On 12 surfaces with 8 and 16 cells along the shortest wave, under 6 loads each of up to half of the
area in contact, the error was no less than the true one on 93 and 92 % of 144 flows, no less than
half of it on 97 and 98 %, and 1.6 to 2.9 times as large in the median
(`tests/benchmarks/leak_error.py`).

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from geometry import NotConverged
from multiscale.couplings.coupling import Coupling
from multiscale.gap_flows import flow_solver, solved_gap_flow
from multiscale.loading.leak import Leak
from multiscale.loading.load_step import LoadStep
from multiscale.observers.step_observers import StepObserver
from multiscale.results.leak_notes import leak_notes
from multiscale.scene.leak import LeakSection
from support.arrays import Array
from support.collective import on_root_alone

_AFTER_UNLOADING = (
    "the error of the leak after unloading is not measured: the plastic depth there is that of the "
    "load steps before"
)


class LeakObserver(StepObserver):
    """Adds what leaks through the gaps to load steps.

    Args:
        coupling: What finds the load steps, with gaps of cells.
        section: What its scene asks for.
        has_unloaded: Tells whether the load was larger before.
    """

    def __init__(
        self, coupling: Coupling, section: LeakSection, has_unloaded: Callable[[], bool]
    ) -> None:
        super().__init__(coupling)
        self._section, self._has_unloaded = section, has_unloaded
        flow_solver(coupling.surface.heights.size)  # PETSc starts on all ranks together
        self._notes: dict[str, None] = {}

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Return the load step with its leak and, where errors are measured, their error."""
        coupling = self._coupling
        with coupling.clock.phase("leak"):
            found = on_root_alone(coupling.comm, lambda: self._found(coupling.solver.gaps))
            step = replace(step, leaks=found)
            return self._with_errors(step) if self._measures() else step

    def _found(self, gap: Array | None) -> tuple[Leak, ...]:
        """Return the leaks through a map of gaps."""
        assert gap is not None, "scenes whose coupling knows no gaps of cells are refused"
        section, surface = self._section, self._coupling.surface
        periodic = self._coupling.scene.surface.periodic
        leaks = []
        for way in section.directions:
            flow = solved_gap_flow(gap, surface.lengths, way, periodic=periodic)
            leaks.append(
                Leak(
                    way=way,
                    rate=flow.rate(section.drop, section.viscosity_MPa_s),
                    transmissivity=flow.transmissivity,
                    flow_factor=flow.flow_factor if flow.gap.any() else None,
                    constriction=flow.constriction.share if flow.constriction else None,
                )
            )
        return tuple(leaks)

    def _measures(self) -> bool:
        """Tell whether the error of a load step is measured; where it cannot be, note why."""
        scene = self._coupling.scene
        if scene.output.check == "none":
            return False
        if scene.micro.hardness is not None and self._has_unloaded():
            self._notes[_AFTER_UNLOADING] = None
            return False
        return True

    def _with_errors(self, step: LoadStep) -> LoadStep:
        """Return the load step with the error of its leak by the grid."""
        coupling = self._coupling
        try:
            gap = coupling.coarser_gap(step)
            found = on_root_alone(coupling.comm, lambda: self._found(gap))
        except NotConverged as error:
            self._notes[f"error of the leak at load step {step.step} not measured: {error}"] = None
            return step
        leaks = zip(step.leaks, found, strict=True)
        return replace(
            step,
            leaks=tuple(
                one.with_errors({"grid": abs(one.rate - half.rate)}) for one, half in leaks
            ),
        )

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak."""
        yield from leak_notes(steps)
        yield from self._notes
