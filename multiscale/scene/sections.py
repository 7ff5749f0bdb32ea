"""The sections of a scene on surface, block, patches, micro model and output."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.json_schema import SkipJsonSchema

from geometry.errors import InputError
from geometry.files.content import LENGTH_UNITS, length_unit
from geometry.preparation import Preparation
from geometry.spectrum import LARGEST_SEED, Spectrum
from multiscale.scene.height_map import HeightsOfArray
from multiscale.scene.quantities import Length, Pressure, Slope, SpectralAmplitude

Auto = Literal["auto"]
"""Value of a key that is left to the plan."""


Number = Annotated[float, Field(strict=True)]
Count = Annotated[int, Field(ge=1, le=1_000_000_000, strict=True)]


class Section(BaseModel):
    """A section of a scene: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Flag = Annotated[bool, Field(strict=True)]
PositiveLength = Annotated[Length, Field(gt=0)]
Pair = Annotated[tuple[Count, Count], Field(description="x, y")]
Cells = Annotated[tuple[Count, Count, Count], Field(description="cells in x, y, z")]
Heights = Annotated[int, Field(ge=4, le=1_000_000_000, strict=True)]
"""Number of heights along a side; fewer than four have no cubic interpolant."""

Band = Annotated[tuple[Number, Number], Field(description="lower, upper number of waves per side")]


class SpectrumSection(Section):
    """A synthesised self-affine surface; see `geometry.Spectrum` for the meaning of each key."""

    hurst: Annotated[Number, Field(gt=0, le=1)]
    waves: Band | None = None
    waves_x: Band | None = None
    waves_y: Band | None = None
    rms_slope: Annotated[Slope, Field(gt=0)] | None = None
    rms_height: PositiveLength | None = None
    s0: Annotated[SpectralAmplitude, Field(gt=0)] | None = None
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED, strict=True)] = 0

    @model_validator(mode="after")
    def _makes_a_spectrum(self) -> Self:
        self.spectrum()
        return self

    def spectrum(self) -> Spectrum:
        """Return the geometric record."""
        return Spectrum(**self.model_dump())


Interval = Annotated[tuple[Length, Length], Field(description="from, to")]


class CropSection(Section):
    """The rectangle of a map that is kept, rounded to whole cells; all of an axis not given."""

    x: Interval | None = None
    y: Interval | None = None


class FilterSection(Section):
    """Cut-off wavelengths of the areal Gaussian filter, ISO 16610-61.

    Waves shorter than ``short`` (S-filter) and longer than ``long`` (L-filter) are removed; half of
    the amplitude passes at a cut-off.
    """

    short: PositiveLength | None = None
    long: PositiveLength | None = None


class SurfaceSection(Section):
    """Exactly one source of heights, the rectangle it covers, and what is done to the map.

    From Python, ``heights`` may be an array with index [ix, iy], in mm or in ``height_unit``.

    Of a file: ``height_unit`` is the unit of its heights where the file does not state one, mm when
    not given; ``channel`` the name or number of a channel, counted from 0.

    ``grid`` is what a spectrum is sampled on, or what the file must have, ``lengths`` its sides,
    needed where the file does not state them.

    A map is prepared in this order: ``crop``; ``missing``, heights that are not a number are
    refused, or filled by the smoothest membrane between the others, see `geometry.missing.filled`;
    ``outliers``, spikes are removed and filled; ``detrend``, its form is removed; ``filter``;
    ``resample``, the numbers of heights on a new grid.

    ``periodic``: whether surface and contact continue over the borders, on a half-space.
    """

    spectrum: SpectrumSection | None = None
    file: str | None = None
    heights: SkipJsonSchema[HeightsOfArray] = None
    height_unit: str | None = None
    channel: str | Annotated[int, Field(ge=0, strict=True)] | None = None
    grid: Annotated[tuple[Heights, Heights], Field(description="heights in x, y")] | Auto | None = (
        None
    )
    lengths: tuple[PositiveLength, PositiveLength] | None = None
    crop: CropSection = CropSection()
    missing: Literal["refuse", "fill"] = "refuse"
    outliers: Literal["keep", "remove"] = "keep"
    detrend: Literal["none", "mean", "plane", "quadratic"] = "none"
    filter: FilterSection = FilterSection()
    resample: tuple[Heights, Heights] | None = None
    periodic: Flag = False

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if sum(source is not None for source in (self.spectrum, self.file, self.heights)) != 1:
            raise ValueError(
                "needs exactly one source (allowed: either 'spectrum' or 'file'; from Python also "
                "'heights')"
            )
        if self.heights is not None and self.lengths is None:
            raise ValueError("'heights' need 'lengths' beside them")
        if self.spectrum is not None and (self.grid is None or self.lengths is None):
            raise ValueError("a 'spectrum' needs 'grid' and 'lengths' beside it")
        fields = type(self).model_fields
        for key in ("height_unit", "channel", "crop", "missing", "outliers", "resample"):
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
                raise ValueError(
                    f"height_unit = '{self.height_unit}' is no unit of heights "
                    f"(allowed: {', '.join(LENGTH_UNITS)})"
                ) from None
        return self

    @property
    def preparation(self) -> Preparation:
        """What is done to the map."""
        return Preparation(
            crop=(self.crop.x, self.crop.y),
            missing=self.missing,
            outliers=self.outliers,
            form=self.detrend,
            short=self.filter.short,
            long=self.filter.long,
            resample=self.resample,
        )


class BlockSection(Section):
    """The elastic block below the surface, pressed by a rigid plane.

    Its ``height`` is the shorter side of the surface when not given.

    ``cells`` and the keys after it describe the mesh of the block with a flat top. That mesh is
    made where patch laws need it (``coupling.compliance = "finite-element"``) and for fields
    (``output.fields``); nothing else depends on it.
    """

    height: PositiveLength | None = None
    young_modulus: Annotated[Pressure, Field(gt=0)]
    poisson_ratio: Annotated[Number, Field(gt=-1, lt=0.5)]
    sides: Literal["free", "roller"] = "free"
    cells: Cells | Auto | None = None
    element: Literal["Q1", "Q2", "P1", "P2"] = "Q1"
    grading: Annotated[Number, Field(ge=1, le=1e6, description="bottom to top layer height")] = 1.0
    margin: Annotated[Length, Field(ge=0, description="block beyond the interface")] = 0.0
    margin_cells: Count = 8
    margin_grading: Annotated[Number, Field(ge=1, le=1e6)] = 8.0

    def height_under(self, lengths: tuple[float, float]) -> float:
        """Return the height of the block under a surface of given sides [mm]."""
        return min(lengths) if self.height is None else self.height


class PatchesSection(Section):
    """The partition of the interface."""

    grid: Pair | Auto = (4, 4)


class MicroSection(Section):
    """The micro model of the rough surface.

    ``model = "auto"`` takes the cheapest model whose expected error of the force is below
    ``tolerance`` at the largest load and at half of it, and measures that error at one load. By
    default the tolerance is the share of the scene's accuracy that is left for the micro model, or
    2 %. It holds for the micro model of the whole surface, not for what isolated laws leave out.
    """

    model: Literal[
        "elliptic",
        "circular",
        "elliptic-independent",
        "circular-independent",
        "islands",
        "half-space",
        "auto",
    ] = "half-space"
    tolerance: Annotated[Number, Field(gt=0, lt=0.5)] | None = None
    solver: Literal["active-set", "truncated-newton"] = "active-set"
    curvature: Literal["summit", "contact"] = "summit"
    finite_slopes: Flag | None = None
    border: Literal["ignore", "include"] = "ignore"

    @model_validator(mode="after")
    def _chooses_or_states(self) -> Self:
        if self.model != "auto" and self.tolerance is not None:
            raise ValueError("'tolerance' needs model = 'auto' (allowed: leave it out)")
        stated = (self.solver, self.curvature, self.border)
        if self.model == "auto" and stated != ("active-set", "summit", "ignore"):
            raise ValueError(
                "'solver', 'curvature' and 'border' are chosen by model = 'auto' "
                "(allowed: leave them out)"
            )
        return self


class OutputSection(Section):
    """What is written beside the tables of results.

    ``check``: the load steps whose errors are measured by solving further contact problems, where
    the micro model is ``half-space``.

    ``contact``: the load steps whose contact is written, with a row for every spot and, where the
    model has cells or nodes, maps of pressure and gap. With laws the contact problem that they
    stand for is then solved, once for each of these steps; "auto" is "last" without laws and writes
    none with laws. "none" leaves out the interfacial stiffness as well.
    """

    figures: Flag = True
    report: Flag = True
    fields: Flag = False
    check: Literal["last", "none", "all"] = "last"
    contact: Literal["auto", "last", "all", "none"] = "auto"
