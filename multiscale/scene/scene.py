"""The scene: everything a run needs to know, read from TOML and checked before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from geometry.spectrum import LARGEST_SEED, Spectrum
from multiscale.scene.auto_values import Open, OrAuto
from multiscale.scene.files import override, read_scene_file
from multiscale.scene.quantities import Length, Pressure, Slope, SpectralAmplitude
from multiscale.scene.sections import (
    Count,
    CouplingSection,
    LoadSection,
    Number,
    ReferenceSection,
    Section,
)
from multiscale.scene.validation_errors import first_refusal

Flag = Annotated[bool, Field(strict=True)]
PositiveLength = Annotated[Length, Field(gt=0)]
Pair = Annotated[tuple[Count, Count], Field(description="x, y")]
Heights = Annotated[
    int, Field(ge=4, le=1_000_000_000, strict=True)
]  # fewer have no cubic interpolant
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

    ``missing``: heights of a file that are not a number are refused, or filled by the smoothest
    membrane between the others, see `geometry.missing.filled`.
    """

    spectrum: SpectrumSection | None = None
    file: str | None = None
    grid: (
        Annotated[
            tuple[Heights, Heights] | Open,
            OrAuto(tuple[Heights, Heights]),
            Field(description="heights in x, y"),
        ]
        | None
    ) = None
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
    """The elastic block below the interface, pressed by a rigid plane.

    Its ``height`` is the shorter side of the surface when not given.

    ``cells`` and the keys after it are about the mesh of the flat block, which is made under laws
    (``coupling.compliance = "finite-element"``) and for fields (``output.fields``); nothing else
    depends on it.
    """

    height: PositiveLength | None = None
    young_modulus: Annotated[Pressure, Field(gt=0)]
    poisson_ratio: Annotated[Number, Field(gt=-1, lt=0.5)]
    sides: Literal["free", "roller"] = "free"
    cells: (
        Annotated[
            tuple[Count, Count, Count] | Open,
            OrAuto(tuple[Count, Count, Count]),
            Field(description="cells in x, y, z of the mesh under laws and of fields"),
        ]
        | None
    ) = None
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

    grid: Annotated[Pair | Open, OrAuto(Pair)] = (4, 4)


class MicroSection(Section):
    """The micro model that gives the laws.

    ``model = "auto"`` takes the cheapest whose expected error of the force is below ``tolerance``
    (by default what the scene's accuracy leaves for it, or 2 %) at the largest load and half of it,
    and checks it at one load. The promise is about the micro model of the whole surface, not about
    what isolated laws leave out.
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
    """What is told of the results, and written beside the tables.

    ``check``: the load steps whose errors are measured by further contact problems, where the
    micro model is ``half-space``.
    """

    figures: Flag = True
    report: Flag = True
    fields: Flag = False
    check: Literal["last", "none", "all"] = "last"


class Scene(Section):
    """A complete scene. Lengths in mm, pressures in MPa.

    The section ``[load]`` is the attribute `loading`, for `Scene.load` reads a file.

    ``accuracy`` is the error of the force that may be left. Of ``surface.grid``, ``micro.model``,
    ``coupling.kind``, ``patches.grid`` and, under laws on a mesh, ``block.cells``, those that are
    ``"auto"`` become what is predicted to keep it at the least cost; with an accuracy so do those
    that are not stated. Without one, ``"auto"`` means 2 %.
    """

    accuracy: Annotated[Number, Field(gt=0, lt=0.5)] | None = None
    surface: SurfaceSection
    block: BlockSection
    patches: PatchesSection = PatchesSection()
    micro: MicroSection = MicroSection()
    coupling: CouplingSection = CouplingSection()
    reference: ReferenceSection = ReferenceSection()
    loading: Annotated[LoadSection, Field(alias="load")]
    output: OutputSection = OutputSection()
    _source: Path | None = None

    @classmethod
    def load(cls, path: str | Path, overrides: Sequence[str] = ()) -> Scene:
        """Read and check a scene file.

        Args:
            path: TOML file.
            overrides: ``key=value`` strings with dotted keys; a value is TOML, or else a plain
                string (``load.approach=4 um``).

        Raises:
            InputError: When the file cannot be read or anything in it is wrong.
        """
        path = Path(path)
        data = read_scene_file(path)
        for text in overrides:
            override(data, text)
        return cls.from_dict(data, source=path)

    @classmethod
    def from_dict(cls, data: dict[str, Any], source: Path | None = None) -> Scene:
        """Check a scene given as nested dictionaries.

        Args:
            data: The sections, as in a scene file.
            source: The file they came from: named in errors; relative paths start in its folder.

        Raises:
            InputError: When anything is wrong; names file, key, value and what is allowed.
        """
        try:
            scene = cls.model_validate(data)
        except ValidationError as error:
            raise first_refusal(error, cls).located(file=str(source) if source else None) from None
        scene._source = source
        return scene

    @property
    def name(self) -> str:
        """Name of the scene: its file's stem."""
        return self._source.stem if self._source else "scene"

    @property
    def file(self) -> str | None:
        """The file the scene was read from."""
        return str(self._source) if self._source else None

    @property
    def surface_path(self) -> Path | None:
        """Path of the heights, relative paths taken from the scene's folder."""
        if self.surface.file is None:
            return None
        folder = self._source.parent if self._source else Path()
        return folder / self.surface.file
