"""The sections of a scene on bodies: the block, and bodies from meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

from patchlaw.geometry.materials import Material, PoissonRatio
from patchlaw.geometry.meshes.block import BlockMeshing, Element
from patchlaw.multiscale.loading.path import BodyLoads
from patchlaw.support.arguments import (
    Count,
    Density,
    Length,
    Limits,
    PositiveLength,
    PositivePressure,
    Tag,
    Unit,
    changed_fields,
    part_of,
)
from patchlaw.support.errors import InputError

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
            young_modulus=self.young_modulus,
            poisson_ratio=self.poisson_ratio,
            density=self.density,
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
