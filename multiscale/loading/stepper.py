"""Load programmes, and the driver that turns them into load steps of any coupling."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from geometry.errors import NotConverged
from geometry.rigid_plane import Control
from multiscale.loading.load_step import LoadStep
from multiscale.storage.serialisation import Arrays

_MOST_HALVINGS = 8


class Coupling(Protocol):
    """Anything that finds the equilibrium under a rigid plane."""

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; its number is the driver's to give.

        Args:
            control: What the step prescribes of the plane.

        Raises:
            NotConverged: When there is none to be found; what was accepted before stays as it
                was, so that a smaller step can be tried.
        """


@runtime_checkable
class Restorable(Protocol):
    """A coupling whose load steps depend on those before them, if only by where they start.

    Without it a coupling is taken to find the same equilibrium from nothing.
    """

    def state(self) -> Arrays:
        """Return what the next load step starts from; nothing in it depends on the ranks.

        Note:
            Collective.
        """

    def restore(self, state: Arrays) -> None:
        """Go on from a state, in a coupling newly made from the same scene.

        Args:
            state: What `state` returned.

        Note:
            Collective.
        """


class BeyondLaws(NotConverged):
    """A patch left the range of its law; smaller steps to the same load do not help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadHistory:
    """Turning points of the load, and how densely the legs between them are stepped.

    Attributes:
        quantity: What is prescribed, ``"approach"`` or ``"force"``.
        points: Its values at the ends of the legs, the first of which starts at zero [mm or N].
        steps: Load steps per leg.
        tilt: Slopes of the plane; None lets it turn freely.
        force_change: Largest change of the force in a step relative to the largest force so far,
            that of the step included; steps that exceed it are halved. From no force at all to
            the first a step may be as large as it is. None takes the steps as they are.
    """

    quantity: Literal["approach", "force"]
    points: tuple[float, ...]
    steps: int = 8
    tilt: tuple[float, float] | None = (0.0, 0.0)
    force_change: float | None = None

    @property
    def targets(self) -> list[float]:
        """Values of the prescribed quantity at the load steps, before any is halved."""
        ends = np.array((0.0, *self.points))
        legs = np.linspace(ends[:-1], ends[1:], self.steps + 1, axis=1)[:, 1:]
        return [float(value) for value in legs.ravel()]

    @property
    def count(self) -> int:
        """Number of load steps, before any is halved."""
        return self.steps * len(self.points)

    @property
    def largest(self) -> float:
        """Largest value of the prescribed quantity."""
        return max(self.points)

    def control(self, value: float) -> Control:
        """Return what a load step to a value of the prescribed quantity prescribes."""
        if self.quantity == "force":
            return Control(force=value, tilt=self.tilt)
        return Control(approach=value, tilt=self.tilt)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadPosition:
    """Where a programme has come to between two load steps; all that is needed to go on from there.

    Attributes:
        steps: Load steps accepted so far.
        targets: Targets of the programme that were set out for so far.
        ahead: Values still to be reached on the way to the latest target and that itself, the
            nearest last; empty once it is reached.
        smallest: Smallest increment on that way.
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


def load_steps(coupling: Coupling, load_history: LoadHistory) -> Iterator[LoadStep]:
    """Yield the load steps of a programme as they are accepted.

    A step that does not converge is reached through smaller ones, which are not told; one that
    changes the force by too much is replaced by two.

    Args:
        coupling: What finds the equilibria.
        load_history: The loads.

    Raises:
        NotConverged: When a step fails at the smallest increment too, or a patch leaves the range
            of its law; the steps yielded before stay valid.
    """
    return iter(LoadStepper(coupling, load_history))


class LoadStepper:
    """Makes the load steps of a programme, see `load_steps`; may go on where another one stopped.

    Args:
        coupling: What finds the equilibria.
        load_history: The loads.
        position: Where to go on from.

    Attributes:
        position: Where the programme has come to; up to date whenever a load step is yielded.
    """

    def __init__(
        self, coupling: Coupling, load_history: LoadHistory, position: LoadPosition | None = None
    ) -> None:
        self._coupling, self._programme = coupling, load_history
        self.position = position or LoadPosition()
        self._newton = self._linear = 0
        self._spent = 0.0

    def __iter__(self) -> Iterator[LoadStep]:
        """Yield the load steps that are still to be made."""
        targets = self._programme.targets
        while True:
            now = self.position
            if now.ahead:
                step = self._to(now.ahead[-1], now.smallest)
                if step is None:
                    between = 0.5 * (now.value + now.ahead[-1])
                    self.position = replace(now, ahead=(*now.ahead, between))
                else:
                    yield self._accepted(step)
            elif now.targets < len(targets):
                target = targets[now.targets]
                smallest = abs(target - now.value) / 2**_MOST_HALVINGS
                self.position = replace(
                    now, targets=now.targets + 1, ahead=(target,), smallest=smallest
                )
            else:
                return

    def _to(self, target: float, smallest: float) -> LoadStep | None:
        """Press to a value; None when the force would change by too much on the way."""
        began = time.perf_counter()
        step = self._tried(target, smallest)
        self._spent += time.perf_counter() - began
        return step

    def _tried(self, target: float, smallest: float) -> LoadStep | None:
        divisible = abs(target - self.position.value) > smallest
        if divisible and self._programme.quantity == "force" and self._is_leap(target):
            return None
        step = self._pressed(target, smallest)
        if divisible and self._is_leap(step.force_N):
            return None
        return step

    def _is_leap(self, force: float) -> bool:
        limit = self._programme.force_change
        last, largest = self.position.force, self.position.largest
        if limit is None or last == 0.0:
            return False
        # halved steps of a force may meet the limit exactly, up to rounding
        return abs(force - last) > limit * max(largest, force) * (1.0 + 1e-9)

    def _pressed(self, target: float, smallest: float) -> LoadStep:
        """Press to a value, through smaller steps where the whole one fails."""
        last, ahead = self.position.value, [target]
        while True:
            control = self._programme.control(ahead[-1])
            try:
                step = self._coupling.press(control)
            except BeyondLaws as error:
                raise self._failed(control, error, "") from error
            except NotConverged as error:
                self._newton += error.iterations
                if abs(ahead[-1] - last) <= smallest:
                    halved = f"it was halved {_MOST_HALVINGS} times; "
                    raise self._failed(control, error, halved) from error
                ahead.append(0.5 * (last + ahead[-1]))
                continue
            self._newton += step.newton_iterations
            self._linear += step.linear_iterations
            last = ahead.pop()
            if not ahead:
                return step

    def _accepted(self, step: LoadStep) -> LoadStep:
        """Number a step and give it the work that led to it."""
        now = self.position
        told = replace(
            step,
            step=now.steps + 1,
            newton_iterations=self._newton,
            linear_iterations=self._linear,
            wall_s=self._spent,
        )
        self.position = replace(
            now,
            steps=now.steps + 1,
            ahead=now.ahead[:-1],
            value=now.ahead[-1],
            force=step.force_N,
            largest=max(now.largest, step.force_N),
        )
        self._newton, self._linear, self._spent = 0, 0, 0.0
        return told

    def _failed(self, control: Control, error: NotConverged, halved: str) -> NotConverged:
        return NotConverged(
            f"load step {self.position.steps + 1} ({control})",
            reason=error.reason,
            iterations=error.iterations,
            remedy=halved + error.remedy,
        )
