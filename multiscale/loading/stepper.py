"""The base of what finds load steps, and the stepper that makes them from a load history."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro.model import NormalStiffness, Stiffness
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError, NotBalanced, NotConverged

_MOST_HALVINGS = 8
"""Halvings of a load step that does not converge, or that changes the force by too much."""
_SMALLEST = 1.0 / 2**_MOST_HALVINGS


class StepSolver(ABC):
    """Finds load steps; what a solver does not know is here.

    Attributes:
        past: What the load steps so far left behind beyond initial guesses; None where nothing. Set
            it to take load steps back.
        latest: The contact at the latest load step, see `detail`; None where it is not known.
        face: The contact face of a flat mesh that load steps are solved on; None without.
        on_mesh: Whether load steps are those of a mesh, whose displacements are known.
    """

    past: Any = None
    latest: Any = None
    face: Any = None
    on_mesh: bool = False

    @abstractmethod
    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step, whose number is still 0.

        Args:
            control: What the step prescribes of the plane.

        Raises:
            NotConverged: When none is found. Earlier equilibria stay what they were, so that a
                smaller step can be tried.

        Note:
            Collective, as all here.
        """

    def stiffness(self) -> NormalStiffness:
        """Return the stiffnesses −dF/dū and dF/dδ at the latest load step, where they are known.

        The slopes of the plane stay or, where it turns, its moments stay zero.
        """
        return NormalStiffness()

    def tangential_stiffness(self) -> Stiffness:
        """Return the slope of the shear force over the shift at the latest load step.

        The shift goes on in the direction of its last change, the normal load as it is.
        """
        return Stiffness(None, 0)

    def state(self) -> Any:
        """Return what the next load step starts from; it does not depend on the number of ranks.

        It is made of numbers, texts, arrays and records of them, or None where there is nothing.
        """
        return None

    def restore(self, state: Any) -> None:
        """Start from a state, in a solver newly made from the same scene.

        Args:
            state: What `state` returned.
        """
        assert state is None, "a solver without a state has none to start from"

    def detail(self, latest: Any) -> ContactState | None:
        """Return the spots and fields of a contact, the same on every rank; None without any.

        Args:
            latest: What `latest` was after a load step.
        """
        return None

    def conducting_stiffness(self, step: LoadStep) -> float | None:
        """Return the elastic stiffness of the interface, which its conductance follows from [N/mm].

        Args:
            step: The load step accepted last.

        Returns:
            The stiffness; None where it is not known, NaN where the interface touches everywhere.
        """
        known = step.interface_stiffness_N_per_mm
        return self.stiffness().interface if known is None else known

    @property
    def gaps(self) -> Array | None:
        """Gaps of all cells at the latest load step, 0 in contact; None without cells.

        Shape (nx, ny) [mm]; on rank 0 alone.
        """
        return None

    def face_pressures(self) -> Array | None:
        """Return places on a face with laws at points and the pressures there; None otherwise.

        Returns:
            Columns x, y [mm] and p [MPa] of the points of all ranks, shape (n, 3).
        """
        return None

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what the fields of the load step just accepted are made from.

        Args:
            step: The load step.
            parts: Parts of the contact face whose mean pressures stand for contacts.
        """
        return step.patches.pressure_MPa

    def field_record(self, state: Any) -> Any:
        """Return what makes the fields of the load step just accepted again in a resumed run.

        Args:
            state: What `field_state` returned.

        Returns:
            The same on every number of ranks, and of what `state` may consist of.
        """
        return state

    def field_state_again(self, record: Any, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what `field_state` did at an earlier load step, from its record.

        Args:
            record: What `field_record` returned then.
            step: The load step.
            parts: As for `field_state`.
        """
        return record

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of load steps as XDMF and VTX, where they are those of a mesh.

        Args:
            path: File to write, ending in ``.xdmf``.
            states: By number of the load step what `field_state` returned.
        """
        raise NotImplementedError

    @property
    def meshed_bodies(self) -> list[Any]:
        """The meshed bodies that load steps are solved on, the finest last."""
        return []

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        return None


class BeyondLaws(NotConverged):
    """A patch is outside the range of its law, where smaller load steps do not help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadPosition:
    """Position in a load history between two load steps; all that is needed to continue there.

    Attributes:
        steps: Load steps accepted so far.
        targets: Load steps of the history that were begun so far, without halved ones.
        ahead: The latest of them, and what is to be reached before it, the next one last, counted
            in load steps of the history; empty once it is reached.
        time: The last accepted step, counted likewise.
        approach: Approach there [mm].
        force: Force there [N].
        largest: Largest force so far [N].
        origin: Approach [mm] and force [N] when the present stage began.
    """

    steps: int = 0
    targets: int = 0
    ahead: tuple[float, ...] = ()
    time: float = 0.0
    approach: float = 0.0
    force: float = 0.0
    largest: float = 0.0
    origin: tuple[float, float] = (0.0, 0.0)

    def is_at_end(self, load_history: LoadHistory) -> bool:
        """Whether all load steps of a load history are accepted."""
        return self.targets == load_history.count and not self.ahead


def step_count(load_history: LoadHistory) -> int:
    """Return the number of load steps, as far as it is known before the run.

    Args:
        load_history: The loads, whose steps may be halved by a largest change of the force.
    """
    change = load_history.force_change or math.inf
    return max(load_history.count, math.ceil(load_history.legs / change))


def load_steps(solver: StepSolver, load_history: LoadHistory) -> Iterator[LoadStep]:
    """Yield the load steps of a load history as they are accepted.

    A step that does not converge is reached through smaller ones, which are not yielded. One that
    changes the force by too much is replaced by two.

    Args:
        solver: What finds the equilibria; without an attribute `past` it leaves nothing behind.
        load_history: The loads.

    Raises:
        NotConverged: When a step fails at the smallest increment too, or a patch leaves the range
            of its law; the steps yielded before stay valid.
    """
    return iter(LoadStepper(solver, load_history))


class LoadStepper:
    """Makes the load steps of a load history, see `load_steps`, from any position in it.

    Args:
        solver: What finds the equilibria; without an attribute `past` it leaves nothing behind.
        load_history: The loads.
        position: Where to start.
        file: The scene's file, for errors.

    Attributes:
        position: Position in the load history; up to date whenever a load step is yielded.
    """

    def __init__(
        self,
        solver: StepSolver,
        load_history: LoadHistory,
        position: LoadPosition | None = None,
        file: str | None = None,
    ) -> None:
        self._solver, self._load_history, self._file = solver, load_history, file
        self.position = position or LoadPosition()
        self._newton = self._linear = 0
        self._seconds = 0.0

    def __iter__(self) -> Iterator[LoadStep]:
        """Yield the load steps from the position on."""
        history = self._load_history
        while not self.position.is_at_end(history):
            now = self.position
            if not now.ahead:
                if history.begins_stage(now.time):
                    now = replace(now, origin=(now.approach, now.force))
                target = now.targets + 1
                now = replace(now, targets=target, ahead=(float(target),))
            began = time.perf_counter()
            self.position = now
            step = self._within_limit(now.ahead[-1])
            self._seconds += time.perf_counter() - began
            if step is None:
                between = 0.5 * (now.time + now.ahead[-1])
                self.position = replace(now, ahead=(*now.ahead, between))
            else:
                yield self._accepted(step)

    def _control(self, target: float) -> Control:
        return self._load_history.control_at(target, self.position.origin)

    def _within_limit(self, target: float) -> LoadStep | None:
        """Press to a load step; return None when the force would change by too much."""
        divisible = target - self.position.time > _SMALLEST
        force = self._control(target).force
        if divisible and force is not None and self._exceeds_limit(force):
            return None
        past = getattr(self._solver, "past", None)
        step = self._reached(target)
        if divisible and self._exceeds_limit(step.force_N):
            if past is not None:
                self._solver.past = past
            return None
        return step

    def _exceeds_limit(self, force: float) -> bool:
        limit = self._load_history.force_change
        last, largest = self.position.force, self.position.largest
        if limit is None or last == 0.0:
            return False
        # halved steps of a force may meet the limit exactly, up to rounding
        return abs(force - last) > limit * max(largest, force) * (1.0 + 1e-9)

    def _reached(self, target: float) -> LoadStep:
        """Press to a load step, through smaller ones where the whole one fails."""
        last, ahead = self.position.time, [target]
        while True:
            control = self._control(ahead[-1])
            try:
                step = self._solver.press(control)
            except InputError as error:
                raise self._refused(error, control) from None
            except NotConverged as error:
                self._newton += error.iterations
                beyond = isinstance(error, BeyondLaws | NotBalanced)
                if beyond or ahead[-1] - last <= _SMALLEST:
                    shown = self._load_history.shown(control)
                    halved = "" if beyond else f"it was halved {_MOST_HALVINGS} times; "
                    raise NotConverged(
                        f"load step {self.position.steps + 1} ({shown})",
                        reason=error.reason,
                        iterations=error.iterations,
                        remedy=halved + error.remedy,
                    ) from error
                ahead.append(0.5 * (last + ahead[-1]))
                continue
            self._newton += step.newton_iterations
            self._linear += step.linear_iterations
            last = ahead.pop()
            if not ahead:
                state = control.body_state
                return replace(step, stage=self._load_history.stage_at(last), body_state=state)

    def _refused(self, error: InputError, control: Control) -> InputError | NotConverged:
        """Return the error of a load that a solver refuses, as only the solution shows.

        Before the first load step it is wrong input. Later ones end a run as one that does not
        converge, with the load steps up to there.
        """
        if not error.key:  # options of the command line have theirs
            key = self._load_history.key_at(self.position.ahead[-1])
            error = error.located(key=key, file=self._file)
        if not self.position.steps:
            return error
        return NotConverged(
            f"load step {self.position.steps + 1} ({self._load_history.shown(control)})",
            reason="REFUSED",
            iterations=self._newton,
            remedy=str(error),
        )

    def _accepted(self, step: LoadStep) -> LoadStep:
        """Number a step, give it all iterations and the time that led to it, and move on."""
        now = self.position
        accepted = replace(
            step,
            step=now.steps + 1,
            newton_iterations=self._newton,
            linear_iterations=self._linear,
            wall_s=self._seconds,
        )
        self.position = replace(
            now,
            steps=now.steps + 1,
            ahead=now.ahead[:-1],
            time=now.ahead[-1],
            approach=step.approach_mm,
            force=step.force_N,
            largest=max(now.largest, step.force_N),
        )
        self._newton, self._linear, self._seconds = 0, 0, 0.0
        return accepted
