"""Stages and shear of a load history, and what loads bodies beside contact and supports.

A stage is gone through in legs: one to its loads or, where it is cyclic, there and back as often as
it says.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple

from patchlaw.support.arguments import Length, Limits, Pressure, Tag, Unit, check_fields
from patchlaw.support.errors import InputError

Rise = Annotated[float, Unit("K")]

Quantity = Literal["approach", "force"]
Repeats = Annotated[int, Limits(ge=1, le=1_000_000)]
Pair = tuple[float, float]
Pairs = tuple[Pair, ...]
_SHEARS = ("shear", "shear_force")
OF_PLANE = ("approach", "force", "pressure", "hold")


@dataclass(frozen=True, slots=True, kw_only=True)
class TractionSection:
    """A face that is loaded by a stress or a pressure.

    Args:
        surface: Physical name or number of the face.
        stress: Force per area along the axes x, y and z of the mesh.
        pressure: Pressure of a fluid on the face, wherever it looks.
    """

    surface: Tag
    stress: tuple[Pressure, Pressure, Pressure] | None = None
    pressure: Pressure | None = None

    def __post_init__(self) -> None:
        if (self.stress is None) == (self.pressure is None):
            raise InputError(
                "a loaded face needs exactly one load", allowed="either 'stress' or 'pressure'"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PretensionSection:
    """A face that bolts pull towards what the body is pressed on.

    Args:
        surface: Physical name or number of the face, such as that of all washers.
        pull: Force of all bolts on the face, along the normal of the contact face.
    """

    surface: Tag
    pull: Annotated[float, Unit("N"), Limits(ge=0)]

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyLoads:
    """What loads a body beside contact and supports.

    Args:
        tractions: Faces that are loaded besides the contact.
        pretension: Faces that bolts pull towards what the body is pressed on. The contact bears
            their pull beside the force on the plane, and supports bear none of it.
        temperature: Rise of the temperature above that without stresses, of the whole body or by
            physical name or number of its volumes, those not named having none. It needs
            ``thermal_expansion``.
    """

    tractions: tuple[TractionSection, ...] = ()
    pretension: tuple[PretensionSection, ...] = ()
    temperature: Rise | dict[str, Rise] | None = None

    @property
    def pull(self) -> float:
        """Pull of all bolts [N]."""
        return sum(one.pull for one in self.pretension)

    @property
    def rises(self) -> dict[str | None, float]:
        """Rises of the temperature by volume; None stands for the whole body [K]."""
        if self.temperature is None:
            return {}
        if isinstance(self.temperature, dict):
            return {name: rise for name, rise in self.temperature.items()}
        return {None: self.temperature}

    def followed_by(self, later: BodyLoads | None) -> BodyLoads:
        """Return the loads once later ones are reached, which replace those of the same faces.

        Args:
            later: The later loads; what they do not state stays as it is.
        """
        if later is None:
            return self
        return replace(
            self,
            tractions=_replaced(self.tractions, later.tractions),
            pretension=_replaced(self.pretension, later.pretension),
            temperature=self.temperature if later.temperature is None else later.temperature,
        )


def _replaced(loads: Sequence[Any], later: Sequence[Any]) -> tuple[Any, ...]:
    """Return loads of faces, with later ones of the same faces instead."""
    faces = {one.surface for one in later}
    return (*(one for one in loads if one.surface not in faces), *later)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """A part of the load history, whose loads are reached evenly from those before it.

    Of the plane it states at most one of ``approach``, ``force``, ``pressure`` and ``hold``;
    without any, what was prescribed before stays as it is, at first a force of zero.

    Args:
        name: What it is called in results; its number when not given.
        approach: Approach of the rigid plane at the end of the stage, counted from ``load.zero``.
        force: Force on the rigid plane at the end of the stage, beside the pull of bolts. It may be
            negative where bolts bear it.
        pressure: The same as a mean pressure on the contact face.
        hold: Whether the plane stays where it is (``approach``), or under the force that it bears
            (``force``), while loads of the body change.
        shear: Shift of the plane along x and y at the end of the stage, from where it first touched
            [mm]. Where no stage before states one it starts from 0; what is not stated stays.
        shear_force: Shear force on the plane along x and y at the end of the stage, likewise [N].
            A history states either shifts or shear forces.
        steps: Load steps to the loads of the stage, and back; ``load.steps`` when not given.
        cycles: How often the loads go to those of the stage and back to those before it; they go
            there and stay when not given.
        body: Loads of the body at the end of the stage; what is not stated, and loads of other
            faces, stay as they are.
        counter_body: The same of the counter-body.
    """

    name: str | None = None
    approach: Length | None = None
    force: Annotated[float, Unit("N")] | None = None
    pressure: Pressure | None = None
    hold: Quantity | None = None
    shear: Annotated[Pairs, Unit("mm", pairs=True)] | None = None
    shear_force: Annotated[Pairs, Unit("N", pairs=True)] | None = None
    steps: Repeats | None = None
    cycles: Repeats | None = None
    body: BodyLoads | None = None
    counter_body: BodyLoads | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        stated = [key for key in OF_PLANE if getattr(self, key) is not None]
        if len(stated) > 1:
            raise InputError(
                f"a stage states {' and '.join(stated)} of the plane",
                allowed=f"at most one of {', '.join(OF_PLANE)}",
            )
        for key in stated_shears(self):
            pairs = getattr(self, key)
            if len(pairs) != 1:
                problem, allowed = "has several points", "one pair; a stage for every other one"
                raise InputError(problem, key=key, value=list(pairs), allowed=allowed)

    @property
    def loads_bodies(self) -> bool:
        """Whether it changes loads of the bodies."""
        return any(one not in (None, BodyLoads()) for one in (self.body, self.counter_body))

    def on_face(self, depth: float, area: float) -> Stage:
        """Return the stage on a contact face: its approach from first touch, no pressure but force.

        Args:
            depth: How far the zero lies below first touch [mm].
            area: Nominal area of the face [mm²].
        """
        approach = None if self.approach is None else self.approach + depth
        force = self.force if self.pressure is None else self.pressure * area
        return replace(self, approach=approach, force=force, pressure=None)


def stated_shears(load: Any) -> list[str]:
    """Return which of ``shear`` and ``shear_force`` a stage, or a load history, states.

    Args:
        load: The stage or history.
    """
    return [key for key in _SHEARS if getattr(load, key) is not None]


class Leg(NamedTuple):
    """A straight way of all loads from one state to another.

    Attributes:
        stage: Index of its stage.
        quantity: What is prescribed of the plane.
        start: Its value at the start [mm or N]; None stands for that under which the plane was when
            the stage began.
        end: Its value at the end; None likewise.
        steps: Number of load steps.
        shear: Shear along x and y at the start, and at the end [mm or N].
        there: Whether the loads go to those of the stage; False where they go back.
    """

    stage: int
    quantity: Quantity
    start: float | None
    end: float | None
    steps: int
    shear: tuple[Pair, Pair]
    there: bool = True

    def reached(self, done: float, now: float) -> tuple[float, Pair]:
        """Return what is prescribed of the plane and of the shear after some load steps.

        Args:
            done: The load steps, which need not be whole.
            now: What the plane had when the stage began.
        """

        def between(start: float, end: float) -> float:
            return end if done == self.steps else start + done * ((end - start) / self.steps)

        start, end = (now if value is None else value for value in (self.start, self.end))
        x, y = map(between, *self.shear)
        return between(start, end), (x, y)


def legs_of(stages: Sequence[Stage], steps: int) -> Iterator[Leg]:
    """Yield the legs of stages.

    Args:
        stages: The stages, without pressures.
        steps: Load steps of a stage that states none.
    """
    quantity: Quantity = "force"
    value: float | None = 0.0  # of the quantity, where it is known beforehand
    shear = (0.0, 0.0)
    for index, stage in enumerate(stages):
        before = quantity
        start, end = value, value
        if stage.hold is not None:
            quantity = stage.hold
        elif stage.approach is not None or stage.force is not None:
            quantity = "force" if stage.approach is None else "approach"
            end = stage.force if stage.approach is None else stage.approach
        if quantity != before:
            start = 0.0 if index == 0 else None
            end = start if stage.hold is not None else end
        sheared = next((getattr(stage, key)[0] for key in stated_shears(stage)), shear)
        there = Leg(index, quantity, start, end, stage.steps or steps, (shear, sheared))
        back = there._replace(start=end, end=start, shear=(sheared, shear), there=False)
        for _ in range(stage.cycles or 1):
            yield there
            if stage.cycles:
                yield back
        value, shear = (start, shear) if stage.cycles else (end, sheared)


def states_of(
    base: BodyLoads, stages: Sequence[BodyLoads | None], lasting: Sequence[bool]
) -> list[BodyLoads]:
    """Return the states of a body's loads: for every stage that before it, and that at its end.

    Args:
        base: The loads before the first stage.
        stages: What each stage states of the body.
        lasting: Whether the loads stay at those of the stage.

    Returns:
        The states, two for every stage; the base alone without stages.
    """
    states, now = [], base
    for stage, stays in zip(stages, lasting, strict=True):
        reached = now.followed_by(stage)
        states += [now, reached]
        now = reached if stays else now
    return states or [base]


@dataclass(frozen=True, kw_only=True)
class ShearPath:
    """The shear that follows a load, or goes along with it.

    Args:
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
    """

    shear: Annotated[Pairs, Unit("mm", pairs=True)] | None = None
    shear_force: Annotated[Pairs, Unit("N", pairs=True)] | None = None
    shear_path: Literal["after", "along"] = "after"
    shear_steps: Repeats | None = None
    shear_cycles: Repeats = 1

    @property
    def stated_shear(self) -> Pairs:
        """Points of the shear as they were stated; none of stages."""
        return self.shear or self.shear_force or ()

    def shear_problems(
        self, stages: Sequence[Stage], turns: Sequence[float]
    ) -> Iterator[InputError]:
        """Yield errors of two shear loads, of what belongs to none, and of senseless paths.

        Args:
            stages: The stages of the load history.
            turns: Turning points of its load; none with stages.
        """
        points, either = self.stated_shear, "either 'shear' or 'shear_force'"
        key = "shear" if self.shear_force is None else "shear_force"
        if len(stated_shears(self)) > 1:
            yield InputError("is a second shear load", key=key, value=points, allowed=either)
        if points and stages:
            allowed = f"'{key}' of a stage"
            yield InputError("does not go beside stages", key=key, value=points, allowed=allowed)
        if len({key for one in stages for key in stated_shears(one)}) > 1:
            yield InputError("state shifts and shear forces", key="stage", allowed=either)
        along = self.shear_path == "along"
        beside = {
            "shear_steps": self.shear_steps is not None,
            "shear_cycles": self.shear_cycles > 1,
        }
        for name, stated in {"shear_path": along, **beside}.items():
            if stated and not points:
                yield InputError("needs 'shear' or 'shear_force'", key=name)
            if stated and along and name in beside:
                problem = "does not go with shear_path = 'along', which has the steps of the load"
                yield InputError(problem, key=name, allowed="leave it out")
        if any(one == other for one, other in pairwise([(0.0, 0.0), *points])):
            problem, allowed = "repeats a point, or starts without shear", "points that differ"
            yield InputError(problem, key=key, value=points, allowed=allowed)
        if points and along and len(points) != len(turns):
            problem = "has another number of points than the load that it goes along with"
            yield InputError(problem, key=key, value=points, allowed=f"{len(turns)} pairs")
        if self.shear_cycles > 1 and len(points) < 2:
            problem, key, allowed = (
                "needs two points of the shear",
                "shear_cycles",
                "a list of pairs, or 1",
            )
            yield InputError(problem, key=key, value=self.shear_cycles, allowed=allowed)
