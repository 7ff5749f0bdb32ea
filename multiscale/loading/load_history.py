"""Load histories: what scenes prescribe of the rigid plane, and of bodies stage by stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np

from patchlaw.geometry import Control
from patchlaw.geometry.rigid_plane import ShearControl
from patchlaw.geometry.zero import FIRST_TOUCH, Zero
from patchlaw.multiscale.loading.stages import (
    OF_PLANE,
    Leg,
    Quantity,
    Repeats,
    ShearPath,
    Stage,
    legs_of,
    stated_shears,
)
from patchlaw.support.arguments import KEY, Limits, Slope, Unit, check_fields
from patchlaw.support.errors import InputError
from patchlaw.support.quantities import example

Tilt = tuple[Slope, Slope] | Literal["free"]
Plane = tuple[float, float]
"""Approach of the plane [mm], and force of the contact [N]."""


@dataclass(frozen=True, kw_only=True)
class LoadHistory(ShearPath):
    """The motion of the rigid plane: turning points of its approach, or of the force on it.

    Args:
        zero: Height that the approach counts from, here and in all results and laws: ``first
            touch``, the highest point of the surface; ``mean plane``, the mean of its heights; or
            ``quantile 0.001``, the height that 0.1 % of its area exceeds, with any number between 0
            and 1. On measured surfaces one point decides about first touch, and no single one about
            the others. Approaches may be negative there.
        approach: Approach of the rigid plane, counted from ``zero``, or a list of turning points
            [mm]. Exactly one of ``approach``, ``force``, ``pressure`` and ``stage`` is given.
        force: Force on the rigid plane, or a list of turning points [N]. Where the body has a
            ``pretension`` the contact bears its pull besides.
        pressure: The same as mean pressure: force over the nominal area of the contact face [MPa].
        stage: Parts of the load history in turn, each with loads of the plane and of the bodies.
        steps: Load steps to every turning point.
        cycles: How often the plane goes through the turning points, of which it needs two at least.
        tilt: Slopes of the approach along x and y about the middle of the interface; ``free`` lets
            the plane turn until the pressures have no moment beside that of bolts.
        force_change: Largest change of the force in one step, relative to the largest force so far;
            a step that exceeds it is halved. When not given no step is halved.
        depth: How far the zero lies below the highest point of the surface. On a surface, where
            it is known, approaches count from first touch, which this is added for [mm].
        pulls: Pull of bolts before every stage and at its end, in turn, where the bodies are known;
            without stages the pull alone [N].

    Raises:
        InputError: When there is no load or two, or a load history makes no sense.
    """

    zero: str = FIRST_TOUCH
    approach: Annotated[tuple[float, ...], Unit("mm", several=True)] | None = None
    force: Annotated[tuple[float, ...], Unit("N", several=True)] | None = None
    pressure: Annotated[tuple[float, ...], Unit("MPa", several=True)] | None = None
    stage: tuple[Stage, ...] = ()
    steps: Repeats = 8
    cycles: Repeats = 1
    tilt: Tilt = (0.0, 0.0)
    force_change: Annotated[float, Limits(ge=1e-3, lt=1)] | None = None
    depth: float = field(default=0.0, metadata={KEY: None})
    pulls: tuple[float, ...] = field(default=(), metadata={KEY: None})

    def __post_init__(self) -> None:
        check_fields(self)
        try:
            object.__setattr__(self, "zero", Zero(self.zero).name)
        except InputError as error:
            raise error.located(key="zero") from None
        stated = [key for key in _LOADS if getattr(self, key) not in (None, ())]
        for key, (unit, from_zero) in _LOADS.items():
            points = getattr(self, key)
            if unit and points is not None:
                from_zero = from_zero or self.zero == FIRST_TOUCH
                _check_points(points, unit, key, from_zero=from_zero)
        if len(stated) != 1:
            raise InputError(
                "needs exactly one load", allowed="'approach', 'force', 'pressure' or 'stage'"
            )
        if self.cycles > 1 and len(self._stated_points) < 2:
            raise InputError(
                f"cycles = {self.cycles} needs two turning points",
                allowed="a list of loads, or cycles = 1; of a stage, its own cycles",
            )
        for problem in self.shear_problems(self.stage, self._stated_points):
            raise problem

    @property
    def quantity(self) -> Quantity:
        """What is prescribed; of both the force, unless no force that presses is known before."""
        stated = {leg.quantity for leg in self.ways}
        if len(stated) == 1:
            return stated.pop()
        return "force" if self.largest_of("force") > 0.0 else "approach"

    def quantity_in(self, stage: int | None) -> Quantity:
        """Return what is prescribed in a stage.

        Args:
            stage: Its number, from 1; None for a history without stages.
        """
        if stage is None:
            return self.quantity
        return next(leg.quantity for leg in self.ways if leg.stage == stage - 1)

    @property
    def stated(self) -> tuple[str, list[float] | None]:
        """The key of the load, and its turning points as they were stated; None of stages."""
        key = next(key for key in _LOADS if getattr(self, key) not in (None, ()))
        return key, None if self.stage else list(getattr(self, key))

    @property
    def points(self) -> tuple[float, ...]:
        """The quantity's values at the ends of the legs, as far as known beforehand [mm or N].

        Forces are those of the contact: bolts pull besides the force on the plane.
        """
        return self._ends(self.quantity)

    def _ends(self, quantity: Quantity) -> tuple[float, ...]:
        """Return the values of a quantity at the ends of the legs that prescribe it."""
        return tuple(
            leg.end + (self._pull(self._state(leg, 1.0)) if quantity == "force" else 0.0)
            for leg in self.ways
            if leg.quantity == quantity and leg.end is not None
        )

    @property
    def slopes(self) -> tuple[float, float] | None:
        """Slopes of the plane; None lets it turn freely."""
        return None if self.tilt == "free" else self.tilt

    @cached_property
    def ways(self) -> tuple[Leg, ...]:
        """The straight ways between turning points, or through stages."""
        return tuple(legs_of(self.stage or self._turning_points(), self.steps))

    def _turning_points(self) -> list[Stage]:
        """Return turning points of the load, and those of the shear, as stages."""
        key = "force" if self.approach is None else "approach"
        points: list[Any] = [{key: point} for point in self._stated_points]
        pairs: list[Any] = [{self.shear_key: (pair,)} for pair in self.stated_shear]
        if self.shear_path == "along" and pairs:
            points = [point | pair for point, pair in zip(points, pairs, strict=True)]
            pairs = []
        stages = [Stage(**point) for point in points]
        after = [Stage(**pair, steps=self.shear_steps) for pair in pairs]
        return self.cycles * stages + self.shear_cycles * after

    @property
    def _stated_points(self) -> tuple[float, ...]:
        """Turning points as they were stated; none of stages."""
        return self.approach or self.force or self.pressure or ()

    @cached_property
    def shear_key(self) -> str:
        """Whether ``shear`` or ``shear_force`` is prescribed; empty without any."""
        return next((key for one in (self, *self.stage) for key in stated_shears(one)), "")

    @property
    def by_shift(self) -> bool:
        """Whether the shear, where there is one, is prescribed as a shift, and not as a force."""
        return self.shear_key != "shear_force"

    @cached_property
    def _begins(self) -> list[int]:
        """Number of load steps before every leg, and of all."""
        return [0, *(int(count) for count in np.cumsum([leg.steps for leg in self.ways]))]

    @property
    def legs(self) -> int:
        """Number of ways from one turning point to the next."""
        return len(self.ways)

    @property
    def count(self) -> int:
        """Number of load steps, before any is halved."""
        return self._begins[-1]

    @property
    def largest(self) -> float:
        """Largest value of the prescribed quantity that is known beforehand."""
        return self.largest_of(self.quantity)

    def largest_of(self, quantity: Quantity) -> float:
        """Return the largest approach or force that is known beforehand; 0 where none is.

        Args:
            quantity: Which of them.
        """
        return max(self._ends(quantity), default=0.0)

    def key_at(self, time: float) -> str:
        """Return the key of the scene that prescribes the plane at a load step, or before it.

        Args:
            time: The load step, as for `stage_at`.
        """
        leg = self.ways[self._leg_at(time)]
        if not self.stage:
            return f"load.{self.stated[0]}"
        for index in range(leg.stage, -1, -1):
            for key in OF_PLANE:
                if getattr(self.stage[index], key) is not None:
                    return f"load.stage.{index}.{key}"
        return f"load.stage.{leg.stage}"

    @property
    def unloads(self) -> bool:
        """Whether the load falls anywhere, or may fall at some points of a face."""
        if len({leg.quantity for leg in self.ways}) > 1 or any(
            one.hold or one.loads_bodies for one in self.stage
        ):
            return True
        later = self.ways[1:]  # the first way is from first touch, wherever the zero lies
        return any(leg.end < leg.start for leg in later)  # type: ignore[operator]

    @property
    def largest_controls(self) -> list[Control]:
        """What prescribes the largest approach and the largest force, as far as there are any."""
        quantities: tuple[Quantity, Quantity] = ("approach", "force")
        return [
            Control(**{quantity: value}, tilt=self.slopes)  # type: ignore[arg-type]
            for quantity in quantities
            if (value := self.largest_of(quantity)) > 0.0
        ]

    def straight_to(self, control: Control) -> LoadHistory:
        """Return the history of one load step, straight to an approach or a force.

        Args:
            control: What it prescribes.
        """
        tilt: Tilt = "free" if control.tilt is None else control.tilt
        if control.approach is None:
            return LoadHistory(force=(control.force or 0.0,), steps=1, tilt=tilt)
        return LoadHistory(approach=(control.approach,), steps=1, tilt=tilt)

    @property
    def by_turning_points(self) -> LoadHistory:
        """The history with a load step for every leg, through its turning points once."""
        stages = tuple(
            replace(one, steps=1, cycles=None if one.cycles is None else 1) for one in self.stage
        )
        return replace(self, steps=1, cycles=1, force_change=None, stage=stages)

    @property
    def decisive_legs(self) -> set[int]:
        """The legs to the largest load and to the last one; all of stages, once through each."""
        legs, points = range(self.by_turning_points.legs), self.points
        return set(legs) if self.stage else {points.index(self.largest), legs[-1]}

    def control(self, value: float) -> Control:
        """Return what a load step to a value of the prescribed quantity prescribes."""
        if self.quantity == "force":
            return Control(force=value, tilt=self.slopes)
        return Control(approach=value, tilt=self.slopes)

    def stage_at(self, time: float) -> int | None:
        """Return the number of the stage of a load step, from 1; None without stages.

        Args:
            time: The load step, counted from 0 before the first one; between two it is none.
        """
        return self.ways[self._leg_at(time)].stage + 1 if self.stage else None

    def begins_stage(self, time: float) -> bool:
        """Tell whether a stage begins after a load step, counted likewise."""
        leg = self._leg_at(time + 0.5)
        return time == self._begins[leg] and (
            leg == 0 or self.ways[leg].stage != self.ways[leg - 1].stage
        )

    def control_at(self, time: float, origin: Plane = (0.0, 0.0)) -> Control:
        """Return what a load step prescribes.

        Args:
            time: Its number; load steps that were put in between have numbers between.
            origin: The plane when the stage began.
        """
        index = self._leg_at(time)
        leg, done = self.ways[index], time - self._begins[index]
        state = self._state(leg, done / leg.steps)
        pull_before = self._pull(2.0 * leg.stage)
        now = origin[0] if leg.quantity == "approach" else origin[1] - pull_before
        value, pair = leg.reached(done, now)
        shear = None
        if self.shear_key:
            shear = ShearControl(shift=pair) if self.by_shift else ShearControl(force=pair)
        if leg.quantity == "approach":
            return Control(approach=value, tilt=self.slopes, body_state=state, shear=shear)
        force = max(value + self._pull(state), 0.0)  # rounding, of what is checked beforehand
        return Control(force=force, tilt=self.slopes, body_state=state, shear=shear)

    def _leg_at(self, time: float) -> int:
        """Return the index of the leg that a load step is on."""
        return max(int(np.searchsorted(self._begins, time)) - 1, 0)

    def _state(self, leg: Leg, share: float) -> float:
        """Return the position among the states of the bodies' loads."""
        if not self.stage:
            return 0.0
        return 2.0 * leg.stage + (share if leg.there else 1.0 - share)

    def _pull(self, state: float) -> float:
        """Return the pull of bolts at a position among the states of the bodies' loads [N]."""
        if not any(self.pulls):
            return 0.0
        return float(np.interp(state, np.arange(len(self.pulls)), self.pulls))

    def on_face(self, depth: float, area: float, pulls: Sequence[float]) -> LoadHistory:
        """Return the history on a contact face, with approaches from first touch and with forces.

        Args:
            depth: How far the zero lies below the highest point of the surface [mm].
            area: Nominal area of the face [mm²].
            pulls: See the class.

        Raises:
            InputError: When the force that is left for the contact is negative.
        """

        def lowered(points: Sequence[float] | None, by: float) -> tuple[float, ...] | None:
            return None if points is None else tuple(point + by for point in points)

        force = self.force
        if self.pressure is not None:
            force = tuple(pressure * area for pressure in self.pressure)
        stages = tuple(one.on_face(depth, area) for one in self.stage)
        found = replace(
            self,
            approach=lowered(self.approach, depth),
            force=force,
            pressure=None,
            stage=stages,
            depth=depth,
            pulls=tuple(pulls),
        )
        for leg in found.ways if found.stage else ():
            found._check_pulled(leg)
        return found

    def _check_pulled(self, leg: Leg) -> None:
        """Refuse stages whose forces pull the plane off, or whose plane is clear at the start."""
        stage, key = self.stage[leg.stage], f"load.stage.{leg.stage}"
        if leg.quantity == "force" and leg.end is not None:
            pull = self._pull(2.0 * leg.stage + leg.there)
            if leg.end + pull < 0.0:
                raise InputError(
                    "pulls the plane off the surface",
                    key=f"{key}.force",
                    value=leg.end,
                    allowed=f"≥ {-pull:.6g} N, the pull of the bolts",
                )
        if stage.approach is not None and stage.approach < 0.0:
            raise InputError(
                "turns before first touch", key=f"{key}.approach", value=stage.approach - self.depth
            )

    def shown(self, control: Control) -> Control:
        """Return a control whose approach counts from the zero, as users see it."""
        if control.approach is None:
            return control
        return replace(control, approach=control.approach - self.depth)


_LOADS = {
    "approach": ("mm", False),
    "force": ("N", True),
    "pressure": ("MPa", True),
    "stage": ("", False),
}
"""Keys of loads, with the unit of turning points, and whether they never fall below 0."""


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
