"""Resolves auto values by errors that are measured at the largest load.

The contact problem on the scene's body is solved on coarse cells, its errors are measured
(`multiscale.measured_errors`), and the cells are refined until the sum of the errors keeps the
accuracy. Where causes other than the cells exceed it, or where meshing the roughness is predicted
to take less time, the meshes of a reference are refined in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

from geometry.errors import InputError, NotConverged
from micro import HalfSpaceModel
from multiscale.couplings.contact import SLOPES, OnBody, on_body
from multiscale.measured_errors import ZERO, error_probe
from multiscale.planning.auto_keys import (
    MOST_HEIGHTS,
    auto_keys,
    couplings,
    map_grid,
    on_waves,
    with_value,
)
from multiscale.planning.costs import predicted_cost
from multiscale.planning.mesh_accuracy import Build, Errors, MeshError, MeshSearch, refinement
from multiscale.scene.scene import Scene
from multiscale.setup.problem import Alternative, Decision, ProblemSetup
from multiscale.setup.surface_and_block import make_surface

_TRIALS = 6
"""Most trials of a grid."""
_SPARE = 0.8
"""Share of the accuracy that errors at the largest load may take; errors at other loads differ."""
_ORDER = 1.5
"""Order of the force in the size of the cells, for the next grid to try."""
_COARSE, _FINE = 8, 16
"""Heights along the shortest wave that are tried first, and that are enough for summits and for
meshes."""
_FIRST_CELLS = 4
"""Coarsening of a given grid for the first trial, along a side."""
_LEAST_CELLS = 48
"""Cells along a side at least."""
_CHEAPER = 0.7
"""Time of a reference, relative to that of another coupling, below which it is taken."""
_NOTHING_TO_SAVE = 4.0
"""Time of a run below which no reference is tried to save time [s]."""


def setup_by_accuracy(
    given: Scene, start: Scene, build: Build, mesh_error: MeshError
) -> ProblemSetup:
    """Set up a scene with its auto values resolved so that the accuracy is kept.

    Args:
        given: The scene as it was given.
        start: The same with values to start from.
        build: Sets up a scene without auto values.
        mesh_error: Measures the relative error of the meshes of a reference.

    Raises:
        InputError: When nothing that the scene allows can be made.
        NotConverged: When a contact problem cannot be solved.
    """
    search, auto = _Search(given, build, mesh_error), auto_keys(given)
    if "surface.grid" in auto:
        on_cells = start.micro.model == "half-space" and start.coupling.kind != "reference"
        start = on_waves(start, _COARSE if on_cells else _FINE)
    setup = build(start)
    if "patches.grid" in auto:
        setup = build(with_value(start, "patches.grid", map_grid(setup.surface)))
    if setup.meshes is not None:
        return search.decided(*search.with_refined_meshes(setup))
    if isinstance(setup.micro, HalfSpaceModel):
        return search.cheapest(*search.refined_cells(setup, setup.micro))
    return search.decided(setup, {})


class _Search(MeshSearch):
    """The search for auto values of one scene; see `setup_by_accuracy`."""

    def refined_cells(
        self, setup: ProblemSetup, model: HalfSpaceModel
    ) -> tuple[ProblemSetup, Errors]:
        """Refine the cells of the half-space model until its errors keep the accuracy."""
        auto, cells = auto_keys(self.given), setup.surface.grid
        new_surface = "surface.grid" in auto
        may_refine = new_surface or "micro.model" in auto
        if may_refine and not new_surface:
            cells = _scaled(cells, 1.0 / _FIRST_CELLS)
        body = on_body(setup, None, half_space=not setup.has_block)
        for trial in range(_TRIALS):
            if new_surface:
                surface = make_surface(with_value(setup.scene, "surface.grid", cells))
                model = replace(model, surface=surface, highest=surface.highest)
            else:
                model = replace(model, surface=setup.surface).resampled(cells)
            found = replace(setup, surface=model.surface) if new_surface else setup
            errors = self._measured(found, model, body)
            by_cells = errors["grid"] + (errors.get(ZERO, 0.0) if new_surface else 0.0)
            others = sum(errors.values()) - by_cells
            allowed = max(_SPARE * self.accuracy - others, 0.5 * others)
            last = trial == _TRIALS - 1 or max(cells) >= MOST_HEIGHTS
            if not may_refine or last or by_cells <= allowed:
                break
            cells = _scaled(cells, refinement(by_cells / allowed, _ORDER))
        if new_surface:
            setup = self.build(with_value(setup.scene, "surface.grid", model.surface.grid))
        return replace(setup, micro=model), errors

    def _measured(self, setup: ProblemSetup, model: HalfSpaceModel, body: OnBody) -> Errors:
        """Return the errors relative to the force, at the load where their sum is largest."""
        load_history = setup.load_history
        order = SLOPES if setup.finite_slopes else 0
        probe = replace(error_probe(setup, body), model=model, by_laws=False)
        worst: Errors = {"grid": 0.0}
        for value in sorted({load_history.largest, load_history.points[-1]}):
            state = body(model, order).equilibrium(load_history.control(value))
            if not state.force > 0.0:
                continue
            found = probe.measure(state.force, state.plane.approach, state.plane.tilt)
            errors = {cause: error / state.force for cause, error in found.parts.items()}
            worst = max(worst, errors, key=lambda each: sum(each.values()))
        return worst

    def cheapest(self, setup: ProblemSetup, errors: Errors) -> ProblemSetup:
        """Choose the coupling that is predicted to take the least time, or a reference.

        A reference is tried where the errors exceed the accuracy, or to save time.
        """
        by_cost = sorted(self._coupled(setup), key=_seconds)
        taken, others, missed = by_cost[0], by_cost[1:], None
        keeps = sum(errors.values()) <= self.accuracy
        if not self._may_be_meshed or (keeps and _seconds(taken) < _NOTHING_TO_SAVE):
            return self.decided(taken, errors, others)
        with suppress(InputError, NotConverged):  # the block or the memory may not allow meshes
            reference = type(taken.scene.coupling)(kind="reference")
            scene = taken.scene.model_copy(update={"coupling": reference})
            meshed = self.with_first_meshes(self.build(scene))
            if keeps and _seconds(meshed) > _CHEAPER * _seconds(taken):
                return self.decided(taken, errors, [*others, meshed])
            meshed, mesh_errors = self.with_refined_meshes(meshed)
            if keeps or sum(mesh_errors.values()) <= sum(errors.values()):
                missed = None if keeps else errors
                taken, others, errors = meshed, by_cost, mesh_errors
        return self.decided(taken, errors, others, missed)

    def _coupled(self, setup: ProblemSetup) -> Iterator[ProblemSetup]:
        """Yield the problem with every coupling that may be chosen."""
        chosen = "coupling.kind" in auto_keys(self.given)
        tolerance = {"table_tolerance": 0.1 * self.accuracy}
        for section in couplings(self.given) if chosen else iter([setup.scene.coupling]):
            if section.kind == "consistent" and section.table_tolerance is None:
                section = section.model_copy(update=tolerance)
            yield replace(setup, scene=setup.scene.model_copy(update={"coupling": section}))

    @property
    def _may_be_meshed(self) -> bool:
        """Whether the scene leaves it open that its roughness be meshed."""
        if self.given.micro.hardness is not None or self.given.conductance is not None:
            return False  # meshes are elastic, and do not know the stiffness of the interface alone
        stated = self.given.coupling.model_fields_set - {"kind"}
        return {"coupling.kind", "micro.model"} <= auto_keys(self.given) and not stated

    def decided(
        self,
        setup: ProblemSetup,
        errors: Errors,
        others: Sequence[ProblemSetup] = (),
        missed: Errors | None = None,
    ) -> ProblemSetup:
        """Return the problem with what was decided for it."""
        decision = Decision(
            accuracy=self.accuracy,
            taken=_alternative(setup),
            errors=errors,
            others=tuple(map(_alternative, others)),
            missed=missed or {},
        )
        return replace(setup, decision=decision)


def _scaled(cells: tuple[int, int], factor: float) -> tuple[int, int]:
    """Return cells along the sides times a factor, as multiples of 8 within the limits."""
    x, y = (
        min(max(8 * math.ceil(factor * count / 8 - 1e-9), _LEAST_CELLS), MOST_HEIGHTS)
        for count in cells
    )
    return x, y


def _seconds(setup: ProblemSetup) -> float:
    return predicted_cost(setup).total


def _alternative(setup: ProblemSetup) -> Alternative:
    """Return a problem as one of the ways to compute its scene."""
    kind = setup.scene.kind
    if setup.meshes is not None:
        size = 1e3 * float(setup.meshes.sizes[-1])
        label = f"reference, meshed with edges of {size:.3g} µm"
    elif isinstance(setup.micro, HalfSpaceModel):
        x, y = setup.micro.surface.grid
        label = f"{kind} on {x} × {y} cells"
    else:
        label = f"{kind}, {setup.model.name}"
    return Alternative(label=label, seconds=_seconds(setup))
