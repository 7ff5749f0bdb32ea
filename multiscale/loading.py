"""Load programmes, and the driver that turns them into load steps of any coupling."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from geometry.control import Control
from geometry.errors import NotConverged
from multiscale.history import LoadStep

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


class BeyondLaws(NotConverged):
    """A patch left the range of its law; smaller steps to the same load do not help."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Programme:
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
        ends = zip((0.0, *self.points), self.points, strict=False)
        legs = [np.linspace(start, end, self.steps + 1)[1:] for start, end in ends]
        return [float(value) for leg in legs for value in leg]

    @property
    def largest(self) -> float:
        """Largest value of the prescribed quantity."""
        return max(self.points)

    def control(self, value: float) -> Control:
        """Return what a load step to a value of the prescribed quantity prescribes."""
        if self.quantity == "force":
            return Control(force=value, tilt=self.tilt)
        return Control(approach=value, tilt=self.tilt)


def load_steps(coupling: Coupling, programme: Programme) -> Iterator[LoadStep]:
    """Yield the load steps of a programme as they are accepted.

    A step that does not converge is reached through smaller ones, which are not told; one that
    changes the force by too much is replaced by two.

    Args:
        coupling: What finds the equilibria.
        programme: The loads.

    Raises:
        NotConverged: When a step fails at the smallest increment too, or a patch leaves the range
            of its law; the steps yielded before stay valid.
    """
    drive = _Drive(coupling, programme)
    for target in programme.targets:
        smallest = abs(target - drive.value) / 2**_MOST_HALVINGS
        ahead = [target]
        while ahead:
            step = drive.to(ahead[-1], smallest)
            if step is None:
                ahead.append(0.5 * (drive.value + ahead[-1]))
            else:
                ahead.pop()
                yield step


class _Drive:
    """Where a programme has come to.

    Attributes:
        value: Prescribed quantity at the last accepted step [mm or N].
    """

    def __init__(self, coupling: Coupling, programme: Programme) -> None:
        self._coupling, self._programme = coupling, programme
        self.value = 0.0
        self._number = self._newton = self._linear = 0
        self._force = self._largest = 0.0
        self._spent = 0.0

    def to(self, target: float, smallest: float) -> LoadStep | None:
        """Press to a value; None when the force would change by too much on the way."""
        began = time.perf_counter()
        step = self._tried(target, smallest)
        self._spent += time.perf_counter() - began
        return None if step is None else self._accepted(target, step)

    def _tried(self, target: float, smallest: float) -> LoadStep | None:
        divisible = abs(target - self.value) > smallest
        if divisible and self._programme.quantity == "force" and self._is_leap(target):
            return None
        step = self._pressed(target, smallest)
        if divisible and self._is_leap(step.force_N):
            return None
        return step

    def _is_leap(self, force: float) -> bool:
        limit = self._programme.force_change
        if limit is None or self._force == 0.0:
            return False
        # halved steps of a force may meet the limit exactly, up to rounding
        return abs(force - self._force) > limit * max(self._largest, force) * (1.0 + 1e-9)

    def _pressed(self, target: float, smallest: float) -> LoadStep:
        """Press to a value, through smaller steps where the whole one fails."""
        last, ahead = self.value, [target]
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

    def _accepted(self, target: float, step: LoadStep) -> LoadStep:
        """Number a step and give it the work that led to it."""
        self._number += 1
        told = replace(
            step,
            step=self._number,
            newton_iterations=self._newton,
            linear_iterations=self._linear,
            wall_s=self._spent,
        )
        self.value, self._force = target, step.force_N
        self._largest = max(self._largest, step.force_N)
        self._newton, self._linear, self._spent = 0, 0, 0.0
        return told

    def _failed(self, control: Control, error: NotConverged, halved: str) -> NotConverged:
        return NotConverged(
            f"load step {self._number + 1} ({described(control)})",
            reason=error.reason,
            iterations=error.iterations,
            remedy=halved + error.remedy,
        )


def described(control: Control) -> str:
    """Say what a load step prescribes, for messages."""
    if control.force is not None:
        return f"force {control.force:.6g} N"
    return f"approach {control.approach:.6g} mm"
