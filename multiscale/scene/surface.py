"""The sections of a scene on heights: the surface, that of the other side, those of regions."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, InstanceOf
from pydantic.json_schema import SkipJsonSchema

from patchlaw.geometry.files.content import length_unit
from patchlaw.geometry.preparation import Preparation
from patchlaw.geometry.spring_bed import Coefficient
from patchlaw.geometry.statistics import Spectrum
from patchlaw.support.arguments import (
    Heights,
    Length,
    Limits,
    PositiveLength,
    PositivePressure,
    Tag,
    Unit,
    changed_fields,
)
from patchlaw.support.checks import real_array
from patchlaw.support.errors import InputError


class HeightMap:
    """Heights in memory, equal to others with the same numbers; float64 is not copied.

    Args:
        values: Heights, shape (nx, ny); not a number, or masked, where they are missing.

    Raises:
        InputError: When they are no map of numbers.
    """

    def __init__(self, values: Any) -> None:
        self.values = real_array(values)
        if self.values.ndim != 2:
            raise InputError("is no map of heights", allowed="numbers with an index [ix, iy]")

    @cached_property
    def digest(self) -> str:
        """Shape and SHA-256, which stand for the heights where a scene is written down."""
        content = np.ascontiguousarray(self.values).tobytes()
        return f"{self.values.shape} {self.values.dtype} {hashlib.sha256(content).hexdigest()}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeightMap) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        nx, ny = self.values.shape
        return f"{nx} × {ny} heights"


def _height_map(value: Any) -> Any:
    return value if value is None or isinstance(value, HeightMap) else HeightMap(value)


HeightsInMemory = Annotated[
    SkipJsonSchema[InstanceOf[HeightMap] | None], BeforeValidator(_height_map)
]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceSection(Preparation):
    """Exactly one source of heights, the rectangle it covers, and what is done to the map.

    A map is prepared in this order: ``swap_xy``, ``crop``, ``outliers``, ``detrend``, ``filter``,
    ``missing``, ``resample``.

    Args:
        spectrum: Recipe of a synthesised surface; it needs ``lengths``, and ``grid`` unless an
            ``accuracy`` chooses it.
        file: File of a measured map: .npy, text, .xyz, or an instrument's format. A relative path
            starts in the folder of the scene.
        heights: From Python: an array with index [ix, iy], in mm or in ``height_unit``.
        height_unit: Unit of the heights of a file that does not state one; mm when not given.
        xy_unit: Unit of x and y in a file that is a list of points; mm when not given.
        channel: Name or number, counted from 0, of the channel of a file that has several.
        grid: Numbers of heights along x and y: what a spectrum is sampled on, or what a file must
            have. With an ``accuracy`` a spectrum needs none.
        lengths: Sides of the surface along x and y; needed where a file does not state them.
        periodic: Whether surface and contact continue over the borders; half-space contacts with
            ``coupling.kind = "analytic"`` alone.
    """

    spectrum: Spectrum | None = None
    file: str | None = None
    heights: HeightsInMemory = None
    height_unit: Annotated[str, AfterValidator(length_unit)] | None = None
    xy_unit: Annotated[str, AfterValidator(length_unit)] | None = None
    channel: str | Annotated[int, Limits(ge=0)] | None = None
    grid: tuple[Heights, Heights] | None = None
    lengths: tuple[PositiveLength, PositiveLength] | None = None
    periodic: bool = False

    def __post_init__(self) -> None:
        if sum(source is not None for source in (self.spectrum, self.file, self.heights)) != 1:
            raise InputError(
                "needs exactly one source",
                allowed="either 'spectrum' or 'file'; from Python also 'heights'",
            )
        if self.heights is not None and self.lengths is None:
            raise InputError("'heights' need 'lengths' beside them")
        if self.spectrum is not None and self.lengths is None:
            raise InputError("a 'spectrum' needs 'grid' and 'lengths' beside it")
        maps = "height_unit xy_unit channel swap_xy crop missing outliers resample"
        for key in maps.split():
            if self.spectrum is not None and key in changed_fields(self):
                raise InputError(f"'{key}' needs a 'file'", allowed="leave it out")
        if self.heights is not None and (self.grid, self.channel, self.xy_unit) != (None,) * 3:
            raise InputError(
                "'heights' have their own grid, and no channel nor coordinates", allowed="neither"
            )

    @property
    def lacks_grid(self) -> bool:
        """Whether a spectrum is without a grid, which only an accuracy may choose."""
        return self.spectrum is not None and self.grid is None


@dataclass(frozen=True, slots=True, kw_only=True)
class CounterSurfaceSection(SurfaceSection):
    """Roughness of the other side, and how it lies on the surface.

    Its other keys are those of ``[surface]``.

    Args:
        shift: Way along x and y that it is moved, once it lies on the surface: over the borders of
            a periodic map, or over a map that is larger than the surface.
        rotation: Angle that it is turned by about its middle, from x to y as seen from above,
            before it is moved. Quarters of a turn are exact; others interpolate, on a periodic or
            larger map.
    """

    shift: tuple[Length, Length] = (0.0, 0.0)
    rotation: Annotated[float, Unit("deg")] = 0.0

    @property
    def is_moved(self) -> bool:
        """Whether it is shifted or turned."""
        return any(self.shift) or self.rotation != 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionSection(SurfaceSection):
    """A face with a surface of its own, in the same plane as the contact face.

    Its other keys are those of ``[surface]``.

    Args:
        surface: Physical name or number of the face.
        hardness: Hardness there, as ``micro.hardness``, which holds when not given; ``"inf"`` is
            elastic.
        friction: Coefficient of friction there; ``friction.coefficient`` when not given.
        wear: Coefficient of wear there; that of the section wear when not given.
    """

    surface: Tag
    hardness: PositivePressure | Literal["inf"] | None = None
    friction: Coefficient | None = None
    wear: Annotated[float, Unit("1/MPa"), Limits(ge=0)] | None = None
