"""The leak at load steps, where a scene asks for it: through the gaps of all cells.

The error of the grid is measured like that of the force: the contact and the flow through its gaps
are solved again on half and a quarter as many cells a side, under the same load. Channels close as
cells become coarser, so that most of the error is that of the gaps, not that of the flow through
them; see `multiscale.laws.transmissivity.error_of_grid`.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.multiscale.laws.transmissivity import error_of_grid, flow_solver, solved_gap_flow
from patchlaw.multiscale.loading.column import WAYS, Leak
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.couplings.coupling import Coupling
from patchlaw.multiscale.observers.step_observers import Columns, StepObserver
from patchlaw.multiscale.readable import (
    Caution,
    measured,
    number,
    percent,
    quantity,
    usual,
    usual_unit,
)
from patchlaw.support.arrays import Array
from patchlaw.support.parallel import on_root_alone

if TYPE_CHECKING:
    from patchlaw.multiscale.results.history import History

_AFTER_UNLOADING = (
    "the error of the leak after unloading is not measured: the plastic depth there is that of the "
    "load steps before"
)
_UNCERTAIN = 0.3
"""Error over the leak from which on a report warns."""
_REMEDIES = {
    "mesh": "it varies within facets of the contact face, and may differ by {} (finer mesh there)",
    "grid": "on coarser grids it differs by up to {}, as channels are few cells wide (finer "
    "surface.grid)",
    "rows": "between the rows of its table it may differ by {}",
    "samples": "between samples it differs by {} (more law.seeds, or larger samples)",
}
"""What is said of a leak that is not certain, by the cause of most of its error."""


class LeakObserver(StepObserver):
    """Adds what leaks to load steps and, where errors are measured, their error by cause.

    Args:
        coupling: What finds the load steps.

    Attributes:
        causes: Causes of the error.
    """

    causes: Sequence[str]
    unknown = ""
    """What the error does not hold, in words."""

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        section = coupling.scene.leak
        assert section is not None
        self._section = section
        self._scale = section.drop / (12.0 * section.viscosity_MPa_s)

    @abstractmethod
    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        """Return the leaks along all ways; collective."""

    @abstractmethod
    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        """Return their flow rates with a cause of their error varied; collective."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the leaks."""
        with self._coupling.clock.phase("leak"):
            leaks = self._leaks(step)
            if self._measures(step, past):
                leaks = self._with_errors(step, leaks)
        return {"leaks": leaks}

    def _measures(self, step: LoadStep, past: Sequence[LoadStep]) -> bool:
        """Tell whether the error of a load step is measured; where it cannot be, note why."""
        if self._coupling.scene.output.check == "none":
            return False
        if self._plastic_past(step, past):
            self._failures[_AFTER_UNLOADING] = None
            return False
        return True

    def _with_errors(self, step: LoadStep, leaks: tuple[Leak, ...]) -> tuple[Leak, ...]:
        """Return the leaks with their errors."""
        varied = self._tried(
            f"error of the leak at load step {step.step} not measured",
            lambda: {cause: self._varied(step, cause) for cause in self.causes},
        )
        if varied is None:
            return leaks
        return tuple(
            one.with_errors({cause: abs(rates[k] - one.rate) for cause, rates in varied.items()})
            for k, one in enumerate(leaks)
        )

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak."""
        for way, name in WAYS.items():
            known = [(step.step, leak) for step in steps if (leak := step.leak(way)) is not None]
            if not known:
                continue
            number_of_last, last = known[-1]
            yield f"leak {name} at load step {number_of_last}: {_whole_text(last, self.unknown)}"
            closed = [step for step, leak in known if not leak.rate]
            if closed and len(closed) < len(known):
                yield (
                    f"the gap is closed {name} at {len(closed)} of {len(known)} load steps, first "
                    f"at load step {closed[0]}"
                )
            if last.causes and last.error is not None and last.error > _UNCERTAIN * abs(last.rate):
                cause, error = max(last.causes, key=lambda one: one[1])
                text = _REMEDIES[cause].format(*_as_the_leak(last, [error]))
                yield Caution(f"the leak {name} is uncertain: {text}")
        yield from super().notes(steps)

    def results(self, step: LoadStep) -> Iterator[tuple[str, str]]:
        """Yield the leak along every way."""
        for way, where in WAYS.items():
            if (leak := step.leak(way)) is not None:
                yield f"leak {where}", leak_text(leak)

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield the flow at the last recorded load step, and the leak at all of them."""
        periodic = self._coupling.scene.surface.periodic
        about = history, history.contact, self._section, periodic, self.fluid
        yield "leak", "leak.leak_figure", about


class GapLeakObserver(LeakObserver):
    """Adds what leaks through the gaps of all cells."""

    causes = ("grid",)

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        cells = coupling.parts.cells or coupling.parts.surface.grid
        flow_solver(math.prod(cells))  # PETSc starts on all ranks together
        self._latest: tuple[Leak, ...] = ()

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        coupling = self._coupling
        self._latest = on_root_alone(coupling.comm, lambda: self._through(coupling.model.gaps))
        return self._latest

    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        def rates(gap: Array | None) -> Array:
            found = on_root_alone(self._coupling.comm, lambda: self._through(gap))
            return np.array([one.rate for one in found])

        half, quarter = (rates(self._coupling.coarser_gap(step, factor)) for factor in (2, 4))
        own = np.array([one.rate for one in self._latest])
        return list(own + error_of_grid(own, half, quarter))

    def _through(self, gap: Array | None) -> tuple[Leak, ...]:
        """Return the leaks through a map of gaps; on one process."""
        assert gap is not None, "scenes whose coupling knows no gaps of cells are refused"
        section, surface = self._section, self._coupling.parts.surface
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


def leak_text(leak: Leak) -> str:
    """Return a leak with its error, or that the gap is closed.

    Args:
        leak: The leak.
    """
    if not leak.rate:
        closed = "closed, nothing leaks"
        return f"{closed} (or {usual(leak.error, 'mm³/s', 2)})" if leak.error else closed
    return measured(leak.rate, leak.error, "mm³/s")


def _as_the_leak(leak: Leak, errors: Iterable[float]) -> list[str]:
    """Return errors in the unit that a leak is shown in."""
    name, size = usual_unit([leak.rate], "mm³/s")
    return [f"{number(error / size, 2)} {name}" for error in errors]


def _whole_text(leak: Leak, unknown: str) -> str:
    text = leak_text(leak)
    if not leak.rate:
        return f"{text}: the surfaces touch everywhere along a line across the flow"
    if len(leak.causes) > 1:
        names, errors = zip(*leak.causes, strict=True)
        causes = zip(names, _as_the_leak(leak, errors), strict=True)
        text += f" ({', '.join(map(' '.join, causes))}{unknown and f'; {unknown}'})"
    if leak.hydraulic_gap is not None:
        text += f"; hydraulic gap {quantity(leak.hydraulic_gap, 'mm', 3)}"
    if leak.flow_factor is not None:
        text += f", flow factor {number(leak.flow_factor, 3)}"
    if leak.constriction is not None:
        text += f", {percent(leak.constriction)} of it through the channel of the narrowest "
        text += "constriction"
    return text
