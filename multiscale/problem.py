"""A model pressed along its load history: the loop that every run is made of.

`for step in Problem(model, LoadHistory(force=(50.0,), steps=4)).steps()` is a whole example.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

from patchlaw.geometry import Control
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.model import BeyondLaws, Model
from patchlaw.support.arguments import Has, checked
from patchlaw.support.errors import InputError, NotBalanced, NotConverged

_MOST_HALVINGS = 8
"""Halvings of a load step that does not converge, or that changes the force by too much."""
_SMALLEST = 1.0 / 2**_MOST_HALVINGS


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
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

    def is_at_end(self, path: LoadHistory) -> bool:
        """Whether all load steps of a load history are accepted."""
        return self.targets == path.count and not self.ahead


class Problem:
    """A model and the load history that it is pressed along.

    A load step that does not converge is reached through smaller ones, which are not yielded. One
    that changes the force by more than the history allows is replaced by two.

    Loads are taken as they are. Whether an approach is small beside a body is checked in scenes.

    Args:
        model: What finds the equilibria; without an attribute `past` it leaves nothing behind.
        path: The loads, with approaches from first touch.
        position: Where in them to start.
        file: The scene's file, for errors.

    Attributes:
        position: Where the latest load step left the path; all that is needed to go on.
    """

    @checked
    def __init__(
        self,
        model: Annotated[Model, Has("a model such as a CellContact", ("press",))],
        path: LoadHistory,
        position: Position | None = None,
        file: str | None = None,
    ) -> None:
        self._model, self._path, self._file = model, path, file
        self.position = position or Position()
        self._newton = self._linear = 0
        self._seconds = 0.0

    def steps(self) -> Iterator[LoadStep]:
        """Yield the load steps from the position on, as they are accepted.

        Raises:
            NotConverged: When a step fails at the smallest increment too, or a patch leaves the
                range of its law; the steps yielded before stay valid.

        Note:
            Collective.
        """
        while not self.position.is_at_end(self._path):
            now = self.position
            if not now.ahead:
                if self._path.begins_stage(now.time):
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
        return self._path.control_at(target, self.position.origin)

    def _within_limit(self, target: float) -> LoadStep | None:
        """Press to a load step; return None when the force would change by too much."""
        divisible = target - self.position.time > _SMALLEST
        force = self._control(target).force
        if divisible and force is not None and self._exceeds_limit(force):
            return None
        past = getattr(self._model, "past", None)
        step = self._reached(target)
        if divisible and self._exceeds_limit(step.force_N):
            if past is not None:
                self._model.past = past
            return None
        return step

    def _exceeds_limit(self, force: float) -> bool:
        limit = self._path.force_change
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
                step = self._model.press(control)
            except InputError as error:
                raise self._refused(error, control) from None
            except NotConverged as error:
                self._newton += error.iterations
                beyond = isinstance(error, BeyondLaws | NotBalanced)
                if beyond or ahead[-1] - last <= _SMALLEST:
                    shown = self._path.shown(control)
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
                return replace(step, stage=self._path.stage_at(last), body_state=state)

    def _refused(self, error: InputError, control: Control) -> InputError | NotConverged:
        """Return the error of a load that a solver refuses, as only the solution shows.

        Before the first load step it is wrong input. Later ones end a run as one that does not
        converge, with the load steps up to there.
        """
        if not error.key:  # options of the command line have theirs
            key = self._path.key_at(self.position.ahead[-1])
            error = error.located(key=key, file=self._file)
        if not self.position.steps:
            return error
        return NotConverged(
            f"load step {self.position.steps + 1} ({self._path.shown(control)})",
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
