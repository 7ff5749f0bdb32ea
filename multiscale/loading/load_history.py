"""Load histories: what scenes prescribe of the rigid plane."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np

from geometry import Control, InputError
from geometry.shear_state import ShearControl
from geometry.zero import FIRST_TOUCH, Zero
from support.fields import KEY, Limits, Slope, Unit, check_limits
from support.quantities import example

Tilt = tuple[Slope, Slope] | Literal["free"]
Pairs = tuple[tuple[float, float], ...]
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
        shear: Shift of the plane along x and y from where it first touched, or a list of turning
            points [mm]. Exactly one of ``shear`` and ``shear_force`` may be given, with a
            coefficient of friction.
        shear_force: Shear force on the plane along x and y, or a list of turning points [N].
        shear_path: Whether the plane goes through the points of the shear ``after`` the load has
            come to its end, which then stays, or ``along`` with the load: each of them is then
            reached together with one of the load's turning points.
        shear_steps: Load steps to every point of a shear that follows the load; ``steps`` when not
            given.
        shear_cycles: How often the plane goes through the points of a shear that follows the load,
            of which it needs two at least.
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
    shear: Annotated[Pairs, Unit("mm", pairs=True)] | None = None
    shear_force: Annotated[Pairs, Unit("N", pairs=True)] | None = None
    shear_path: Literal["after", "along"] = "after"
    shear_steps: _Repeats | None = None
    shear_cycles: _Repeats = 1
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
        self._check_shear()

    def _check_shear(self) -> None:
        """Refuse two shear loads, what belongs to none, and paths that make no sense."""
        key, points = "shear" if self.shear_force is None else "shear_force", self.shear_points
        if self.shear is not None and self.shear_force is not None:
            problem, allowed = "is a second shear load", "either 'shear' or 'shear_force'"
            raise InputError(problem, key=key, value=points, allowed=allowed)
        along = self.shear_path == "along"
        beside = {"shear_path": along, "shear_steps": self.shear_steps is not None}
        beside["shear_cycles"] = self.shear_cycles > 1
        for name, stated in beside.items():
            if stated and not points:
                raise InputError("needs 'shear' or 'shear_force'", key=name)
            if stated and along and name != "shear_path":
                problem = "does not go with shear_path = 'along', which has the steps of the load"
                raise InputError(problem, key=name, allowed="leave it out")
        if any(one == other for one, other in pairwise([(0.0, 0.0), *points])):
            problem = "repeats a point, or starts without shear"
            raise InputError(problem, key=key, value=points, allowed="points that differ")
        if points and along and len(points) != len(self.points):
            problem = "has another number of points than the load that it goes along with"
            raise InputError(problem, key=key, value=points, allowed=f"{len(self.points)} pairs")
        if self.shear_cycles > 1 and len(points) < 2:
            problem, allowed = "needs two points of the shear", "a list of pairs, or 1"
            raise InputError(problem, key="shear_cycles", value=self.shear_cycles, allowed=allowed)

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
        normal = first + (self.cycles - 1) * later
        return normal + [self.points[-1]] * (self.count - len(normal))

    @property
    def shear_points(self) -> Pairs:
        """Ends of the legs of the shear, the first of which starts at zero [mm or N]."""
        return self.shear or self.shear_force or ()

    @property
    def shear_targets(self) -> list[tuple[float, float]]:
        """Values of the shear at the load steps, before any is halved; empty without shear."""
        if not self.shear_points:
            return []
        if self.shear_path == "along":
            return _shear_legs(self.shear_points, self.steps, self.cycles)
        steps = self.shear_steps or self.steps
        after = _shear_legs(self.shear_points, steps, self.shear_cycles)
        return [(0.0, 0.0)] * (self.steps * self.legs) + after

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
        return self.steps * self.legs + self._shear_count

    @property
    def _shear_count(self) -> int:
        """Number of load steps of a shear that follows the load."""
        if self.shear_path == "along":
            return 0
        return (self.shear_steps or self.steps) * self.shear_cycles * len(self.shear_points)

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

    def control(self, value: float, begun: int = 0) -> Control:
        """Return what a load step to a value of the prescribed quantity prescribes.

        Args:
            value: The value, on the way to a target.
            begun: How many targets are begun, that one included; 0 for a step without shear.
        """
        shear = self._shear_at(value, begun)
        if self.quantity == "force":
            return Control(force=value, tilt=self.slopes, shear=shear)
        return Control(approach=value, tilt=self.slopes, shear=shear)

    def _shear_at(self, value: float, begun: int) -> ShearControl | None:
        """Return the shear on the way to a target: where the load is halved, by as much."""
        if not (begun and self.shear_points):
            return None
        start, end = ([0.0, *self.targets][begun + i] for i in (-1, 0))
        left, right = (np.array([(0.0, 0.0), *self.shear_targets][begun + i]) for i in (-1, 0))
        part = 1.0 if value == end else (value - start) / (end - start)
        x, y = (float(one) for one in left + part * (right - left))
        if self.shear_force is None:
            return ShearControl(shift=(x, y))
        return ShearControl(force=(x, y))

    def shown(self, control: Control) -> Control:
        """Return a control whose approach counts from the zero, as users see it."""
        if control.approach is None:
            return control
        return replace(control, approach=control.approach - self.depth)


def _shear_legs(points: Pairs, steps: int, cycles: int) -> list[tuple[float, float]]:
    """Return the points on the legs of a shear from zero, each of which has some load steps."""
    ends = np.array([(0.0, 0.0), *points * cycles])
    legs = np.linspace(ends[:-1], ends[1:], steps + 1, axis=1)[:, 1:]
    return [(float(x), float(y)) for x, y in legs.reshape(-1, 2)]


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
