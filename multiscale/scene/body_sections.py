"""The sections of a scene on bodies from a mesh, the body on the other side, and kinds of laws."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from geometry.materials import Material
from geometry.spectrum import LARGEST_SEED
from multiscale.scene.quantities import Length, Pressure
from multiscale.scene.sections import NAMES_A_FILE, Number, PositiveLength, Section, SurfaceSection

Tag = str | Annotated[int, Field(ge=0, strict=True)]
"""Physical name or number of a face in a mesh."""
Component = Length | Literal["free"]
Radius = PositiveLength | Literal["inf"]
Seed = Annotated[int, Field(ge=0, le=LARGEST_SEED, strict=True)]


class MaterialSection(Section):
    """Elastic constants."""

    young_modulus: Annotated[Pressure, Field(gt=0)]
    """Young's modulus."""
    poisson_ratio: Annotated[Number, Field(gt=-1, lt=0.5)]
    """Poisson's ratio."""

    @property
    def material(self) -> Material:
        """The material."""
        return Material(young_modulus=self.young_modulus, poisson_ratio=self.poisson_ratio)


class SupportSection(Section):
    """A face that is held."""

    grid_is_open: ClassVar[bool] = False

    surface: Tag
    """Physical name or number of the face."""
    displacement: tuple[Component, Component, Component] = (0.0, 0.0, 0.0)
    """Displacement along the axes x, y and z of the mesh; ``"free"`` leaves a component free."""


class TractionSection(Section):
    """A face that is loaded."""

    grid_is_open: ClassVar[bool] = False

    surface: Tag
    """Physical name or number of the face."""
    stress: tuple[Pressure, Pressure, Pressure]
    """Force per area along the axes x, y and z of the mesh."""


class CounterBodySection(Section):
    """The elastic body on the other side; a rigid plane without this section.

    With elastic constants alone it is a half-space. With a mesh it is a second body, whose contact
    face lies opposite to that of the first one, in the same plane; the meshes need not match. Its
    supports move with the approach.
    """

    mesh: Annotated[str | None, NAMES_A_FILE] = None
    """File of the mesh, gmsh's .msh or .xdmf, with named or numbered faces. A relative path starts
    in the folder of the scene. Without it the body is a half-space."""
    mesh_unit: Literal["mm", "m", "um", "inch"] = "mm"
    """Unit of the mesh's coordinates."""
    contact: Tag | None = None
    """Physical name or number of the planar face that is in contact."""
    element: Literal["linear", "quadratic"] = "linear"
    """Degree of the displacements."""
    supports: tuple[SupportSection, ...] = ()
    """Faces that are held; together they leave no rigid motion."""
    materials: dict[str, MaterialSection] = Field(default_factory=dict)
    """Elastic constants by physical name or number of the volumes; instead of these, one material
    for the whole body."""
    tractions: tuple[TractionSection, ...] = ()
    """Faces that are loaded besides the contact, by loads that stay while the plane approaches."""
    young_modulus: Annotated[Pressure, Field(gt=0)] | None = None
    """Young's modulus of the whole body."""
    poisson_ratio: Annotated[Number, Field(gt=-1, lt=0.5)] | None = None
    """Poisson's ratio of the whole body."""

    @model_validator(mode="after")
    def _is_a_body(self) -> Self:
        alone = (self.young_modulus, self.poisson_ratio)
        stated = sum(value is not None for value in alone)
        if stated == 1 or (stated == 2) == bool(self.materials):
            raise ValueError(
                "needs the elastic constants of the body once (allowed: young_modulus and "
                "poisson_ratio; or, of a mesh, materials by volume)"
            )
        if self.mesh is None:
            meshed = sorted(self.stated - {"young_modulus", "poisson_ratio"})
            if meshed:
                raise ValueError(
                    f"'{meshed[0]}' needs a 'mesh' (allowed: a mesh; or young_modulus and "
                    "poisson_ratio alone, of a half-space)"
                )
            return self
        if self.contact is None or not self.supports:
            missing = "supports" if self.contact is not None else "contact"
            raise ValueError(f"a 'mesh' needs '{missing}' beside it (allowed: names of its faces)")
        return self

    @property
    def whole_material(self) -> Material | None:
        """The material of the whole body; None where volumes have their own."""
        if self.young_modulus is None or self.poisson_ratio is None:
            return None
        return Material(young_modulus=self.young_modulus, poisson_ratio=self.poisson_ratio)

    @property
    def faces(self) -> set[str | int]:
        """All faces that are named."""
        held = {one.surface for one in self.supports}
        loaded = {one.surface for one in self.tractions}
        return held | loaded if self.contact is None else held | loaded | {self.contact}


class BodySection(CounterBodySection):
    """The elastic body below the surface, from a mesh, instead of ``[block]``."""

    mesh: Annotated[str, NAMES_A_FILE]
    """File of the mesh, gmsh's .msh or .xdmf, with named or numbered faces. A relative path starts
    in the folder of the scene."""
    contact: Tag
    """Physical name or number of the planar face that is in contact."""
    place: tuple[Length, Length] | None = None
    """Lower corner of the surface's rectangle in the coordinates of the contact face, which count
    from the lower corner of its bounding rectangle; in the middle of the face when not given."""


class RegionSection(SurfaceSection):
    """A face with a surface of its own, in the same plane as the contact face.

    Its other keys are those of ``[surface]``.
    """

    grid_is_open: ClassVar[bool] = False

    surface: Tag
    """Physical name or number of the face."""


class LawSection(Section):
    """What the laws of an interface are made from."""

    kind: Literal["patch", "representative"] = "patch"
    """Whether every ``patch`` has the law of its own heights, or a ``representative`` one holds at
    every point of a contact face of any size and outline: that of the surface as a periodic sample.
    """
    seeds: tuple[Seed, ...] = ()
    """Of a spectrum: seeds of several samples. The law is that of their mean, and their scatter is
    reported; the seed of the spectrum when not given."""
    largest_pressure: Annotated[Pressure, Field(gt=0)] | None = None
    """Largest pressure at a point of the face that the laws are made for; when not given, ten times
    the mean one, or more on a crowned face. Laws are extended where a load step needs it."""
    regions: tuple[RegionSection, ...] = ()
    """Further faces of the contact, each with a sample of its own."""
    crown: tuple[Radius, Radius] | None = None
    """Radii of a crowned face along its axes x and y, about its middle; ``"inf"`` is level."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.kind == "patch":
            for key in ("seeds", "largest_pressure", "regions", "crown"):
                if getattr(self, key):
                    raise ValueError(
                        f"'{key}' needs kind = 'representative' (allowed: leave it out)"
                    )
        if len(set(self.seeds)) < len(self.seeds):
            raise ValueError(f"seeds = {list(self.seeds)} has one twice (allowed: different seeds)")
        names = [region.surface for region in self.regions]
        if len(set(names)) < len(names):
            raise ValueError(f"regions name a face twice: {names} (allowed: each face once)")
        return self

    @property
    def representative(self) -> bool:
        """Whether the law is that of a periodic sample."""
        return self.kind == "representative"
