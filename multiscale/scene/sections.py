"""The sections of a scene on surface, block, patches, micro model and output."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from geometry.spectrum import LARGEST_SEED, Spectrum
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


class SurfaceSection(Section):
    """Exactly one source of heights, and the rectangle it covers.

    ``missing``: what is done with heights of a file that are not a number. They are refused, or
    filled by the smoothest membrane between the others, see `geometry.missing.filled`.
    """

    spectrum: SpectrumSection | None = None
    file: str | None = None
    grid: Annotated[tuple[Heights, Heights], Field(description="heights in x, y")] | Auto | None = (
        None
    )
    lengths: tuple[PositiveLength, PositiveLength] | None = None
    detrend: Literal["none", "mean", "plane", "quadratic"] = "none"
    missing: Literal["refuse", "fill"] = "refuse"

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.spectrum is None) == (self.file is None):
            raise ValueError("needs exactly one source (allowed: either 'spectrum' or 'file')")
        if self.spectrum is not None and (self.grid is None or self.lengths is None):
            raise ValueError("a 'spectrum' needs 'grid' and 'lengths' beside it")
        if self.file is None and self.missing == "fill":
            raise ValueError("missing = 'fill' needs a 'file' (allowed: leave it out)")
        if self.file is not None and self.grid == "auto":
            raise ValueError(
                "grid = 'auto' needs a 'spectrum' (allowed: the grid of the file, or leave it out)"
            )
        return self


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
    ] = "elliptic"
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
    """

    figures: Flag = True
    report: Flag = True
    fields: Flag = False
    check: Literal["last", "none", "all"] = "last"
