"""A path of loads: what every load step prescribes, one after another, and stages of a history.

`LoadHistory.path` writes turning points, cycles and stages out into one; in Python a list of steps
such as ``[Step(force=1.0), Step(force=2.0)]`` will do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Literal

from patchlaw.geometry import Control, ShearControl
from patchlaw.support import (
    Count,
    Distance,
    InputError,
    Length,
    Limits,
    Pressure,
    Slope,
    Tag,
    Unit,
    check_fields,
)

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
    slid: Distance = 0.0
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


Rise = Annotated[float, Unit("K")]

Repeats = Annotated[int, Limits(ge=1, le=1_000_000)]
Pair = tuple[float, float]
Pairs = tuple[Pair, ...]
Distances = Annotated[tuple[float, ...], Unit("mm", several=True)]
_SHEARS = ("shear", "shear_force")
_OF_PLANE = ("approach", "force", "pressure", "hold")


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
    pull: Annotated[float, Unit("N", zero=True), Limits(ge=0)]

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
        sliding: Distance that the surfaces slide on each other once the loads of the stage are
            reached, or a list of such distances, each with a load step [mm]. A stage without loads
            slides under those before it.
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
    sliding: Distances | None = None
    steps: Repeats | None = None
    cycles: Repeats | None = None
    body: BodyLoads | None = None
    counter_body: BodyLoads | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        stated = [key for key in _OF_PLANE if getattr(self, key) is not None]
        if len(stated) > 1:
            raise InputError(
                f"a stage states {' and '.join(stated)} of the plane",
                allowed=f"at most one of {', '.join(_OF_PLANE)}",
            )
        check_sliding(self.sliding)
        if self.sliding and self.cycles:
            problem, allowed = "does not go with cycles", "a stage of its own, after the cycles"
            raise InputError(problem, key="sliding", value=list(self.sliding), allowed=allowed)
        for key in stated_shears(self):
            pairs = getattr(self, key)
            if len(pairs) != 1:
                problem, allowed = "has several points", "one pair; a stage for every other one"
                raise InputError(problem, key=key, value=list(pairs), allowed=allowed)

    @property
    def only_slides(self) -> bool:
        """Whether it states nothing but what slides."""
        loads = (*_OF_PLANE, *_SHEARS, "body", "counter_body")
        return self.sliding is not None and all(getattr(self, key) is None for key in loads)

    @property
    def loads_bodies(self) -> bool:
        """Whether it changes loads of the bodies."""
        return any(one not in (None, BodyLoads()) for one in (self.body, self.counter_body))

    def load(self, depth: float, area: float | None) -> tuple[str, Quantity | None, float | None]:
        """Return what it states of the plane: the key, what is prescribed, and its end.

        Args:
            depth: How far the zero lies below first touch, from which the end is counted [mm].
            area: Nominal area of the contact face [mm²]; needed of a pressure, whose force it is.

        Raises:
            InputError: When a pressure is stated and no area.
        """
        if self.hold is not None:
            return "hold", self.hold, None
        if self.approach is not None:
            return "approach", "approach", self.approach + depth
        if self.force is not None:
            return "force", "force", self.force
        if self.pressure is None:
            return "", None, None
        if area is None:
            raise InputError("needs a face", key="pressure", value=self.pressure, allowed="force")
        return "pressure", "force", self.pressure * area

    @property
    def ways(self) -> int:
        """How often the loads go to those of the stage, or back."""
        return 2 * self.cycles if self.cycles else 1


def check_sliding(slid: Sequence[float] | None) -> None:
    """Refuse distances that do not grow.

    Args:
        slid: The distances [mm]; None without any.

    Raises:
        InputError: When the first is not greater than 0, or another than the one before.
    """
    if slid is not None and (not slid or any(b <= a for a, b in pairwise((0.0, *slid)))):
        allowed = "a distance such as '100 m', or a list of growing ones"
        raise InputError("does not grow", key="sliding", value=list(slid), allowed=allowed)


def stated_shears(load: Any) -> list[str]:
    """Return which of ``shear`` and ``shear_force`` a stage, or a load history, states.

    Args:
        load: The stage or history.
    """
    return [key for key in _SHEARS if getattr(load, key) is not None]


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
