"""Resolves auto values by a rule from errors that are measured at the largest load.

What the scene states is kept. The contact problem on the scene's body is solved on coarse cells,
its errors are measured (`multiscale.measured_errors`), and the cells are refined until the sum of
the errors keeps the accuracy. Where causes other than the cells exceed it, and the scene leaves the
coupling open, the roughness is meshed, and the meshes of this reference are refined in the same
way. Neither clocks nor the machine take part: the same scene gets the same values everywhere, or
is refused where their memory is missing. The rule in words: docs/choosing.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

from geometry.zero import Zero
from micro import HalfSpaceModel
from multiscale.auto.keys import (
    MOST_HEIGHTS,
    auto_keys,
    chosen_coupling,
    map_grid,
    on_waves,
    with_value,
)
from multiscale.auto.mesh_search import Build, Errors, MeshError, MeshSearch, refinement
from multiscale.couplings.coupling import Coupling
from multiscale.couplings.micro_coupling import MicroCoupling
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.inputs.loads import load_history_on
from multiscale.inputs.memory import MemoryLacking
from multiscale.inputs.scene_parts import Decision
from multiscale.inputs.surfaces import make_surface
from multiscale.loading.load_history import LoadHistory
from multiscale.measured_errors import ZERO, ErrorProbe
from multiscale.scene.scene import Scene
from support.errors import InputError, NotConverged

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
_LAWS = 0.1
"""Interpolation error of laws over the accuracy."""


def coupling_by_accuracy(
    given: Scene, start: Scene, build: Build, mesh_error: MeshError
) -> Coupling:
    """Make the coupling of a scene with its auto values resolved so that the accuracy is kept.

    Args:
        given: The scene as it was given.
        start: The same with values to start from.
        build: Makes the coupling of a scene without auto values.
        mesh_error: Measures the relative error of the meshes of a reference.

    Raises:
        InputError: When nothing that the scene allows can be made, or the memory is missing.
        NotConverged: When a contact problem cannot be solved.
    """
    search, auto = _Search(given, build, mesh_error), auto_keys(given)
    if "surface.grid" in auto:
        on_cells = start.micro.model == "half-space" and start.coupling.kind != "reference"
        start = on_waves(start, _COARSE if on_cells else _FINE)
    if start.coupling.kind == "consistent" and start.coupling.table_tolerance is None:
        start = with_value(start, "coupling.table_tolerance", _LAWS * search.accuracy)
    coupling = build(start)
    if "patches.grid" in auto:
        coupling = build(with_value(start, "patches.grid", map_grid(start, coupling.surface)))
    if isinstance(coupling, ReferenceCoupling):
        return search.decided(*search.with_refined_meshes(coupling))
    if isinstance(coupling, MicroCoupling) and isinstance(coupling.micro, HalfSpaceModel):
        return search.kept_or_meshed(*search.refined_cells(coupling, coupling.micro))
    return search.decided(coupling, {})


class _Search(MeshSearch):
    """The search for auto values of one scene; see `coupling_by_accuracy`."""

    def refined_cells(
        self, coupling: MicroCoupling, model: HalfSpaceModel
    ) -> tuple[MicroCoupling, Errors]:
        """Refine the cells of the half-space model until its errors keep the accuracy."""
        auto, cells, scene = auto_keys(self.given), coupling.surface.grid, coupling.scene
        new_surface = "surface.grid" in auto
        may_refine = new_surface or "micro.model" in auto
        if may_refine and not new_surface:
            cells = _scaled(cells, 1.0 / _FIRST_CELLS)
        probe, history = replace(coupling.error_probe(), by_laws=False), coupling.load_history
        for trial in range(_TRIALS):
            if new_surface:
                surface = make_surface(with_value(scene, "surface.grid", cells))
                model = replace(model, surface=surface, highest=surface.highest)
                history = load_history_on(scene, (surface,))
                probe = replace(probe, zero=Zero(scene.loading.zero).error(surface))
            else:
                model = replace(model, surface=coupling.surface).resampled(cells)
            errors = _measured(replace(probe, model=model), history)
            by_cells = errors["grid"] + (errors.get(ZERO, 0.0) if new_surface else 0.0)
            others = sum(errors.values()) - by_cells
            allowed = max(_SPARE * self.accuracy - others, 0.5 * others)
            last = trial == _TRIALS - 1 or max(cells) >= MOST_HEIGHTS
            if not may_refine or last or by_cells <= allowed:
                break
            cells = _scaled(cells, refinement(by_cells / allowed, _ORDER))
        if new_surface:
            made = self.build(with_value(scene, "surface.grid", model.surface.grid))
            assert isinstance(made, MicroCoupling)
            coupling = made
        return replace(coupling, micro=model), errors

    def kept_or_meshed(self, coupling: MicroCoupling, errors: Errors) -> Coupling:
        """Return the coupling, or a reference where the errors exceed the accuracy.

        The reference is taken where its own error is smaller. None is tried where the scene states
        its coupling or micro model, or needs more unknowns than are chosen.

        Raises:
            MemoryLacking: When the meshes that would be tried do not fit into the memory.
        """
        if sum(errors.values()) <= self.accuracy or not self._may_be_meshed:
            return self.decided(coupling, errors)
        section = type(coupling.scene.coupling)(kind="reference")
        scene = replace(coupling.scene, coupling=section)
        try:
            meshed = self.with_first_meshes(self.reference(scene))
            if not self.is_small(meshed):
                return self.decided(coupling, errors)
            meshed, mesh_errors = self.with_refined_meshes(meshed)
        except MemoryLacking:  # another machine would take the reference
            raise
        except (InputError, NotConverged):  # the block has no such meshes
            return self.decided(coupling, errors)
        if sum(mesh_errors.values()) > sum(errors.values()):
            return self.decided(coupling, errors)
        return self.decided(meshed, mesh_errors, missed=errors)

    @property
    def _may_be_meshed(self) -> bool:
        """Whether the scene leaves it open that its roughness be meshed."""
        if self.given.micro.hardness is not None or self.given.conductance is not None:
            return False  # meshes are elastic, and do not know the stiffness of the interface alone
        stated = self.given.stated("coupling") - {"kind"}
        return {"coupling.kind", "micro.model"} <= auto_keys(self.given) and not stated

    def decided(self, coupling: Coupling, errors: Errors, missed: Errors | None = None) -> Coupling:
        """Return the coupling with what was decided for it."""
        why = ""
        if "coupling.kind" in auto_keys(self.given) and missed is None:
            why = chosen_coupling(self.given)[1]
        decision = Decision(
            accuracy=self.accuracy,
            taken=coupling.label,
            why=why,
            errors=errors,
            missed=missed or {},
        )
        return replace(coupling, decision=decision)


def _measured(probe: ErrorProbe, load_history: LoadHistory) -> Errors:
    """Return the errors relative to the force, at the load where their sum is largest."""
    worst: Errors = {"grid": 0.0}
    model = probe.on_body(probe.model, probe.order)
    for value in sorted({load_history.largest, load_history.points[-1]}):
        state = model.press(load_history.control(value))
        if not state.force > 0.0:
            continue
        measured = probe.measure(state.force, state.plane.approach, state.plane.tilt)
        errors = {cause: error / state.force for cause, error in measured.parts.items()}
        worst = max(worst, errors, key=lambda each: sum(each.values()))
    return worst


def _scaled(cells: tuple[int, int], factor: float) -> tuple[int, int]:
    """Return cells along the sides times a factor, as multiples of 8 within the limits."""
    x, y = (
        min(max(8 * math.ceil(factor * count / 8 - 1e-9), _LEAST_CELLS), MOST_HEIGHTS)
        for count in cells
    )
    return x, y
