"""Chooses elements, heights and rows of laws of samples by the errors of the load steps.

The turning points of the load history are solved on the meshes and samples of every trial, and
their errors are those that a run would measure there. Whatever exceeds its share of the accuracy is
refined for the next trial: elements become quadratic, cells are cut into eight as long as that
lowers their error by a fifth, samples get more heights, finite slopes are taken into account.

The rule in words: docs/choosing.md.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import cast

from patchlaw.multiscale.auto.keys import MOST_HEIGHTS, auto_keys, with_value
from patchlaw.multiscale.auto.rule import (
    TRIALS,
    Errors,
    OpenMeshes,
    Share,
    as_quadratic,
    refinement,
    scaled,
)
from patchlaw.multiscale.couplings.coupling import Coupling
from patchlaw.multiscale.couplings.representative import RepresentativeCoupling
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.measured_errors.samples import (
    MOST_CHECKED_UNKNOWNS,
    OF_LINEAR,
    OF_QUADRATIC,
)
from patchlaw.multiscale.problem import Problem
from patchlaw.multiscale.scene.scene import Scene

MOST_UNKNOWNS = 1_000_000
"""Unknowns of bodies beyond which they are not refined of themselves: 1.6 to 2.8 GB."""
_ELEMENTS, _CELLS, _SLOPES = ("mesh", "quadrature"), ("grid",), ("slopes",)


@dataclass(frozen=True)
class SampleSearch:
    """The search for values of a scene with laws of samples.

    Args:
        given: The scene as it was given.
        accuracy: Relative error of the force that may be left.
        build: Makes the coupling of a scene without auto values; collective.
    """

    given: Scene
    accuracy: float
    build: Callable[[Scene], Coupling]
    tally: Counter[str] = field(default_factory=Counter)

    def found(self, start: Scene) -> tuple[Coupling, Errors]:
        """Return a coupling with its errors: the first that keeps the accuracy, or the last tried.

        Args:
            start: The scene with values to start from.

        Note:
            Collective.
        """
        meshes = OpenMeshes(self.given)
        coupling = self._affordable(meshes, meshes.start(start))
        errors, before = self._errors(coupling), math.inf
        for _ in range(TRIALS - 1):
            by_elements = self._share(errors, _ELEMENTS).error
            # other meshes may be what is too coarse
            finer = self._finer(coupling, errors, elements=by_elements <= 0.8 * before)
            if finer is None:
                break
            if finer.body != coupling.scene.body or finer.block != coupling.scene.block:
                before = by_elements
            coupling.release()
            coupling = self._made(finer, coupling)
            errors = self._errors(coupling)
        return self._coarser(coupling, errors)

    def _made(self, scene: Scene, before: RepresentativeCoupling) -> RepresentativeCoupling:
        """Return the coupling of a scene, with the laws of the one before where they are the same.

        Laws differ in their ends alone on other meshes; load steps extend them where that matters.
        """
        coupling = cast(RepresentativeCoupling, self.build(scene))
        same = scene.surface == before.scene.surface and scene.micro == before.scene.micro
        if same:
            coupling.table = before.table
        return coupling

    def _affordable(self, meshes: OpenMeshes, scene: Scene) -> RepresentativeCoupling:
        """Return the coupling with the elements to try first: linear where others are too many."""
        coupling = cast(RepresentativeCoupling, self.build(scene))
        if sum(body.unknowns for body in coupling.shown_bodies) > MOST_UNKNOWNS:
            linear = meshes.of_degree(scene, 1)
            if linear != scene:
                return cast(RepresentativeCoupling, self.build(linear))
        return coupling

    def _errors(self, coupling: RepresentativeCoupling) -> Errors:
        """Return the errors relative to the force, at the turning point where they are largest."""
        worst: Errors = {}
        history = coupling.load_history.by_turning_points
        decisive = history.decisive_legs
        for leg, step in enumerate(Problem(coupling.solver, history).steps()):
            if leg in decisive and step.force_N > 0.0:
                worst = max(worst, _relative(coupling.checked(step)), key=lambda e: sum(e.values()))
        self.tally["trials"] += 1
        return worst

    def _share(self, errors: Errors, causes: tuple[str, ...]) -> Share:
        return Share(errors, causes, self.accuracy)

    def _finer(
        self, coupling: RepresentativeCoupling, errors: Errors, *, elements: bool
    ) -> Scene | None:
        """Return the scene with all refined that exceeds its share; None where nothing is.

        Args:
            coupling: The latest trial.
            errors: Its errors.
            elements: Whether elements may be refined.
        """
        scene, auto = coupling.scene, auto_keys(self.given)
        if elements and self._share(errors, _ELEMENTS).excess > 1.0:
            scene = self._finer_elements(coupling) or scene
        cells = self._share(errors, _CELLS)
        grid = scene.surface.grid
        if cells.excess > 1.0 and "surface.grid" in auto and isinstance(grid, tuple):
            if max(grid) < MOST_HEIGHTS:
                finer = scaled(grid, refinement(cells.excess, order=1.5))
                scene = with_value(scene, "surface.grid", finer)
        slopes = self._share(errors, _SLOPES)
        if slopes.excess > 1.0 and "micro.finite_slopes" in auto:
            scene = with_value(scene, "micro.finite_slopes", True)
        return None if scene == coupling.scene else scene

    def _finer_elements(self, coupling: RepresentativeCoupling) -> Scene | None:
        """Return the scene with quadratic elements, or with every cell cut into eight."""
        meshes, scene = OpenMeshes(self.given), coupling.scene
        quadratic = meshes.of_degree(scene, 2)
        if quadratic != scene and as_quadratic(coupling.shown_bodies) <= MOST_UNKNOWNS:
            return quadratic
        return meshes.refined(coupling, MOST_UNKNOWNS)

    def _coarser(self, coupling: RepresentativeCoupling, errors: Errors) -> tuple[Coupling, Errors]:
        """Return the coupling with linear elements instead where their error is allowed, too.

        The change of the force from one to the other tells the errors of both.
        """
        linear = OpenMeshes(self.given).of_degree(coupling.scene, 1)
        known = {**errors, "mesh": errors.get("mesh", 0.0) * OF_LINEAR / OF_QUADRATIC}
        fits = self._share(known, _ELEMENTS).excess <= 1.0 and sum(known.values()) <= self.accuracy
        checked = sum(body.unknowns for body in coupling.shown_bodies) <= MOST_CHECKED_UNKNOWNS
        all_quadratic = all(body.degree == 2 for body in coupling.shown_bodies)
        taken = coupling.scene
        if linear != taken and all_quadratic and fits and checked and errors:
            taken, errors = linear, known
        coupling.release()
        return self.build(taken), errors


def _relative(step: LoadStep) -> dict[str, float]:
    return {cause: error / step.force_N for cause, error in step.errors}
