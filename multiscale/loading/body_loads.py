"""What loads the bodies of a scene beside contact and supports: tractions, bolts, temperatures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from support.errors import InputError
from support.fields import Limits, Pressure, Tag, Unit, check_limits

Rise = Annotated[float, Unit("K")]


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
        check_limits(self)


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
