"""What couplings with laws have in common: a table of laws, and a solver of load steps with it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

from geometry import Control
from micro.model import Stiffness
from multiscale.couplings.coupling import Coupling
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Solver
from multiscale.readable import Observer


class LawSolver(Solver, Protocol):
    """Anything that finds load steps from laws."""

    table: LawTable
    """The laws."""
    face: Any
    """The contact face of the finite elements that load steps are solved on; None without."""

    def stiffness(self) -> Stiffness:
        """Return dF/dδ at the latest load step, where it is known."""

    def field_state(self, step: LoadStep) -> Any:
        """Return what fields of the load step just accepted are made from."""

    def state(self) -> Any:
        """Return what the next load step starts from."""

    def restore(self, state: Any) -> None:
        """Start from a state."""


class NewtonChoice(NamedTuple):
    """Which Newton solves the load steps, and why.

    Attributes:
        condensed: Whether it is the dense one of the patches.
        why: The reason, as a sentence.
    """

    condensed: bool
    why: str


@dataclass(kw_only=True, eq=False)
class LawCoupling(Coupling):
    """A coupling whose load steps use laws.

    Attributes:
        table: The laws, once made, counted from first touch; set it to laws that are at hand.
        observe: Told of laws as they are made; None without anybody to tell.
    """

    has_laws: ClassVar[bool] = True

    table: LawTable | None = field(default=None, init=False)

    @abstractmethod
    def newton(self, table: LawTable | None = None) -> NewtonChoice:
        """Choose the Newton that load steps are found with.

        Args:
            table: The laws, once made.
        """

    @abstractmethod
    def _make_table(self, observe: Observer | None) -> LawTable:
        """Tabulate the laws; collective."""

    @abstractmethod
    def _make_solver(self, table: LawTable) -> LawSolver:
        """Make what finds load steps from laws; collective."""

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once; see `Coupling.make_laws`."""
        if self.table is None:
            self._prepare_laws()
            with self.clock.phase("laws"):
                self.table = self._make_table(self.clock.observe)
        return self.table

    def _prepare_laws(self) -> None:
        """Make what laws need, in phases of their own."""

    @cached_property
    def _solver(self) -> LawSolver:
        return self._make_solver(self.make_laws())

    def prepare(self) -> None:
        """Make the laws and what finds load steps from them, once."""
        with self.clock.phase("block"):
            _ = self._solver

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `Coupling.press`."""
        return self._solver.press(control)

    def stiffness(self) -> Stiffness:
        """Return dF/dδ at the latest load step, where it is known."""
        return self._solver.stiffness()

    def state(self) -> Any:
        """Return what the next load step starts from."""
        return self._solver.state()

    def restore(self, state: Any) -> None:
        """Start from a state."""
        self._solver.restore(state)

    def interface_stiffness(self, step: LoadStep) -> float | None:
        """Return dF/dδ of the laws of all patches side by side [N/mm]."""
        rates = step.patches.stiffness_MPa_per_mm
        return None if rates is None else float(rates @ self.areas)

    def law_statements(self) -> Iterator[tuple[str, str]]:
        """Yield how load steps are found from laws."""
        choice = self.newton()
        way = "condensed to the patches" if choice.condensed else "full, on the mesh"
        yield "newton", f"{way}: {choice.why}"

    def field_state(self, step: LoadStep) -> Any:
        """Return the displacements of the mesh, or the pressures of the patches without one."""
        return self._solver.field_state(step)

    def write_fields(
        self, path: Path, states: Mapping[int, Any], steps: Sequence[LoadStep]
    ) -> None:
        """Write the fields of the body, by its displacements where these are known."""
        face = self._solver.face
        if face is None:
            super().write_fields(path, states, steps)
            return
        from multiscale.couplings.fields import write_displaced

        pressures = {step.step: step.patches.pressure_MPa for step in steps}
        write_displaced(path, face, states, lambda number, counter: pressures[number])

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        face = self._solver.face if "_solver" in self.__dict__ else None
        return None if face is None else face.body.dofs

    def meshed_bodies(self) -> list[Any]:
        """Return the body, and the counter-body where that is a mesh."""
        face = self._solver.face if "_solver" in self.__dict__ else None
        if face is None:
            return []
        return [face.body.body, face.body.counter] if hasattr(face.body, "counter") else [face.body]

    def _drop_solvers(self) -> None:
        for name in ("_solver", "_laws", "put_on_body"):
            self.__dict__.pop(name, None)
