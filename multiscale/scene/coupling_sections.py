"""The sections of a scene on coupling, reference and load."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from multiscale.loading.stepper import LoadHistory
from multiscale.scene.quantities import Approaches, Forces, Length, Tilt
from multiscale.scene.sections import Count, Number, Section


class _ConsistentSection(Section):
    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        for contradicts, problem, allowed in self._contradictions():
            if contradicts:
                raise ValueError(f"{problem} (allowed: {allowed})")
        return self

    def _contradictions(self) -> Iterator[tuple[bool, str, str]]:
        """Yield whether keys contradict each other, how, and what is allowed."""
        raise NotImplementedError


class CouplingSection(_ConsistentSection):
    """How micro and macro model are put together.

    ``kind``: ``isolated`` takes every patch's law from what lies in it alone (Waddad et al. 2016);
    ``consistent`` takes all laws from the whole surface in contact on the block under the tilt of
    the load (where the plane is free, under the tilt that it takes at each approach);
    ``concurrent`` solves the whole surface on the block at every load step, without laws;
    ``analytic`` is the micro model alone on a half-space; ``reference`` meshes the rough surface
    itself and has no micro model, see `ReferenceSection`; ``auto`` is concurrent or consistent,
    whichever keeps the scene's accuracy at less cost.

    ``compliance`` of the block under its patches: ``finite-element`` takes it from a mesh with a
    flat top; ``decomposed`` adds few smooth modes of the finite body to the exact half-space. By
    default it is decomposed, except for isolated laws and for laws at points.

    ``newton``: ``condensed`` solves for the patches alone, with a compliance computed once;
    ``full`` solves for all displacements of the mesh. By default what is predicted to cost less.

    ``love``: which displacement under its own pressure is subtracted from an isolated patch, the
    ``mean`` one or that at its ``centre``. ``interface``: the closure is a mean over each patch, or
    taken at each point. ``table_tolerance``: interpolation error of the laws, relative to the
    force; by default 1e-4, and 5e-4 with micro models that resolve the cells of the surface.
    """

    kind: Literal["isolated", "consistent", "concurrent", "analytic", "reference", "auto"] = (
        "consistent"
    )
    compliance: Literal["auto", "finite-element", "decomposed"] = "auto"
    newton: Literal["auto", "condensed", "full"] = "auto"
    love: Literal["mean", "centre"] = "mean"
    interface: Literal["patchwise", "pointwise"] = "patchwise"
    table_tolerance: Annotated[Number, Field(gt=0, lt=0.1)] | None = None

    def _contradictions(self) -> Iterator[tuple[bool, str, str]]:
        """Yield whether keys contradict each other, how, and what is allowed."""
        if self.kind == "analytic":  # ignores what is about patches and finite elements
            return
        kind, points = f"kind = '{self.kind}'", self.interface == "pointwise"
        yield (
            self.kind != "isolated" and self.love == "centre",
            f"love = 'centre' does not go with {kind}",
            "love = 'mean', or kind = 'isolated'",
        )
        lawless = self.kind in ("concurrent", "reference")
        yield (
            lawless and self.table_tolerance is not None,
            f"table_tolerance = {self.table_tolerance} does not go with {kind}",
            "leave it out: there are no laws",
        )
        for key, value, meant in (
            ("compliance", self.compliance, "decomposed" if self.kind == "concurrent" else "auto"),
            ("newton", self.newton, "auto"),
            ("interface", self.interface, "patchwise"),
        ):
            yield (
                lawless and value not in ("auto", meant),
                f"{key} = '{value}' does not go with {kind}",
                f"{key} = '{meant}'",
            )
        yield (
            points and self.compliance == "decomposed",
            "compliance = 'decomposed' does not go with interface = 'pointwise'",
            "compliance = 'finite-element', or interface = 'patchwise'",
        )
        yield (
            points and self.newton == "condensed",
            "newton = 'condensed' does not go with interface = 'pointwise'",
            "newton = 'full', or interface = 'patchwise'",
        )
        yield (
            self.newton == "full" and self.compliance == "decomposed",
            "newton = 'full' does not go with compliance = 'decomposed'",
            "newton = 'condensed', or compliance = 'finite-element'",
        )

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


class ReferenceSection(_ConsistentSection):
    """The meshed rough surface of ``coupling.kind = "reference"``; other couplings ignore it.

    ``method``: how contact is found, see `macro.UnilateralContactProblem`. ``mesh``: ``tetrahedra``
    are small only where contact can occur, ``hexahedra`` are as many as ``cells`` says; by default
    tetrahedra, unless ``cells`` is stated. ``meshes``: number of meshes of falling size that take
    the same loads; their results are extrapolated, and one mesh alone has no error bar. ``fine``:
    edge length of the finest tetrahedra where contact can occur, by default from the surface and
    the load. ``cells``: hexahedra of the finest mesh; their element and grading are those of
    ``[block]``.
    """

    method: Literal["active-set", "augmented-lagrangian"] = "active-set"
    mesh: Literal["auto", "hexahedra", "tetrahedra"] = "auto"
    meshes: Annotated[int, Field(ge=1, le=3, strict=True)] = 2
    fine: Annotated[Length, Field(gt=0)] | None = None
    cells: Annotated[tuple[Count, Count, Count], Field(description="cells in x, y, z")] | None = (
        None
    )

    def _contradictions(self) -> Iterator[tuple[bool, str, str]]:
        """Yield whether keys contradict each other, how, and what is allowed."""
        mesh, fine, cells = f"mesh = '{self.mesh}'", self.fine, self.cells
        yield (
            self.mesh == "hexahedra" and cells is None,
            f"{mesh} needs cells",
            "cells along x, y and z; or mesh = 'tetrahedra'",
        )
        yield (
            self.mesh == "tetrahedra" and cells is not None,
            f"cells does not go with {mesh}",
            "leave it out, and state fine; or mesh = 'hexahedra'",
        )
        yield (
            fine is not None and cells is not None,
            f"fine = {fine or 0.0:g} mm, of tetrahedra, does not go with cells, of hexahedra",
            "one of them",
        )

    @property
    def hexahedral(self) -> bool:
        """Whether the meshes are of hexahedra."""
        return self.cells is not None


class LoadSection(Section):
    """The motion of the rigid plane: turning points of its approach, or of the force on it.

    ``steps`` load steps lead to every turning point. ``tilt``: slopes of the approach along x and y
    about the middle of the interface; ``"free"`` lets the plane turn until the pressures have no
    moment. ``force_change``: the largest change of the force in one step, relative to the largest
    force so far; a step that exceeds it is halved.
    """

    approach: Approaches | None = None
    force: Forces | None = None
    steps: Annotated[int, Field(ge=1, le=1_000_000, strict=True)] = 8
    tilt: Tilt = (0.0, 0.0)
    force_change: Annotated[Number, Field(ge=1e-3, lt=1)] | None = None

    @model_validator(mode="after")
    def _one_load(self) -> Self:
        if (self.approach is None) == (self.force is None):
            raise ValueError("needs exactly one load (allowed: either 'approach' or 'force')")
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
        )
