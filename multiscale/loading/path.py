"""A path of loads: what every load step prescribes, one after another.

`LoadHistory.path` writes turning points, cycles and stages out into one; in Python a list of steps
such as ``[Step(force=1.0), Step(force=2.0)]`` will do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from patchlaw.geometry import Control
from patchlaw.geometry.rigid_plane import ShearControl
from patchlaw.support.arguments import Count, Length, Limits, Slope, check_fields
from patchlaw.support.errors import InputError

Quantity = Literal["approach", "force"]
Plane = tuple[float, float]
"""Approach of the plane [mm], and force of the contact [N]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What a load step prescribes.

    Args:
        approach: Approach at the middle of the interface, from first touch [mm]. Exactly one of
            ``approach`` and ``force`` is given.
        force: Force of the contact, the pull of bolts included [N].
        carried: Share that is added to it of what the plane had when the stage began, or when a
            path turned from forces to approaches or back.
        tilt: Slopes of the approach along x and y; None lets the plane turn.
        shear: Shift of the plane or shear force on it; None without.
        slid: Distance that the surfaces have slid on each other so far [mm].
        body_state: Position among the states of the bodies' loads, see `geometry.Control`.
        stage: Number of its stage, from 1; None without stages.
        turns: Whether the loads turn or end here; of cycles those of the first alone.
        key: Key of the scene that prescribes it.

    Raises:
        InputError: When not exactly one of approach and force is given.
    """

    approach: float | None = None
    force: float | None = None
    carried: float = 0.0
    tilt: tuple[Slope, Slope] | None = (0.0, 0.0)
    shear: ShearControl | None = None
    slid: Annotated[Length, Limits(ge=0)] = 0.0
    body_state: float = 0.0
    stage: Count | None = None
    turns: bool = False
    key: str = ""

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.approach is None) == (self.force is None):
            problem, allowed = "prescribes either the approach or the force", "exactly one of them"
            raise InputError(problem, value=(self.approach, self.force), allowed=allowed)

    @property
    def quantity(self) -> Quantity:
        """What is prescribed of the plane."""
        return "approach" if self.force is None else "force"

    @property
    def value(self) -> float:
        """The approach [mm] or the force [N], without what is carried over."""
        return (self.approach if self.force is None else self.force) or 0.0

    def control(self, origin: Plane = (0.0, 0.0)) -> Control:
        """Return what a model is pressed with.

        Args:
            origin: The plane when the stage began, or what is prescribed changed.
        """
        approach, force = self.approach, self.force
        if approach is not None:
            approach += self.carried * origin[0]
        elif force is not None and self.carried:  # bolts may pull by no more than that
            force = max(force + self.carried * origin[1], 0.0)
        return Control(
            approach=approach,
            force=force,
            tilt=self.tilt,
            body_state=self.body_state,
            shear=self.shear,
            slid=self.slid,
        )

    def part(self, share: float, before: Step | None) -> Step:
        """Return what is prescribed on the way to this step.

        Args:
            share: Of the way.
            before: The step before; None starts from nothing.
        """
        start, carried, state = 0.0, 0.0, 2.0 * ((self.stage or 1) - 1)
        if before is not None:
            begins = before.stage != self.stage
            start, carried = before.value, before.carried
            if before.quantity != self.quantity or (begins and carried):
                start, carried = 0.0, 1.0
            state = state if begins else before.body_state
        shear, slid = self.shear, 0.0 if before is None else before.slid
        if shear is not None:
            last = None if before is None else before.shear
            pairs = zip((0.0, 0.0) if last is None else last.pair, shear.pair, strict=True)
            pair = tuple(a + share * (b - a) for a, b in pairs)
            shear = ShearControl(**{"shift" if shear.force is None else "force": pair})  # type: ignore[arg-type]
        load: Any = {self.quantity: start + share * (self.value - start)}
        return replace(
            self,
            **load,
            carried=carried + share * (self.carried - carried),
            body_state=state + share * (self.body_state - state),
            shear=shear,
            slid=slid + share * (self.slid - slid),
        )


class Path(tuple[Step, ...]):
    """All steps of a path, before any is halved, and what is asked of them together."""

    __slots__ = ()

    def known(self, quantity: Quantity) -> list[Step]:
        """Return the steps whose approach, or force, is known before the run.

        Args:
            quantity: Which of them.
        """
        return [step for step in self if step.quantity == quantity and not step.carried]

    def furthest(self, quantity: Quantity) -> Step:
        """Return the step with the largest approach, or force, that is known; the first of several.

        Args:
            quantity: Which of them.
        """
        return max(self.known(quantity), key=lambda step: step.value)

    def largest(self, quantity: Quantity | None = None) -> float:
        """Return the largest approach [mm] or force [N] that is known; 0 where none is.

        Args:
            quantity: Which of them; by default that which is prescribed.
        """
        which = quantity or self.quantity
        return self.furthest(which).value if self.known(which) else 0.0

    def control(self, value: float) -> Control:
        """Return what prescribes a value of the quantity, and the tilt.

        Args:
            value: The approach [mm] or the force [N].
        """
        return Step(**{self.quantity: value}, tilt=self.tilt).control()  # type: ignore[arg-type]

    @property
    def quantity(self) -> Quantity:
        """What is prescribed; of both the force, unless no force that presses is known before."""
        stated = {step.quantity for step in self}
        if len(stated) == 1:
            return stated.pop()
        return "force" if self.largest("force") > 0.0 else "approach"

    @property
    def tilt(self) -> tuple[float, float] | None:
        """Slopes of the plane; None where it is free to tilt."""
        return self[0].tilt

    @property
    def turning_points(self) -> Path:
        """The steps at which the loads turn or end, once through each of their cycles."""
        return Path(step for step in self if step.turns)

    @property
    def largest_controls(self) -> list[Control]:
        """What prescribes the largest approach and the largest force, as far as there are any."""
        both: tuple[Quantity, ...] = ("approach", "force")
        largest = [self.furthest(one) for one in both if self.largest(one) > 0.0]
        return [replace(step, shear=None, body_state=0.0).control() for step in largest]
