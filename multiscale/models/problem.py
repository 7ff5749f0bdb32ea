"""A model pressed along a path of loads: the loop that every run is made of.

`for step in Problem(model, [Step(force=25.0), Step(force=50.0)]).steps()` is a whole example.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

from patchlaw.geometry import Control
from patchlaw.geometry.zero import FIRST_TOUCH
from patchlaw.multiscale.loading.load_history import ForceChange, LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.loading.path import Step
from patchlaw.multiscale.models.model import BeyondLaws, Model
from patchlaw.support.arguments import Has, checked
from patchlaw.support.errors import InputError, NotBalanced, NotConverged

_MOST_HALVINGS = 8
"""Halvings of a load step that does not converge, or that changes the force by too much."""
_SMALLEST = 1.0 / 2**_MOST_HALVINGS


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Position in a path between two load steps; all that is needed to continue there.

    Attributes:
        steps: Load steps accepted so far.
        time: The last accepted step, counted in steps of the path.
        ahead: The step of the path that was begun, and what is to be reached before it, the next
            one last, counted likewise; empty once it is reached.
        approach: Approach there [mm].
        force: Force there [N].
        largest: Largest force so far [N].
        origin: Approach [mm] and force [N] when the present stage began, or since when the present
            one of them is prescribed.
    """

    steps: int = 0
    time: float = 0.0
    ahead: tuple[float, ...] = ()
    approach: float = 0.0
    force: float = 0.0
    largest: float = 0.0
    origin: tuple[float, float] = (0.0, 0.0)

    def is_at_end(self, path: Sequence[Step]) -> bool:
        """Whether all load steps of a path are accepted."""
        return self.time == len(path)


class Problem:
    """A model and the path of loads that it is pressed along.

    A load step that does not converge is reached through smaller ones, which are not yielded. One
    that changes the force by more than is allowed is replaced by two.

    Loads are taken as they are. Whether an approach is small beside a body is checked in scenes.

    Args:
        model: What finds the equilibria; without an attribute `past` it leaves nothing behind.
        path: The load steps in turn, or a history of loads that is written out into them.
        position: Where in them to start.
        force_change: Largest change of the force in one step, relative to the largest force so far;
            by default that of the history.
        zero: Approach that approaches count from in errors [mm].
        file: The scene's file, for errors.

    Raises:
        InputError: When the path is empty, or a history needs a surface for its zero, or a face
            for its pressures.

    Attributes:
        position: Where the latest load step left the path; all that is needed to go on.
    """

    @checked
    def __init__(
        self,
        model: Annotated[Model, Has("a model such as a CellContact", ("press",))],
        path: LoadHistory | Sequence[Step],
        position: Position | None = None,
        *,
        force_change: ForceChange | None = None,
        zero: float = 0.0,
        file: str | None = None,
    ) -> None:
        self._model, self._zero, self._file = model, zero, file
        self._force_change = force_change
        if isinstance(path, LoadHistory):
            self._force_change = force_change or path.force_change
            if path.zero != FIRST_TOUCH:
                problem = "is a height of a surface, which is not known here"
                raise InputError(problem, key="zero", value=path.zero, allowed=FIRST_TOUCH)
            path = path.path()
        if not path:
            raise InputError("has no step", key="path", value=[], allowed="steps, one at least")
        slid = [0.0, *(step.slid for step in path)]
        if any(slid) and not getattr(model, "wears", False):
            allowed = "a model that wears, as CellContact.of(…, wear=1e-8)"
            raise InputError("slides where nothing wears", key="path", allowed=allowed)
        if any(after < before for before, after in pairwise(slid)):
            allowed = "distances slid so far, which do not fall"
            raise InputError("slides back", key="path", value=slid[1:], allowed=allowed)
        self._path = path
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
                index = round(now.time)
                here, last = self._path[index], self._path[index - 1]
                if not index or (here.stage, here.quantity) != (last.stage, last.quantity):
                    now = replace(now, origin=(now.approach, now.force))
                now = replace(now, ahead=(index + 1.0,))
            began = time.perf_counter()
            self.position = now
            step = self._within_limit(now.ahead[-1])
            self._seconds += time.perf_counter() - began
            if step is None:
                between = 0.5 * (now.time + now.ahead[-1])
                self.position = replace(now, ahead=(*now.ahead, between))
            else:
                yield self._accepted(step)

    def _step(self, target: float) -> Step:
        """Return the step that leads to a target, or in part to one between two steps."""
        index = math.ceil(target) - 1
        step, share = self._path[index], target - index
        return step if share == 1.0 else step.part(share, self._path[index - 1] if index else None)

    def _control(self, target: float) -> Control:
        return self._step(target).control(self.position.origin)

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
        limit = self._force_change
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
                    halved = "" if beyond else f"it was halved {_MOST_HALVINGS} times; "
                    remedy = halved + error.remedy
                    raise self._failed(control, error.reason, error.iterations, remedy) from error
                ahead.append(0.5 * (last + ahead[-1]))
                continue
            self._newton += step.newton_iterations
            self._linear += step.linear_iterations
            last = ahead.pop()
            if not ahead:
                return replace(step, stage=self._step(last).stage, control=control)

    def _failed(self, control: Control, reason: str, iterations: int, remedy: str) -> NotConverged:
        """Return the error of a load step that is not found, with the approach as users see it."""
        if control.approach is not None:
            control = replace(control, approach=control.approach - self._zero)
        what = f"load step {self.position.steps + 1} ({control})"
        return NotConverged(what, reason=reason, iterations=iterations, remedy=remedy)

    def _refused(self, error: InputError, control: Control) -> InputError | NotConverged:
        """Return the error of a load that a solver refuses, as only the solution shows.

        Before the first load step it is wrong input. Later ones end a run as one that does not
        converge, with the load steps up to there.
        """
        if not error.key:  # options of the command line have theirs
            key = self._step(self.position.ahead[-1]).key
            error = error.located(key=key, file=self._file)
        if not self.position.steps:
            return error
        return self._failed(control, "REFUSED", self._newton, str(error))

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
