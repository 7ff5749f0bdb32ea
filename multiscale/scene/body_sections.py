"""The sections of a scene on blocks, bodies from meshes, rough surfaces, and regions of laws."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, InstanceOf
from pydantic.json_schema import SkipJsonSchema

from patchlaw.geometry import Material, Preparation, Spectrum
from patchlaw.geometry.files.content import length_unit
from patchlaw.geometry.materials import PoissonRatio
from patchlaw.geometry.meshes.block import BlockMeshing, Element
from patchlaw.geometry.spring_bed import Coefficient
from patchlaw.multiscale.loading.path import BodyLoads
from patchlaw.support import (
    Count,
    Density,
    Heights,
    InputError,
    Length,
    Limits,
    PositiveLength,
    PositivePressure,
    Tag,
    Unit,
    changed_fields,
    part_of,
    real_array,
)

Cells = tuple[Count, Count, Count]
Component = Length | Literal["free"]
Expansion = Annotated[float, Unit("1/K")]


@dataclass(frozen=True, kw_only=True)
class BlockSection(Material, BlockMeshing):
    """The elastic block below the surface, pressed by a rigid plane.

    ``cells`` and the keys after it describe the mesh of the block with a flat top. That mesh is
    made where patch laws need it (isolated ones, laws at points and laws with friction) and for
    fields (``output.fields``); nothing else depends on it.

    Args:
        height: Height of the block; the shorter side of the surface when not given.
        lengths: Sides of the contact face along x and y under a law of a sample (``law.kind =
            "representative"``); otherwise they are those of the surface.
        young_modulus: Young's modulus of the block.
        poisson_ratio: Poisson's ratio of the block.
        density: Density of the block, which vibrations ask for.
        sides: Whether the four sides of the block are free, or held by rollers that let them slide.
        cells: Cells of the block's mesh along x, y and z; as many as its use needs when not given.
    """

    height: PositiveLength | None = None
    lengths: tuple[PositiveLength, PositiveLength] | None = None
    sides: Literal["free", "roller"] = "free"
    cells: Cells | None = None
    element: Element = "Q1"
    margin_grading: Annotated[float, Limits(ge=1, le=1e6)] = 8.0

    @property
    def material(self) -> Material:
        """The material."""
        return Material(**part_of(self, Material))

    def height_under(self, lengths: tuple[float, float]) -> float:
        """Return the height of the block under a surface of given sides [mm]."""
        return min(lengths) if self.height is None else self.height


@dataclass(frozen=True, slots=True, kw_only=True)
class SupportSection:
    """A face that is held.

    Args:
        surface: Physical name or number of the face.
        displacement: Displacement along the axes x, y and z of the mesh; ``"free"`` leaves a
            component free.
    """

    surface: Tag
    displacement: tuple[Component, Component, Component] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class VolumeSection(Material):
    """The material of a volume.

    Args:
        young_modulus: Young's modulus.
        poisson_ratio: Poisson's ratio.
        density: Density, which vibrations ask for.
        thermal_expansion: Coefficient of linear thermal expansion.
    """

    thermal_expansion: Expansion = 0.0

    @property
    def elastic(self) -> Material:
        """Its elastic constants."""
        return Material(**part_of(self, Material))


@dataclass(frozen=True, slots=True, kw_only=True)
class CounterBodySection(BodyLoads):
    """The elastic body on the other side; a rigid plane without this section.

    With elastic constants alone it is a half-space. With a mesh it is a second body, whose contact
    face lies opposite to that of the first one, in the same plane; the meshes need not match. Its
    supports move with the approach. Its other keys are those of the loads of a body.

    Args:
        mesh: File of the mesh, gmsh's .msh or .xdmf, with named or numbered faces. A relative path
            starts in the folder of the scene. Without it the body is a half-space.
        mesh_unit: Unit of the mesh's coordinates.
        contact: Physical name or number of the planar face that is in contact.
        element: Degree of the displacements.
        refinements: How often every cell of the mesh is cut into eight, at the middles of its
            straight edges.
        supports: Faces that are held; together they leave no rigid motion.
        materials: Elastic constants by physical name or number of the volumes; instead of these,
            one material for the whole body.
        young_modulus: Young's modulus of the whole body.
        poisson_ratio: Poisson's ratio of the whole body.
        density: Density of the whole body, which vibrations ask for.
        thermal_expansion: Coefficient of linear thermal expansion of the whole body.
    """

    mesh: str | None = None
    mesh_unit: Literal["mm", "m", "um", "inch"] = "mm"
    contact: Tag | None = None
    element: Literal["linear", "quadratic"] = "linear"
    refinements: Annotated[int, Limits(ge=0, le=6)] = 0
    supports: tuple[SupportSection, ...] = ()
    materials: dict[str, VolumeSection] = field(default_factory=dict)
    young_modulus: PositivePressure | None = None
    poisson_ratio: PoissonRatio | None = None
    density: Density | None = None
    thermal_expansion: Expansion | None = None

    def __post_init__(self) -> None:
        if self.thermal_expansion is not None and self.materials:
            raise InputError(
                "is that of the whole body, which has materials by volume",
                key="thermal_expansion",
                value=self.thermal_expansion,
                allowed="thermal_expansion of each of the materials",
            )
        self.check_expands(self)
        alone = (self.young_modulus, self.poisson_ratio)
        stated = sum(value is not None for value in alone)
        if stated == 1 or (stated == 2) == bool(self.materials):
            raise InputError(
                "needs the elastic constants of the body once",
                allowed="young_modulus and poisson_ratio; or, of a mesh, materials by volume",
            )
        if self.mesh is None:
            self._check_half_space()
        elif self.contact is None or not self.supports:
            missing = "supports" if self.contact is not None else "contact"
            raise InputError(f"a 'mesh' needs '{missing}' beside it", allowed="names of its faces")

    def _check_half_space(self) -> None:
        """Refuse what is about a mesh."""
        for name in sorted({*changed_fields(self)} - {"young_modulus", "poisson_ratio"}):
            raise InputError(
                f"'{name}' needs a 'mesh'",
                allowed="a mesh; or young_modulus and poisson_ratio alone, of a half-space",
            )

    @property
    def without_density(self) -> str:
        """The key of a density that is missing; empty where the whole body has one."""
        if not self.materials:
            return "" if self.density else "density"
        bare = [name for name, one in self.materials.items() if one.density is None]
        return f"materials.{bare[0]}.density" if bare else ""

    @property
    def is_loaded(self) -> bool:
        """Whether loads, or supports that move, deform the body without contact."""
        moved = any(part not in ("free", 0.0) for one in self.supports for part in one.displacement)
        return moved or bool(self.tractions or self.pretension or any(self.rises.values()))

    @property
    def expansions(self) -> dict[str | None, float]:
        """Coefficients of thermal expansion by volume; None stands for the whole body [1/K]."""
        if self.materials:
            return {name: one.thermal_expansion for name, one in self.materials.items()}
        return {} if self.thermal_expansion is None else {None: self.thermal_expansion}

    def check_expands(self, loads: BodyLoads, key: str = "temperature") -> None:
        """Refuse temperatures of what does not expand.

        Args:
            loads: Loads of the body.
            key: Key of their temperature.

        Raises:
            InputError: When nothing, or no volume of the name, expands.
        """
        for name, rise in loads.rises.items():
            named = name is not None and self.materials
            known = name in self.materials if named else any(self.expansions.values())
            if rise and not known:
                raise InputError(
                    f"changes nothing{'' if name is None else f' in {name!r}'}, which does not "
                    "expand",
                    key=key,
                    value=loads.temperature,
                    allowed="with thermal_expansion beside it, or of one of the materials",
                )

    @property
    def whole_material(self) -> Material | None:
        """The material of the whole body; None where volumes have their own."""
        if self.young_modulus is None or self.poisson_ratio is None:
            return None
        return Material(
            young_modulus=self.young_modulus, poisson_ratio=self.poisson_ratio, density=self.density
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySection(CounterBodySection):
    """The elastic body below the surface, from a mesh, instead of ``[block]``.

    Args:
        mesh: File of the mesh, gmsh's .msh or .xdmf, with named or numbered faces. A relative path
            starts in the folder of the scene.
        contact: Physical name or number of the planar face that is in contact.
        place: Lower corner of the surface's rectangle in the coordinates of the contact face, which
            count from the lower corner of its bounding rectangle; in the middle of the face when
            not given.
        first_axis: Direction in the mesh that the first axis of the contact face has, where it is
            made perpendicular to the normal: that of x, or of y where the face looks along x, when
            not given.
    """

    mesh: str
    contact: Tag
    place: tuple[Length, Length] | None = None
    first_axis: tuple[float, float, float] | None = None


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
    wear: Annotated[float, Unit("1/MPa", zero=True), Limits(ge=0)] | None = None
