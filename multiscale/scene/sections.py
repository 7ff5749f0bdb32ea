"""The sections of a scene on surface, block, patches, micro model and output."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic.json_schema import SkipJsonSchema

from geometry.files.content import LENGTH_UNITS, length_unit
from geometry.preparation import Preparation
from geometry.spectrum import LARGEST_SEED, Spectrum
from multiscale.scene.height_map import HeightsOfArray
from multiscale.scene.quantities import Angle, Length, Pressure, Slope, SpectralAmplitude
from support.errors import InputError, did_you_mean

Auto = Literal["auto"]
"""Value of a key that is left to the plan."""


Number = Annotated[float, Field(strict=True)]
Count = Annotated[int, Field(ge=1, le=1_000_000_000, strict=True)]


NAMES_A_FILE = "names a file"
"""Marks keys whose value is the name of a file that results depend on."""


class Section(BaseModel):
    """A section of a scene: unknown keys are refused, and the text below a key describes it."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @property
    def stated(self) -> set[str]:
        """The keys that were written; of a section that was dumped whole, those that say a thing.

        A dump has every key, so that only values other than the default were written.
        """
        given, fields = self.model_fields_set, type(self).model_fields
        whole = len(given) == len(fields) or given >= {
            name for name in fields if getattr(self, name) is not None
        }
        if not whole:
            return set(given)
        return {
            name
            for name in given
            if getattr(self, name) != fields[name].get_default(call_default_factory=True)
        }


Flag = Annotated[bool, Field(strict=True)]
PositiveLength = Annotated[Length, Field(gt=0)]
Pair = tuple[Count, Count]
Cells = tuple[Count, Count, Count]
Heights = Annotated[int, Field(ge=4, le=1_000_000_000, strict=True)]
"""Number of heights along a side; fewer than four have no cubic interpolant."""

Band = tuple[Number, Number]


class SpectrumSection(Section):
    """A synthesised self-affine surface, see `geometry.Spectrum`."""

    hurst: Annotated[Number, Field(gt=0, le=1)]
    """Hurst exponent of the self-affine roughness, between 0 and 1; 0.8 and more are usual."""
    waves: Band | None = None
    """Smallest and largest number of waves along the side x, of a spectrum that is the same in all
    directions. Either this, or ``waves_x`` and ``waves_y``."""
    waves_x: Band | None = None
    """Smallest and largest number of waves along x, of an anisotropic spectrum."""
    waves_y: Band | None = None
    """Smallest and largest number of waves along y, of an anisotropic spectrum."""
    rms_slope: Annotated[Slope, Field(gt=0)] | None = None
    """Rms gradient of the surface. It is scaled by exactly one of ``rms_slope``, ``rms_height`` and
    ``s0``."""
    rms_height: PositiveLength | None = None
    """Rms height, instead of ``rms_slope``."""
    s0: Annotated[SpectralAmplitude, Field(gt=0)] | None = None
    """Amplitude of the spectrum, instead of ``rms_slope``."""
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED, strict=True)] = 0
    """Number that the random phases follow from; the same number makes the same surface."""

    @model_validator(mode="after")
    def _makes_a_spectrum(self) -> Self:
        self.spectrum()
        return self

    def spectrum(self) -> Spectrum:
        """Return the geometric record."""
        return Spectrum(**self.model_dump())


Interval = tuple[Length, Length]


class CropSection(Section):
    """The rectangle of a map that is kept, rounded to whole cells; all of an axis not given."""

    x: Interval | None = None
    """Where the kept part begins and ends along x; all of it when not given."""
    y: Interval | None = None
    """Where the kept part begins and ends along y; all of it when not given."""


class FilterSection(Section):
    """Cut-off wavelengths of the areal Gaussian filter, ISO 16610-61.

    Half of the amplitude passes at a cut-off.
    """

    short: PositiveLength | None = None
    """S-filter: waves shorter than this are removed."""
    long: PositiveLength | None = None
    """L-filter: waves longer than this are removed."""


class SurfaceSection(Section):
    """Exactly one source of heights, the rectangle it covers, and what is done to the map.

    A map is prepared in this order: ``swap_xy``, ``crop``, ``outliers``, ``missing``, ``detrend``,
    ``filter``, ``resample``.
    """

    grid_is_open: ClassVar[bool] = True
    """Whether a spectrum may be without a grid, for an accuracy to choose it."""

    spectrum: SpectrumSection | None = None
    """Recipe of a synthesised surface; it needs ``lengths``, and ``grid`` unless an ``accuracy``
    chooses it."""
    file: Annotated[str | None, NAMES_A_FILE] = None
    """File of a measured map: .npy, text, .xyz, or an instrument's format. A relative path starts
    in the folder of the scene."""
    heights: SkipJsonSchema[HeightsOfArray] = None
    """From Python: an array with index [ix, iy], in mm or in ``height_unit``."""
    height_unit: str | None = None
    """Unit of the heights of a file that does not state one; mm when not given."""
    channel: str | Annotated[int, Field(ge=0, strict=True)] | None = None
    """Name or number, counted from 0, of the channel of a file that has several."""
    grid: tuple[Heights, Heights] | Auto | None = None
    """Numbers of heights along x and y: what a spectrum is sampled on, or what a file must have.
    With an ``accuracy`` a spectrum needs none."""
    lengths: tuple[PositiveLength, PositiveLength] | None = None
    """Sides of the surface along x and y; needed where a file does not state them."""
    swap_xy: Flag = False
    """Whether x and y of the map are exchanged: rows of a text without sides, and the first index
    of an array, then lie along x. ``lengths``, ``grid`` and ``crop`` are those after it."""
    crop: CropSection = CropSection()
    """The rectangle that is kept, before anything else is done to a map."""
    missing: Literal["refuse", "fill"] = "refuse"
    """What happens to heights that are masked or not a number: ``refuse`` them, or ``fill`` them
    by the smoothest membrane between the others, spikes aside."""
    outliers: Literal["keep", "remove"] = "keep"
    """Whether spikes, and a repeated value that means "no data", are kept, or removed and
    filled."""
    detrend: Literal["none", "mean", "plane", "quadratic"] = "none"
    """Form that is removed from a map: its mean, its mean plane, or its mean quadratic form."""
    filter: FilterSection = FilterSection()
    """Cut-off wavelengths of a Gaussian filter, applied after the form is removed."""
    resample: tuple[Heights, Heights] | None = None
    """Numbers of heights along x and y of a new grid, which a map is brought to at last."""
    periodic: Flag = False
    """Whether surface and contact continue over the borders; half-space contacts with
    ``coupling.kind = "analytic"`` alone."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if sum(source is not None for source in (self.spectrum, self.file, self.heights)) != 1:
            raise ValueError(
                "needs exactly one source (allowed: either 'spectrum' or 'file'; from Python also "
                "'heights')"
            )
        if self.heights is not None and self.lengths is None:
            raise ValueError("'heights' need 'lengths' beside them")
        without_grid = self.grid is None and not self.grid_is_open
        if self.spectrum is not None and (without_grid or self.lengths is None):
            raise ValueError("a 'spectrum' needs 'grid' and 'lengths' beside it")
        fields = type(self).model_fields
        maps = ("height_unit", "channel", "swap_xy", "crop", "missing", "outliers", "resample")
        for key in maps:
            if self.spectrum is not None and getattr(self, key) != fields[key].default:
                raise ValueError(f"'{key}' needs a 'file' (allowed: leave it out)")
        if self.heights is not None and (self.grid, self.channel) != (None, None):
            raise ValueError("'heights' have their own grid, and no channel (allowed: neither)")
        if self.file is not None and self.grid == "auto":
            raise ValueError(
                "grid = 'auto' needs a 'spectrum' (allowed: the grid of the file, or leave it out)"
            )
        if self.height_unit is not None:
            try:
                length_unit(self.height_unit)
            except InputError:
                hint = did_you_mean(self.height_unit, LENGTH_UNITS, cutoff=1.0)
                raise ValueError(
                    f"height_unit = '{self.height_unit}' is no unit of heights{hint} "
                    f"(allowed: {', '.join(LENGTH_UNITS)})"
                ) from None
        return self

    @property
    def lacks_grid(self) -> bool:
        """Whether a spectrum is sampled on a grid that only an accuracy decides."""
        return self.spectrum is not None and self.grid is None

    @property
    def preparation(self) -> Preparation:
        """What is done to the map."""
        return Preparation(
            swap_xy=self.swap_xy,
            crop=(self.crop.x, self.crop.y),
            missing=self.missing,
            outliers=self.outliers,
            form=self.detrend,
            short=self.filter.short,
            long=self.filter.long,
            resample=self.resample,
        )


class CounterSurfaceSection(SurfaceSection):
    """Roughness of the other side, and how it lies on the surface.

    Its other keys are those of ``[surface]``.
    """

    grid_is_open: ClassVar[bool] = False

    shift: tuple[Length, Length] = (0.0, 0.0)
    """Way along x and y that it is moved, once it lies on the surface: over the borders of a
    periodic map, or over a map that is larger than the surface."""
    rotation: Angle = 0.0
    """Angle that it is turned by about its middle, from x to y as seen from above, before it is
    moved. Quarters of a turn are exact; others interpolate, on a periodic or larger map."""

    @property
    def is_moved(self) -> bool:
        """Whether it is shifted or turned."""
        return any(self.shift) or self.rotation != 0.0


class BlockSection(Section):
    """The elastic block below the surface, pressed by a rigid plane.

    ``cells`` and the keys after it describe the mesh of the block with a flat top. That mesh is
    made where patch laws need it (``coupling.compliance = "finite-element"``) and for fields
    (``output.fields``); nothing else depends on it.
    """

    height: PositiveLength | None = None
    """Height of the block; the shorter side of the surface when not given."""
    lengths: tuple[PositiveLength, PositiveLength] | None = None
    """Sides of the contact face along x and y under a law of a sample
    (``law.kind = "representative"``); otherwise they are those of the surface."""
    young_modulus: Annotated[Pressure, Field(gt=0)]
    """Young's modulus of the block."""
    poisson_ratio: Annotated[Number, Field(gt=-1, lt=0.5)]
    """Poisson's ratio of the block."""
    sides: Literal["free", "roller"] = "free"
    """Whether the four sides of the block are free, or held by rollers that let them slide."""
    cells: Cells | Auto | None = None
    """Cells of the block's mesh along x, y and z; as many as its use needs when not given."""
    element: Literal["Q1", "Q2", "P1", "P2"] = "Q1"
    """Element of the block's mesh: hexahedra Q or tetrahedra P, linear or quadratic."""
    grading: Annotated[Number, Field(ge=1, le=1e6)] = 1.0
    """Height of the lowest layer of cells over that of the highest."""
    margin: Annotated[Length, Field(ge=0)] = 0.0
    """Width of the block beyond the rough interface, on all four sides."""
    margin_cells: Count = 8
    """Cells of the mesh across the margin."""
    margin_grading: Annotated[Number, Field(ge=1, le=1e6)] = 8.0
    """Width of the outermost cells of the margin over that of the innermost."""

    def height_under(self, lengths: tuple[float, float]) -> float:
        """Return the height of the block under a surface of given sides [mm]."""
        return min(lengths) if self.height is None else self.height


class PatchesSection(Section):
    """The partition of the interface."""

    grid: Pair | Auto = (4, 4)
    """Numbers of patches along x and y. Laws belong to patches; other couplings gather their
    results by them."""


class MicroSection(Section):
    """The micro model of the rough surface."""

    model: Literal[
        "elliptic",
        "circular",
        "elliptic-independent",
        "circular-independent",
        "half-space",
    ] = "half-space"
    """How contacts are solved: ``half-space`` cell by cell; as elliptic or circular summits, with
    interaction or ``-independent`` of each other (Waddad et al. 2016)."""
    solver: Literal["active-set", "truncated-newton"] = "active-set"
    """Solver of interacting summits."""
    finite_slopes: Flag | None = None
    """Whether the slopes of the roughness, where they are not small, count to second order. When
    not given they do with half-space contacts, unless laws are isolated or those of samples. They
    are refused beyond an rms gradient of 0.8, where that fails."""
    hardness: Annotated[Pressure, Field(gt=0)] | None = None
    """Hardness of the softer body, about 2.8 to 3 times its yield strength (Tabor 1951): no contact
    pressure exceeds it, and what it leaves of the overlap stays as plastic depth. Contacts are
    elastic when not given. It needs half-space contacts."""


class OutputSection(Section):
    """What is written beside the tables of results."""

    figures: Flag | Literal["all"] = True
    """Whether figures are drawn. "all" adds ``block.png``, which takes about a second: the rough
    block in three dimensions with its contacts and the stresses below them, where pressures of
    cells are known. Half-space contacts have them, with laws where ``contact`` is written."""
    report: Flag = True
    """Whether report.html is written."""
    fields: (
        Flag
        | Literal["last", "all"]
        | Annotated[list[Count], Field(min_length=1, description="numbers of load steps")]
    ) = False
    """Load steps whose displacements, stresses and contact pressures are written for ParaView:
    "last" (or true), "all", or a list of their numbers."""
    check: Literal["last", "none", "all"] = "last"
    """Load steps whose errors are measured by solving further contact problems, where the micro
    model is ``half-space``."""
    contact: Literal["auto", "last", "all", "none"] = "auto"
    """Load steps whose contact is written, with a row for every spot and, where the model has cells
    or nodes, maps of pressure and gap. With laws the contact problem that they stand for is then
    solved, once for each of these steps. "auto" is "last" without laws and "none" with laws. "none"
    leaves out the interfacial stiffness as well."""

    @field_validator("fields", mode="before")
    @classmethod
    def _names_load_steps(cls, value: Any) -> Any:
        """Refuse anything else in one sentence, not one for each type that it is not."""
        numbers = isinstance(value, list | tuple) and len(value) > 0
        if numbers and all(type(one) is int and one > 0 for one in value):
            return list(value)
        if isinstance(value, bool) or value in ("last", "all"):
            return value
        raise ValueError(
            "does not name load steps (allowed: true or false, 'last', 'all', or a list of numbers "
            "of load steps, from 1)"
        )

    def wants_fields(self, step: int, *, last: bool) -> bool:
        """Tell whether the fields of a load step are written.

        Args:
            step: Its number.
            last: Whether it is the last one.
        """
        if isinstance(self.fields, list):
            return step in self.fields
        return self.fields == "all" or (last and bool(self.fields))
