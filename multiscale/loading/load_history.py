"""Load histories: what scenes prescribe of the rigid plane."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np

from geometry import Control, InputError
from geometry.zero import FIRST_TOUCH, Zero
from support.fields import KEY, Limits, Slope, Unit, check_limits
from support.quantities import example

Tilt = tuple[Slope, Slope] | Literal["free"]
_Repeats = Annotated[int, Limits(ge=1, le=1_000_000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadHistory:
    """The motion of the rigid plane: turning points of its approach, or of the force on it.

    Args:
        zero: Height that the approach counts from, here and in all results and laws: ``first
            touch``, the highest point of the surface; ``mean plane``, the mean of its heights; or
            ``quantile 0.001``, the height that 0.1 % of its area exceeds, with any number between 0
            and 1. On measured surfaces one point decides about first touch, and no single one about
            the others. Approaches may be negative there.
        approach: Approach of the rigid plane, counted from ``zero``, or a list of turning points
            [mm]. Exactly one of ``approach`` and ``force`` is given.
        force: Force on the rigid plane, or a list of turning points [N].
        steps: Load steps to every turning point.
        cycles: How often the plane goes through the turning points, of which it needs two at least.
        tilt: Slopes of the approach along x and y about the middle of the interface; ``free`` lets
            the plane turn until the pressures have no moment.
        force_change: Largest change of the force in one step, relative to the largest force so far;
            a step that exceeds it is halved. When not given no step is halved.
        depth: How far the zero lies below the highest point of the surface. On a surface, where
            it is known, approaches count from first touch, which this is added for [mm].

    Raises:
        InputError: When there is no load or two, or a load history makes no sense.
    """

    zero: str = FIRST_TOUCH
    approach: Annotated[tuple[float, ...], Unit("mm", several=True)] | None = None
    force: Annotated[tuple[float, ...], Unit("N", several=True)] | None = None
    steps: _Repeats = 8
    cycles: _Repeats = 1
    tilt: Tilt = (0.0, 0.0)
    force_change: Annotated[float, Limits(ge=1e-3, lt=1)] | None = None
    depth: float = field(default=0.0, metadata={KEY: None})

    def __post_init__(self) -> None:
        check_limits(self)
        try:
            object.__setattr__(self, "zero", Zero(self.zero).name)
        except InputError as error:
            raise error.located(key="zero") from None
        if self.approach is not None:
            _check_points(self.approach, "mm", "approach", from_zero=self.zero == FIRST_TOUCH)
        if self.force is not None:
            _check_points(self.force, "N", "force", from_zero=True)
        if (self.approach is None) == (self.force is None):
            raise InputError("needs exactly one load", allowed="either 'approach' or 'force'")
        if self.cycles > 1 and len(self.points) < 2:
            raise InputError(
                f"cycles = {self.cycles} needs two turning points",
                allowed="a list of loads, or cycles = 1",
            )

    @property
    def quantity(self) -> Literal["approach", "force"]:
        """What is prescribed."""
        return "approach" if self.force is None else "force"

    @property
    def points(self) -> tuple[float, ...]:
        """Its values at the ends of the legs, the first of which starts at zero [mm or N]."""
        return self.approach or self.force or ()

    @property
    def slopes(self) -> tuple[float, float] | None:
        """Slopes of the plane; None lets it turn freely."""
        return None if self.tilt == "free" else self.tilt

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
        load = (self.largest,)
        if self.quantity == "force":
            return LoadHistory(force=load, steps=1, tilt=self.tilt)
        return LoadHistory(approach=load, steps=1, tilt=self.tilt)

    def control(self, value: float) -> Control:
        """Return what a load step to a value of the prescribed quantity prescribes."""
        if self.quantity == "force":
            return Control(force=value, tilt=self.slopes)
        return Control(approach=value, tilt=self.slopes)

    def shown(self, control: Control) -> Control:
        """Return a control whose approach counts from the zero, as users see it."""
        if control.approach is None:
            return control
        return replace(control, approach=control.approach - self.depth)


def _check_points(points: tuple[float, ...], unit: str, key: str, *, from_zero: bool) -> None:
    """Refuse turning points that are none, repeat each other or, from zero, fall below it."""
    allowed = f"a quantity such as {example(unit)}, or a list of turning points"
    if not points:
        raise InputError("is an empty list", key=key, value=list(points), allowed=allowed)
    if any(one == other for one, other in pairwise(points)):
        raise InputError("repeats a turning point", key=key, value=list(points), allowed=allowed)
    if from_zero and not points[0] > 0.0:
        raise InputError("must be greater than 0", key=key, value=list(points))
    if from_zero and min(points) < 0.0:
        raise InputError("must not turn below 0", key=key, value=list(points))
