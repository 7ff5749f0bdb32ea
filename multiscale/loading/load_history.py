"""Load histories: what scenes prescribe of the rigid plane, and of bodies stage by stage."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np

from patchlaw.geometry import ShearControl
from patchlaw.geometry.surface import FIRST_TOUCH, Zero
from patchlaw.multiscale.loading.path import (
    Distances,
    Pairs,
    Path,
    Quantity,
    Repeats,
    Stage,
    Step,
    check_sliding,
    stated_shears,
)
from patchlaw.support import (
    Array,
    InputError,
    Limits,
    Slope,
    Unit,
    changed_fields,
    check_fields,
    located,
)
from patchlaw.support.quantities import example

_MOST_STEPS = 10_000_000
"""Load steps that may be written out, in 3 GB."""
_OF_SHEAR = {"shear", "shear_force", "shear_path", "shear_steps", "shear_cycles"}
Tilt = tuple[Slope, Slope] | Literal["free"]
ForceChange = Annotated[float, Limits(ge=1e-3, lt=1)]


@dataclass(frozen=True, kw_only=True)
class LoadHistory:
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
        shear: Shift of the plane along x and y from where it first touched, or a list of turning
            points [mm]. Exactly one of ``shear`` and ``shear_force`` may be given, with a
            coefficient of friction. A history of stages states it in them.
        shear_force: Shear force on the plane along x and y, or a list of turning points [N].
        shear_path: Whether the plane goes through the points of the shear ``after`` the load has
            come to its end, which then stays, or ``along`` with the load: each of them is then
            reached together with one of the load's turning points.
        shear_steps: Load steps to every point of a shear that follows the load; ``steps`` when not
            given.
        shear_cycles: How often the plane goes through the points of a shear that follows the load,
            of which it needs two at least.
        sliding: Distance that the surfaces have slid on each other under the load at its end, or a
            list of such distances, each with a load step [mm]. A history of stages states it in
            them.

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
    force_change: ForceChange | None = None
    shear: Annotated[Pairs, Unit("mm", pairs=True)] | None = None
    shear_force: Annotated[Pairs, Unit("N", pairs=True)] | None = None
    shear_path: Literal["after", "along"] = "after"
    shear_steps: Repeats | None = None
    shear_cycles: Repeats = 1
    sliding: Distances | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        with located(key="zero"):
            object.__setattr__(self, "zero", Zero(self.zero).name)
        for key, (unit, _, from_zero) in LOADS.items():
            if (points := getattr(self, key)) is not None:
                from_zero = from_zero or self.zero == FIRST_TOUCH
                _check_points(points, unit, key, from_zero=from_zero)
        if len(self._stated_keys) != 1:
            raise InputError(
                "needs exactly one load", allowed="'approach', 'force', 'pressure' or 'stage'"
            )
        if self.cycles > 1 and len(self.stated[1]) < 2:
            raise InputError(
                f"cycles = {self.cycles} needs two turning points",
                allowed="a list of loads, or cycles = 1; of a stage, its own cycles",
            )
        if self.stage or _OF_SHEAR & {*changed_fields(self)}:
            self._check_shear()
        check_sliding(self.sliding)
        if self.stage and self.stage[0].only_slides:
            problem, allowed = "slides before anything presses", "a stage with a load before it"
            raise InputError(problem, key="stage.0.sliding", allowed=allowed)
        if self.sliding and self.stage:
            problem, allowed = "does not go beside stages", "'sliding' of a stage"
            raise InputError(problem, key="sliding", value=list(self.sliding), allowed=allowed)

    def _check_shear(self) -> None:
        """Refuse two shear loads, what belongs to none, and senseless paths."""
        points, either = self.stated_shear, "either 'shear' or 'shear_force'"
        key = "shear" if self.shear_force is None else "shear_force"
        along, count, cycles = self.shear_path == "along", len(self.stated[1]), "shear_cycles"
        beside = [
            one for one in ("shear_path", "shear_steps", cycles) if one in changed_fields(self)
        ]
        at_once = "does not go with shear_path = 'along', which has the steps of the load"
        same = any(one == other for one, other in pairwise([(0.0, 0.0), *points]))
        of_stages = {name for one in self.stage for name in stated_shears(one)}
        for wrong, name, problem, allowed in (
            (len(stated_shears(self)) > 1, key, "is a second shear load", either),
            (points and self.stage, key, "does not go beside stages", f"'{key}' of a stage"),
            (len(of_stages) > 1, "stage", "state shifts and shear forces", either),
            *((not points, one, "needs 'shear' or 'shear_force'", "") for one in beside),
            *((along, one, at_once, "leave it out") for one in beside if one != "shear_path"),
            (same, key, "repeats a point, or starts without shear", "points that differ"),
            (
                points and along and len(points) != count,
                key,
                "has another number of points than the load that it goes along with",
                f"{count} pairs",
            ),
            (
                self.shear_cycles > 1 and len(points) < 2,
                cycles,
                "needs two points of the shear",
                "a list of pairs, or 1",
            ),
        ):
            if wrong:
                value = {} if name == "stage" else {"value": getattr(self, name)}
                raise InputError(problem, key=name, allowed=allowed or None, **value)

    @property
    def stated(self) -> tuple[str, list[float]]:
        """The key of the load, and its turning points as they were stated; none of stages."""
        key = self._stated_keys[0]
        return key, [] if self.stage else list(getattr(self, key))

    @property
    def _stated_keys(self) -> list[str]:
        return [key for key in (*LOADS, "stage") if getattr(self, key) not in (None, ())]

    @property
    def stated_shear(self) -> Pairs:
        """Points of the shear as they were stated; none of stages."""
        return self.shear or self.shear_force or ()

    @property
    def slides(self) -> bool:
        """Whether the surfaces slide on each other."""
        return bool(self.sliding) or any(one.sliding for one in self.stage)

    @property
    def slopes(self) -> tuple[float, float] | None:
        """Slopes of the plane; None lets it turn freely."""
        return None if self.tilt == "free" else self.tilt

    @cached_property
    def shear_key(self) -> str:
        """Whether ``shear`` or ``shear_force`` is prescribed; empty without any."""
        return next((key for one in (self, *self.stage) for key in stated_shears(one)), "")

    @property
    def _ways(self) -> list[tuple[int, Stage]]:
        """Stages or turning points, those of the shear too, each with the number of its cycle."""
        if self.stage:
            return [(1, stage) for stage in self.stage]
        key, points = self.stated
        loads: list[Any] = [{key: point} for point in points]
        pairs: list[Any] = [{self.shear_key: (pair,)} for pair in self.stated_shear]
        if self.shear_path == "along" and pairs:
            loads = [load | pair for load, pair in zip(loads, pairs, strict=True)]
            pairs = []
        sheared = [Stage(**pair, steps=self.shear_steps) for pair in pairs]
        turning = [Stage(**load) for load in loads]
        slides = [Stage(sliding=self.sliding)] if self.sliding else []
        return [
            (cycle, stage)
            for cycles, stages in (
                (self.cycles, turning),
                (self.shear_cycles, sheared),
                (1, slides),
            )
            for cycle in range(1, cycles + 1)
            for stage in stages
        ]

    @property
    def count(self) -> int:
        """Number of load steps, before any is halved."""
        return sum(
            (one.steps or self.steps) * one.ways * (not one.only_slides) + len(one.sliding or ())
            for _, one in self._ways
        )

    @property
    def expected_count(self) -> int:
        """Number of load steps as far as it is known before the run, halved ones included."""
        ways = sum(one.ways for _, one in self._ways)
        return max(self.count, math.ceil(ways / (self.force_change or math.inf)))

    @property
    def outline(self) -> Path:
        """The turning points as they are stated, once through every cycle."""
        return self._outline(1.0)

    def _outline(self, area: float) -> Path:
        stages = tuple(replace(one, steps=1, cycles=one.cycles and 1) for one in self.stage)
        once = replace(self, steps=1, cycles=1, shear_steps=None, shear_cycles=1, stage=stages)
        return once.path(area=area)

    @property
    def unloads(self) -> bool:
        """Whether the load falls anywhere, or may fall at some points of a face.

        Between a pressure and a force only a face can tell, see `unloads_on`.
        """
        return self.unloads_on(None)

    def unloads_on(self, area: float | None) -> bool:
        """Return whether the load falls anywhere on a face, or may fall at some points of it.

        Args:
            area: Nominal area of the face [mm²]; None does not compare pressures with forces.
        """
        path = self._outline(area or 1.0)
        if self.cycles > 1 or len({step.quantity for step in path}) > 1:
            return True
        if any(one.hold or one.loads_bodies for one in self.stage):
            return True
        # the first way is from first touch, wherever the zero lies
        return any(
            after.value < step.value
            for step, after in pairwise(path)
            if area is not None or _is_pressure(step) == _is_pressure(after)
        )

    def path(
        self, depth: float = 0.0, area: float | None = None, pulls: Sequence[float] = (0.0,)
    ) -> Path:
        """Return the load steps on a contact face, with approaches from first touch.

        Args:
            depth: How far the zero lies below the highest point of the surface [mm].
            area: Nominal area of the face [mm²]; needed of pressures.
            pulls: Pull of bolts before every stage and at its end, in turn; without stages the pull
                alone [N].

        Raises:
            InputError: When a pressure is stated and no area is, or there are too many steps.
        """
        if self.count > _MOST_STEPS:
            problem, allowed = f"makes {self.count} load steps", f"at most {_MOST_STEPS} of them"
            raise InputError(problem, key="load.steps", value=self.steps, allowed=allowed)
        steps: list[Step] = []
        quantity: Quantity = "force"
        value: float | None = 0.0  # of the quantity, where it is known beforehand
        number, state, shear, key = None, 0.0, (0.0, 0.0), f"load.{self.stated[0]}"
        slid = 0.0
        for index, (cycle, stage) in enumerate(self._ways):
            before, start, count = quantity, value, stage.steps or self.steps
            name, stated, end = stage.load(depth, area)
            quantity = stated or quantity
            if quantity != before:
                start = None if index else 0.0
            end = start if end is None else end
            sheared = next((getattr(stage, one)[0] for one in stated_shears(stage)), shear)
            if self.stage:
                number, state = index + 1, 2.0 * index
                key = f"load.stage.{index}.{name}" if name or not index else key
            begin = *_carried(start), *shear, state
            ends = np.array([begin, (*_carried(end), *sheared, state + bool(self.stage))])
            for way in range(0 if stage.only_slides else stage.ways):
                first, last = ends[::-1] if way % 2 else ends
                rows = np.linspace(first, last, count + 1)[1:]
                if quantity == "force" and any(pulls):
                    _add_pulls(rows, pulls, pulls[int(state)])
                known: dict[str, Any] = {"key": key.rstrip("."), "stage": number, "slid": slid}
                steps += [self._step(quantity, row, **known) for row in rows.tolist()]
                if cycle == 1 and way < 2:
                    steps[-1] = replace(steps[-1], turns=True)
            distances, at = stage.sliding or (), f"stage.{index}." if self.stage else ""
            for far in distances:
                known = {"stage": number, "key": f"load.{at}sliding", "turns": far == distances[-1]}
                steps.append(replace(steps[-1], slid=slid + far, **known))
            slid = steps[-1].slid
            value, shear = (start, shear) if stage.cycles else (end, sheared)
        return Path(steps)

    def _step(self, quantity: Quantity, row: Sequence[float], **known: Any) -> Step:
        """Return a step to a load, with its share that is carried, a shear and a body state."""
        load, carried, x, y, state = row
        known[quantity] = load
        if self.shear_key:
            pair: Any = {"shift" if self.shear_key == "shear" else "force": (x, y)}
            known["shear"] = ShearControl(**pair)
        return Step(carried=carried, tilt=self.slopes, body_state=state, **known)


def _is_pressure(step: Step) -> bool:
    return step.key.endswith("pressure")


def _add_pulls(rows: Array, pulls: Sequence[float], carried: float) -> None:
    """Add the pull of bolts to forces of load steps, whose last column is their body state."""
    pulled = np.interp(rows[:, -1], np.arange(len(pulls)), pulls)
    rows[:, 0] += pulled - rows[:, 1] * carried
    rows[np.abs(rows[:, 0]) < 1e-12 * max(pulls), 0] = 0.0  # rounding


def _carried(value: float | None) -> tuple[float, float]:
    """Return a load as a known part, and as a share of that where the stage began."""
    return (0.0, 1.0) if value is None else (value, 0.0)


LOADS = {
    "approach": ("mm", "an approach", False),
    "force": ("N", "a force", True),
    "pressure": ("MPa", "a mean pressure", True),
}
"""Keys of loads, with their unit, their words, and whether they never fall below 0."""


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
