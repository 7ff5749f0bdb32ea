"""Load histories, and the stepper that turns them into load steps of any coupling."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np

from geometry import Control, NotConverged
from multiscale.loading.load_step import LoadStep

_MOST_HALVINGS = 8
"""Halvings of a load step that does not converge, or that changes the force by too much."""


class Solver(Protocol):
    """Anything that finds the equilibrium under a rigid plane.

    Where load steps depend on those before them beyond initial guesses, an attribute ``past`` is
    what these left behind; setting it takes load steps back.
    """

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step, whose number is still 0.

        Args:
            control: What the step prescribes of the plane.

        Raises:
            NotConverged: When none is found. Earlier equilibria stay what they were, so that a
                smaller step can be tried.
        """


class BeyondLaws(NotConverged):
    """A patch is outside the range of its law, where smaller load steps do not help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadHistory:
    """Turning points of the load, and the number of load steps between them.

    Attributes:
        quantity: What is prescribed, ``"approach"`` or ``"force"``.
        points: Its values at the ends of the legs, the first of which starts at zero [mm or N].
        steps: Load steps per leg.
        cycles: How often the points follow each other.
        tilt: Slopes of the plane; None lets it turn freely.
        zero: Approach at the height that approaches are shown from; it, and an approach among the
            points, counts from first touch [mm].
        force_change: Largest change of the force in a step relative to the largest force so far,
            that of the step included; steps that exceed it are halved. The first step with a force
            is not limited. None sets no limit.
    """

    quantity: Literal["approach", "force"]
    points: tuple[float, ...]
    steps: int = 8
    tilt: tuple[float, float] | None = (0.0, 0.0)
    force_change: float | None = None
    cycles: int = 1
    zero: float = 0.0

    @property
    def targets(self) -> list[float]:
        """Values of the prescribed quantity at the load steps, before any is halved."""
        first, later = self.cycle_from(0.0), self.cycle_from(self.points[-1])
        return first + (self.cycles - 1) * later

    def cycle_from(self, value: float) -> list[float]:
        """Return the values of the prescribed quantity in a cycle that starts at a value."""
        ends = np.array((value, *self.points))
        legs = np.linspace(ends[:-1], ends[1:], self.steps + 1, axis=1)[:, 1:]
        return [float(each) for each in legs.ravel()]

    @property
    def legs(self) -> int:
        """Number of ways from one turning point to the next."""
        return self.cycles * len(self.points)

    @property
    def count(self) -> int:
        """Number of load steps, before any is halved."""
        return self.steps * self.legs

    @property
    def largest(self) -> float:
        """Largest value of the prescribed quantity."""
        return max(self.points)

    @property
    def unloads(self) -> bool:
        """Whether the load falls anywhere."""
        points = self.points[-1:] * (self.cycles > 1) + self.points
        return any(later < earlier for earlier, later in pairwise(points))

    @property
    def up_to_largest(self) -> LoadHistory:
        """The history of one load step, straight to the largest load."""
        return LoadHistory(quantity=self.quantity, points=(self.largest,), steps=1, tilt=self.tilt)

    def control(self, value: float) -> Control:
        """Return what a load step to a value of the prescribed quantity prescribes."""
        if self.quantity == "force":
            return Control(force=value, tilt=self.tilt)
        return Control(approach=value, tilt=self.tilt)

    def shown(self, control: Control) -> Control:
        """Return a control whose approach counts from the zero, as users see it."""
        if control.approach is None:
            return control
        return replace(control, approach=control.approach - self.zero)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadPosition:
    """Position in a load history between two load steps; all that is needed to continue there.

    Attributes:
        steps: Load steps accepted so far.
        targets: Targets of the load history that were begun so far.
        ahead: The latest target and values that are to be reached before it, the next one last;
            empty once the target is reached.
        smallest: Smallest increment on the way to it.
        value: Prescribed quantity at the last accepted step [mm or N].
        force: Force there [N].
        largest: Largest force so far [N].
    """

    steps: int = 0
    targets: int = 0
    ahead: tuple[float, ...] = ()
    smallest: float = 0.0
    value: float = 0.0
    force: float = 0.0
    largest: float = 0.0

    def is_below_past(self, history: LoadHistory) -> bool:
        """Tell whether the load was larger at an earlier load step, given its history."""
        begun = history.targets[: self.targets]
        reached = begun[:-1] if self.ahead else begun
        return self.value < max(reached, default=self.value)

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


def load_steps(solver: Solver, load_history: LoadHistory) -> Iterator[LoadStep]:
    """Yield the load steps of a load history as they are accepted.

    A step that does not converge is reached through smaller ones, which are not yielded. One that
    changes the force by too much is replaced by two.

    Args:
        solver: What finds the equilibria.
        load_history: The loads.

    Raises:
        NotConverged: When a step fails at the smallest increment too, or a patch leaves the range
            of its law; the steps yielded before stay valid.
    """
    return iter(LoadStepper(solver, load_history))


class LoadStepper:
    """Makes the load steps of a load history, see `load_steps`, from any position in it.

    Args:
        solver: What finds the equilibria.
        load_history: The loads.
        position: Where to start.

    Attributes:
        position: Position in the load history; up to date whenever a load step is yielded.
    """

    def __init__(
        self, solver: Solver, load_history: LoadHistory, position: LoadPosition | None = None
    ) -> None:
        self._solver, self._load_history = solver, load_history
        self.position = position or LoadPosition()
        self._newton = self._linear = 0
        self._seconds = 0.0

    def __iter__(self) -> Iterator[LoadStep]:
        """Yield the load steps from the position on."""
        targets = self._load_history.targets
        while not self.position.is_at_end(self._load_history):
            now = self.position
            if not now.ahead:
                target = targets[now.targets]
                smallest = abs(target - now.value) / 2**_MOST_HALVINGS
                now = replace(now, targets=now.targets + 1, ahead=(target,), smallest=smallest)
            began = time.perf_counter()
            self.position = now
            step = self._within_limit(now.ahead[-1])
            self._seconds += time.perf_counter() - began
            if step is None:
                between = 0.5 * (now.value + now.ahead[-1])
                self.position = replace(now, ahead=(*now.ahead, between))
            else:
                yield self._accepted(step)

    def _within_limit(self, target: float) -> LoadStep | None:
        """Press to a value; return None when the force would change by too much."""
        divisible = abs(target - self.position.value) > self.position.smallest
        by_force = self._load_history.quantity == "force"
        if divisible and by_force and self._exceeds_limit(target):
            return None
        past = getattr(self._solver, "past", None)
        step = self._reached(target)
        if divisible and self._exceeds_limit(step.force_N):
            if past is not None:
                setattr(self._solver, "past", past)  # noqa: B010
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
        """Press to a value, through smaller steps where the whole one fails."""
        last, ahead = self.position.value, [target]
        while True:
            control = self._load_history.control(ahead[-1])
            try:
                step = self._solver.press(control)
            except NotConverged as error:
                self._newton += error.iterations
                beyond = isinstance(error, BeyondLaws)
                if beyond or abs(ahead[-1] - last) <= self.position.smallest:
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
                return step

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
            value=now.ahead[-1],
            force=step.force_N,
            largest=max(now.largest, step.force_N),
        )
        self._newton, self._linear, self._seconds = 0, 0, 0.0
        return accepted
