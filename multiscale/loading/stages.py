"""Stages of a load history, and what loads bodies beside contact and supports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any

from patchlaw.multiscale.loading.path import Quantity
from patchlaw.support.arguments import Length, Limits, Pressure, Tag, Unit, check_fields
from patchlaw.support.errors import InputError

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
