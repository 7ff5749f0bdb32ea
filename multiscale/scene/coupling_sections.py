"""The sections of a scene on coupling, reference and load."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from geometry.zero import ALLOWED, FIRST_TOUCH, Zero
from multiscale.loading.stepper import LoadHistory
from multiscale.scene.quantities import Approaches, Forces, Length, Tilt, check_from_zero
from multiscale.scene.sections import Cells, Number, Section
from support.errors import InputError


def _zero(name: str) -> str:
    try:
        return Zero(name).name
    except InputError:
        problem = f"is no height that approaches count from (allowed: {ALLOWED})"
        raise ValueError(problem) from None


ZeroName = Annotated[str, Field(strict=True), AfterValidator(_zero)]


class CouplingSection(Section):
    """How micro and macro model are put together."""

    kind: Literal["isolated", "consistent", "concurrent", "analytic", "reference", "auto"] = (
        "consistent"
    )
    """How the force is found: ``concurrent`` solves the whole surface on the block at every load
    step, without laws; ``consistent`` takes all patch laws from such solutions, under the tilt of
    the load (where the plane is free, under the tilt that it takes at each approach); ``isolated``
    takes every patch's law from what lies in it alone (Waddad et al. 2016); ``analytic`` is the
    micro model alone on a half-space; ``reference`` meshes the rough surface itself, see the
    section reference; ``auto`` is concurrent, consistent where there are more load steps than laws
    take solutions, or reference where neither keeps the scene's accuracy."""
    compliance: Literal["auto", "finite-element", "decomposed"] = "auto"
    """Compliance of the block under its patches: ``finite-element`` takes it from a mesh with a
    flat top; ``decomposed`` adds few smooth modes of the finite body to the exact half-space. Auto
    is decomposed, except for isolated laws and for laws at points."""
    newton: Literal["auto", "condensed", "full"] = "auto"
    """How laws find the load steps: ``condensed`` solves for the patches alone, with a compliance
    computed once; ``full`` for all displacements of the mesh. Auto is what takes fewer multigrid
    cycles, counted from patches and load steps."""
    love: Literal["mean", "centre"] = "mean"
    """Displacement under its own pressure that is subtracted from an isolated patch: the mean one,
    or that at its centre."""
    interface: Literal["patchwise", "pointwise"] = "patchwise"
    """Whether the closure of a law is a mean over each patch, or taken at each point."""
    table_tolerance: Annotated[Number, Field(gt=0, lt=0.1)] | None = None
    """Interpolation error of the laws, relative to the force; 1e-4 when not given, and 5e-4 with
    micro models that resolve the cells of the surface."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for statement, key, allowed in self._restrictions():
            value = getattr(self, key)
            if value not in allowed:
                instead = " or ".join(repr(one) for one in allowed if one is not None)
                raise ValueError(
                    f"{key} = {value!r} does not go with {statement} "
                    f"(allowed: {f'{key} = {instead}' if instead else 'leave it out'})"
                )
        return self

    def _restrictions(self) -> Iterator[tuple[str, str, tuple[str | None, ...]]]:
        """Yield a statement of this section, a key, and the values that the key may have then."""
        if self.kind == "analytic":  # ignores what is about patches and finite elements
            return
        kind = f"kind = '{self.kind}'"
        if self.kind != "isolated":
            yield kind, "love", ("mean",)
        if self.kind in ("concurrent", "reference"):  # which have no laws
            block = ("auto", "decomposed") if self.kind == "concurrent" else ("auto",)
            yield kind, "compliance", block
            yield kind, "newton", ("auto",)
            yield kind, "interface", ("patchwise",)
            yield kind, "table_tolerance", (None,)
        if self.interface == "pointwise":
            yield "interface = 'pointwise'", "compliance", ("auto", "finite-element")
            yield "interface = 'pointwise'", "newton", ("auto", "full")
        if self.compliance == "decomposed":
            yield "compliance = 'decomposed'", "newton", ("auto", "condensed")

    @property
    def decomposed(self) -> bool:
        """Whether the block is the half-space and modes of the finite body.

        The kind ``auto`` becomes consistent or concurrent, which do not differ in this.
        """
        if self.kind in ("analytic", "concurrent", "reference"):
            return self.kind == "concurrent"
        if self.compliance != "auto":
            return self.compliance == "decomposed"
        return self.kind != "isolated" and self.interface != "pointwise" and self.newton != "full"

    @property
    def on_mesh(self) -> bool:
        """Whether laws lie on finite elements of the block, plain or condensed."""
        return self.kind in ("isolated", "consistent", "auto") and not self.decomposed


class ReferenceSection(Section):
    """The meshed rough surface of ``coupling.kind = "reference"``; other couplings ignore it."""

    method: Literal["active-set", "augmented-lagrangian"] = "active-set"
    """How contact is found, see `macro.UnilateralContactProblem`."""
    mesh: Literal["auto", "hexahedra", "tetrahedra"] = "auto"
    """Cells: ``tetrahedra`` are small only where contact can occur, ``hexahedra`` are as many as
    ``cells`` says. Auto is tetrahedra, unless ``cells`` is stated."""
    meshes: Annotated[int, Field(ge=1, le=3, strict=True)] = 2
    """Number of meshes of falling size that take the same loads. Their results are extrapolated;
    one mesh alone has no error bar."""
    fine: Annotated[Length, Field(gt=0)] | None = None
    """Edge length of the finest tetrahedra where contact can occur; from surface and load when not
    given."""
    cells: Cells | None = None
    """Hexahedra of the finest mesh along x, y and z; their element and grading are those of the
    block."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.mesh == "hexahedra" and self.cells is None:
            raise ValueError(
                "mesh = 'hexahedra' needs cells (allowed: cells along x, y, z; or 'tetrahedra')"
            )
        if self.mesh == "tetrahedra" and self.cells is not None:
            raise ValueError(
                "cells does not go with mesh = 'tetrahedra' (allowed: fine; or mesh = 'hexahedra')"
            )
        if self.fine is not None and self.cells is not None:
            raise ValueError(
                f"fine = {self.fine:g} mm, of tetrahedra, does not go with cells, of hexahedra "
                "(allowed: one of them)"
            )
        return self

    @property
    def sizes_are_open(self) -> bool:
        """Whether the size of the meshes is left to surface, load and accuracy."""
        return self.fine is None and not self.hexahedral

    @property
    def hexahedral(self) -> bool:
        """Whether the meshes are of hexahedra."""
        return self.cells is not None


class LoadSection(Section):
    """The motion of the rigid plane: turning points of its approach, or of the force on it."""

    zero: ZeroName = FIRST_TOUCH
    """Height that the approach counts from, here and in all results and laws: ``first touch``, the
    highest point of the surface; ``mean plane``, the mean of its heights; or ``quantile 0.001``,
    the height that 0.1 % of its area exceeds, with any number between 0 and 1. On measured surfaces
    one point decides about first touch, and no single one about the others. Approaches may be
    negative there."""
    approach: Approaches | None = None
    """Approach of the rigid plane, counted from ``zero``, or a list of turning points. Exactly one
    of ``approach`` and ``force`` is given."""
    force: Forces | None = None
    """Force on the rigid plane, or a list of turning points."""
    steps: Annotated[int, Field(ge=1, le=1_000_000, strict=True)] = 8
    """Load steps to every turning point."""
    cycles: Annotated[int, Field(ge=1, le=1_000_000, strict=True)] = 1
    """How often the plane goes through the turning points, of which it needs two at least."""
    tilt: Tilt = (0.0, 0.0)
    """Slopes of the approach along x and y about the middle of the interface; ``free`` lets the
    plane turn until the pressures have no moment."""
    force_change: Annotated[Number, Field(ge=1e-3, lt=1)] | None = None
    """Largest change of the force in one step, relative to the largest force so far; a step that
    exceeds it is halved. When not given no step is halved."""

    @field_validator("approach")
    @classmethod
    def _from_first_touch(
        cls, approach: tuple[float, ...] | None, info: ValidationInfo
    ) -> tuple[float, ...] | None:
        if approach is not None and info.data.get("zero") == FIRST_TOUCH:
            check_from_zero(approach)
        return approach

    @model_validator(mode="after")
    def _one_load(self) -> Self:
        if (self.approach is None) == (self.force is None):
            raise ValueError("needs exactly one load (allowed: either 'approach' or 'force')")
        if self.cycles > 1 and len(self.approach or self.force or ()) < 2:
            raise ValueError(
                f"cycles = {self.cycles} needs two turning points (allowed: a list of loads, or "
                "cycles = 1)"
            )
        return self

    @property
    def load_history(self) -> LoadHistory:
        """The load history of the rigid plane."""
        return LoadHistory(
            quantity="approach" if self.force is None else "force",
            points=self.approach or self.force or (),
            steps=self.steps,
            tilt=None if self.tilt == "free" else self.tilt,
            force_change=self.force_change,
            cycles=self.cycles,
        )
