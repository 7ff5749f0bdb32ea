"""The sections of a scene on the method: patches, micro model, coupling, reference, law, output."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from patchlaw.geometry.statistics import LARGEST_SEED
from patchlaw.multiscale.scene.surface import RegionSection
from patchlaw.support.arguments import (
    Count,
    Heights,
    Length,
    Limits,
    PositiveLength,
    PositivePressure,
    changed_fields,
)
from patchlaw.support.errors import InputError

Pair = tuple[Count, Count]
Radius = PositiveLength | Literal["inf"]
Seed = Annotated[int, Limits(ge=0, le=LARGEST_SEED)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchesSection:
    """The partition of the interface.

    Args:
        grid: Numbers of patches along x and y. Laws belong to patches; other couplings gather their
            results by them.
    """

    grid: Pair = (4, 4)


@dataclass(frozen=True, slots=True, kw_only=True)
class MicroSection:
    """The micro model of the rough surface.

    Args:
        model: How contacts are solved: ``half-space`` cell by cell; as elliptic or circular
            summits, with interaction or ``-independent`` of each other (Waddad et al. 2016).
        finite_slopes: Whether the slopes of the roughness, where they are not small, count to
            second order. When not given they do with half-space contacts, unless laws are isolated
            or those of samples. They are refused beyond an rms gradient of 0.8, where that fails.
        cells: Cells along x and y that half-space contacts are solved on, between the heights of a
            map as well; the heights of the surface when not given.
        hardness: Hardness of the softer body, about 2.8 to 3 times its yield strength (Tabor 1951):
            no contact pressure exceeds it, and the interference that it leaves stays as plastic
            depth. Contacts are elastic when not given. It needs half-space contacts.
    """

    model: Literal[
        "elliptic",
        "circular",
        "elliptic-independent",
        "circular-independent",
        "half-space",
    ] = "half-space"
    finite_slopes: bool | None = None
    cells: tuple[Heights, Heights] | None = None
    hardness: PositivePressure | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplingSection:
    """How micro and macro model are put together.

    Args:
        kind: How the force is found: ``concurrent`` solves the whole surface on the block at every
            load step, without laws; ``consistent`` takes all patch laws from such solutions, under
            the tilt of the load (where the plane is free, under the tilt that it takes at each
            approach); ``isolated`` takes every patch's law from what lies in it alone (Waddad et
            al. 2016); ``analytic`` is the micro model alone on a half-space; ``reference`` meshes
            the rough surface itself, see the section reference. An ``accuracy`` chooses it where it
            is not stated: concurrent, consistent where there are more load steps than laws take
            solutions, or reference where neither keeps the accuracy.
        love: Displacement under its own pressure that is subtracted from an isolated patch: the
            mean one, or that at its centre.
        interface: Whether the closure of a law is a mean over each patch, or taken at each point.
        table_tolerance: Interpolation error of the laws, relative to the force; 1e-4 when not
            given, and 2e-3 with micro models that resolve the cells of the surface.
    """

    kind: Literal["isolated", "consistent", "concurrent", "analytic", "reference"] = "consistent"
    love: Literal["mean", "centre"] = "mean"
    interface: Literal["patchwise", "pointwise"] = "patchwise"
    table_tolerance: Annotated[float, Limits(gt=0, lt=0.1)] | None = None

    def __post_init__(self) -> None:
        for statement, key, allowed in self._restrictions():
            value = getattr(self, key)
            if value not in allowed:
                instead = " or ".join(repr(one) for one in allowed if one is not None)
                raise InputError(
                    f"{key} = {value!r} does not go with {statement}",
                    allowed=f"{key} = {instead}" if instead else "leave it out",
                )

    def _restrictions(self) -> Iterator[tuple[str, str, tuple[str | None, ...]]]:
        """Yield a statement of this section, a key, and the values that the key may have then."""
        if self.kind == "analytic":  # ignores what is about patches and finite elements
            return
        kind = f"kind = '{self.kind}'"
        if self.kind != "isolated":
            yield kind, "love", ("mean",)
        if self.kind in ("concurrent", "reference"):  # which have no laws
            yield kind, "interface", ("patchwise",)
            yield kind, "table_tolerance", (None,)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSection:
    """The meshed rough surface of ``coupling.kind = "reference"``; other couplings ignore it.

    Args:
        method: How contact is found, see `macro.UnilateralContactProblem`.
        meshes: Number of meshes of falling size that take the same loads. Their results are
            extrapolated; one mesh alone has no error bar.
        fine: Edge length of the finest tetrahedra where contact can occur; from surface and load
            when not given.
    """

    method: Literal["active-set", "augmented-lagrangian"] = "active-set"
    meshes: Annotated[int, Limits(ge=1, le=3)] = 2
    fine: PositiveLength | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LawSection:
    """What the laws of an interface are made from.

    Args:
        kind: Whether every ``patch`` has the law of its own heights, or a ``representative`` one
            holds at every point of a contact face of any size and outline: that of the surface as a
            periodic sample.
        seeds: Of a spectrum: seeds of several samples. The law is that of their mean, and their
            scatter is reported; the seed of the spectrum when not given.
        samples: Of a ``surface.file``: further maps of the same roughness, read and prepared like
            it. The law is that of the mean of all, and their scatter is reported.
        largest_pressure: Largest pressure at a point of the face that the laws are made for; when
            not given, ten times the mean one, or more on a crowned face. Laws are extended where a
            load step needs it.
        regions: Further faces of the contact, each with a sample of its own.
        crown: Radii of a crowned face along its axes x and y, about its middle; ``"inf"`` is level.
        axes: What the axes x and y of a sample lie along on the face, which a leak depends on:
            those of the face, ``"x"``, as when not given; or, where the lay follows a turned or
            lapped face, ``"polar"``: x along the radius, y around the centre.
        centre: A point on the axis of the part, in coordinates of the mesh, that ``"polar"`` axes
            turn around; the middle of the face's bounding rectangle when not given.
    """

    kind: Literal["patch", "representative"] = "patch"
    seeds: tuple[Seed, ...] = ()
    samples: tuple[str, ...] = ()
    largest_pressure: PositivePressure | None = None
    regions: tuple[RegionSection, ...] = ()
    crown: tuple[Radius, Radius] | None = None
    axes: Literal["x", "polar"] | None = None
    centre: tuple[Length, Length, Length] | None = None

    def __post_init__(self) -> None:
        for key in changed_fields(self) if self.kind == "patch" else ():
            raise InputError(f"'{key}' needs kind = 'representative'", allowed="leave it out")
        if len(set(self.seeds)) < len(self.seeds):
            raise InputError(f"seeds = {list(self.seeds)} has one twice", allowed="different seeds")
        names = [region.surface for region in self.regions]
        if len(set(names)) < len(names):
            raise InputError(f"regions name a face twice: {names}", allowed="each face once")
        if self.centre is not None and self.axes != "polar":
            raise InputError("'centre' is that of polar axes", allowed="axes = 'polar' beside it")

    @property
    def representative(self) -> bool:
        """Whether the law is that of a periodic sample."""
        return self.kind == "representative"


def _load_steps(value: Any) -> Any:
    """Refuse what names no load steps in one sentence, not one for each type that it is not."""
    numbers = isinstance(value, list | tuple) and len(value) > 0
    if numbers and all(type(one) is int and one > 0 for one in value):
        return list(value)
    if isinstance(value, bool) or value in ("last", "all"):
        return value
    raise InputError(
        "does not name load steps",
        allowed="true or false, 'last', 'all', or a list of numbers of load steps, from 1",
    )


_StepNumbers = Annotated[list[Count], Field(min_length=1, description="numbers of load steps")]


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputSection:
    """What is written beside the tables of results.

    Args:
        figures: Whether figures are drawn. "all" adds ``block.png``, which takes about a second:
            the rough block in three dimensions with its contacts and the stresses below them, where
            pressures of cells are known. Half-space contacts have them, with laws where ``contact``
            is written. "svg" writes all of them as SVG too, beside the PNG files.
        report: Whether report.html is written.
        fields: Load steps whose displacements, stresses and contact pressures are written for
            ParaView: "last" (or true), "all", or a list of their numbers.
        check: Load steps whose errors are measured by solving further contact problems, where the
            micro model is ``half-space``; under laws of samples the load step, too, on other
            elements.
        contact: Load steps whose contact is written, with a row for every spot and, where the model
            has cells or nodes, maps of pressure and gap. With "all" the report has a slider over
            the load steps, whose pictures take half a second each. With laws the contact problem
            that they stand for is then solved, once for each of these steps. "auto" is "last"
            without laws and "none" with laws. "none" leaves out the interfacial stiffness as well.
        views: Whether contacts, fields and modes that are written are shown in three dimensions
            too, in pages ``view_*.html`` that the report links, as ``patchlaw view`` does
            afterwards.
    """

    figures: bool | Literal["all", "svg"] = True
    report: bool = True
    fields: Annotated[
        bool | Literal["last", "all"] | _StepNumbers, BeforeValidator(_load_steps)
    ] = False
    check: Literal["last", "none", "all"] = "last"
    contact: Literal["auto", "last", "all", "none"] = "auto"
    views: bool = False

    @property
    def asks_for_contact(self) -> bool:
        """Whether contacts are to be written, whatever the coupling."""
        return self.contact in ("last", "all")

    def wants_fields(self, step: int, *, last: bool) -> bool:
        """Tell whether the fields of a load step are written.

        Args:
            step: Its number.
            last: Whether it is the last one.
        """
        if isinstance(self.fields, list):
            return step in self.fields
        return self.fields == "all" or (last and bool(self.fields))
