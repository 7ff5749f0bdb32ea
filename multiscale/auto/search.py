"""Resolves auto values by a rule from errors that are measured at the largest load.

What the scene states is kept. The contact problem on the scene's body is solved on coarse cells,
its errors are measured (`multiscale.measured_errors.contact`), and the cells are refined until the
sum of the errors keeps the accuracy, the mesh of a body likewise. Where causes other than the cells
exceed it, and the scene leaves the coupling open, the roughness is meshed, and the meshes of this
reference are refined in the same way. Laws of samples: `multiscale.auto.samples`. Neither clocks
nor the machine take part: the same scene gets the same values everywhere, or is refused where their
memory is missing. The rule in words: docs/choosing.md.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, cast

from patchlaw.geometry.zero import Zero
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.auto.keys import (
    MOST_HEIGHTS,
    auto_keys,
    chosen_coupling,
    map_grid,
    on_waves,
    with_value,
)
from patchlaw.multiscale.auto.rule import (
    TRIALS,
    Errors,
    Grid,
    OpenMeshes,
    Share,
    as_quadratic,
    refinement,
    scaled,
)
from patchlaw.multiscale.auto.samples import SampleSearch
from patchlaw.multiscale.couplings.coupling import Coupling
from patchlaw.multiscale.couplings.dispatch import coupling_class
from patchlaw.multiscale.couplings.micro_coupling import MicroCoupling
from patchlaw.multiscale.couplings.reference import ReferenceCoupling
from patchlaw.multiscale.inputs.cost import MemoryLacking
from patchlaw.multiscale.inputs.loads import load_history_on
from patchlaw.multiscale.inputs.surfaces import make_surface
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.measured_errors.contact import ErrorProbe
from patchlaw.multiscale.measured_errors.errors import ZERO
from patchlaw.multiscale.results.accuracy import Decision, relative_error
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.collective import on_root_alone
from patchlaw.support.errors import InputError, NotConverged

Build = Callable[[Scene], Coupling]
MeshError = Callable[[ReferenceCoupling], float]

_MOST_UNKNOWNS = 1_000_000
"""Unknowns of all meshes of a reference beyond which they are not refined of themselves: 3.5 GB."""


def measured_mesh_error(coupling: ReferenceCoupling) -> float:
    """Return the relative error of the force by the meshes of a reference at the largest load.

    Args:
        coupling: The reference, with several meshes.

    Raises:
        NotConverged: When the contact problem cannot be solved.
    """
    history = coupling.load_history
    step = coupling.solver.press(history.control(history.largest))
    (with_error,), _ = coupling.with_mesh_errors([step])
    coupling.release()
    if not step.force_N > 0.0:
        return 0.0
    error = relative_error(with_error, by_force=history.quantity == "force")
    return 1.0 if error is None else error


def coupling_by_accuracy(
    given: Scene, start: Scene, build: Build, mesh_error: MeshError, comm: Any = None
) -> Coupling:
    """Make the coupling of a scene with its auto values resolved so that the accuracy is kept.

    Args:
        given: The scene as it was given.
        start: The same with values to start from.
        build: Makes the coupling of a scene without auto values; collective.
        mesh_error: Measures the relative error of the meshes of a reference; collective.
        comm: MPI communicator; None for this process alone.

    Raises:
        InputError: When nothing that the scene allows can be made, or the memory is missing.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    search, auto = _Search(given, build, mesh_error, comm), auto_keys(given)
    kind = coupling_class(start)
    if "surface.grid" in auto:
        on_cells = start.micro.model == "half-space" and not kind.meshes_roughness
        # heights along the shortest wave: what is tried first, and enough for summits and meshes
        start = on_waves(start, 8 if on_cells else 16)
    if kind.tolerance_by_accuracy and start.coupling.table_tolerance is None:
        start = with_value(start, "coupling.table_tolerance", 0.1 * search.accuracy)
    if given.law.representative:
        samples = SampleSearch(given, search.accuracy, build, search.tally)
        return search.decided(*samples.found(start))
    coupling = build(start)
    if "patches.grid" in auto:
        start = with_value(start, "patches.grid", map_grid(start, coupling.surface))
        coupling = build(start)
    if kind.meshes_roughness:
        return search.decided(*search.with_refined_meshes(cast(ReferenceCoupling, coupling)))
    if isinstance(coupling.micro, HalfSpaceModel) and not given.loads_bodies:
        return search.kept_or_meshed(*search.refined(cast(MicroCoupling, coupling)))
    return search.decided(coupling, {})


@dataclass(frozen=True)
class _Search:
    """The search for auto values of one scene; see `coupling_by_accuracy`. All is collective."""

    given: Scene
    build: Build
    mesh_error: MeshError
    comm: Any
    tally: Counter[str] = field(default_factory=Counter)

    @property
    def accuracy(self) -> float:
        """Relative error of the force that may be left."""
        assert self.given.accuracy is not None
        return self.given.accuracy

    def refined(self, coupling: MicroCoupling) -> tuple[MicroCoupling, Errors]:
        """Refine the cells of the half-space model, and the meshes of its bodies.

        A mesh is refined as long as what the body adds exceeds its share and falls by a fifth.
        """
        before = math.inf
        for _ in range(TRIALS):
            coupling, errors = self._with_refined_cells(coupling)
            share = Share(errors, ("body",), self.accuracy)
            if share.excess <= 1.0 or share.error > 0.8 * before:
                break
            finer = OpenMeshes(self.given).refined(coupling, _most_unrefined(coupling))
            if finer is None:
                break
            before = share.error
            coupling.release()
            coupling = cast(MicroCoupling, self.build(finer))
        return coupling, errors

    def _with_refined_cells(self, coupling: MicroCoupling) -> tuple[MicroCoupling, Errors]:
        """Refine the cells of the half-space model until its errors keep the accuracy."""
        probe = replace(coupling.error_probe(), by_laws=False)
        cells, errors, tried = on_root_alone(
            self.comm, lambda: self._refined_cells(coupling, probe)
        )
        self.tally["trials"] += tried
        if "surface.grid" in auto_keys(self.given):
            if cells != coupling.surface.grid:
                finer = with_value(coupling.scene, "surface.grid", cells)
                coupling = cast(MicroCoupling, self.build(finer))
            return coupling, errors
        model = replace(cast(HalfSpaceModel, coupling.micro), surface=coupling.surface)
        return coupling.changed(micro=model.resampled(cells)), errors

    def _refined_cells(
        self, coupling: MicroCoupling, probe: ErrorProbe
    ) -> tuple[Grid, Errors, int]:
        """Return the cells, their errors, and how many were tried.

        This is not collective.
        """
        auto, cells, scene = auto_keys(self.given), coupling.surface.grid, coupling.scene
        new_surface, model = "surface.grid" in auto, probe.model
        may_refine = new_surface or "micro.model" in auto
        if may_refine and not new_surface:
            cells = scaled(cells, 0.25)
        history = coupling.load_history
        for trial in range(TRIALS):
            if new_surface:
                surface = make_surface(with_value(scene, "surface.grid", cells))
                model = replace(model, surface=surface, highest=surface.highest)
                history = load_history_on(scene, (surface,), surface.area)
                probe = replace(probe, zero=Zero(scene.loading.zero).error(surface))
            else:
                model = replace(model, surface=coupling.surface).resampled(cells)
            errors = _measured(replace(probe, model=model), history)
            causes = ("grid", ZERO) if new_surface else ("grid",)
            share = Share(errors, causes, self.accuracy)
            last = trial == TRIALS - 1 or max(cells) >= MOST_HEIGHTS
            if not may_refine or last or share.excess <= 1.0:
                break
            cells = scaled(cells, refinement(share.excess, order=1.5))
        return model.surface.grid, errors, trial + 1

    def with_refined_meshes(self, coupling: ReferenceCoupling) -> tuple[ReferenceCoupling, Errors]:
        """Refine the meshes of a reference until their error keeps the accuracy."""
        coupling = self._with_first_meshes(coupling)
        if len(coupling.rough_meshes.shapes) == 1:  # one mesh does not show its error
            return coupling, {}
        for _ in range(TRIALS):
            error, fine = self.mesh_error(coupling), coupling.scene.reference.fine
            self.tally["trials"] += 1
            if error <= self.accuracy or self.given.reference.fine is not None or fine is None:
                break
            finer = refinement(error / self.accuracy, coupling.rough_meshes.force_order)
            refined = self._with_fine(coupling, fine / finer)
            if not _is_small(refined):
                break
            coupling = refined
        return coupling, {"mesh": error}

    def _with_first_meshes(self, coupling: ReferenceCoupling) -> ReferenceCoupling:
        """Return a reference with the meshes to try first, coarser for a lower accuracy."""
        if self.given.reference.fine is not None or coupling.scene.reference.fine is not None:
            return coupling
        # the default meshes are off by some 0.005
        coarser = min(max((self.accuracy / 0.005) ** 0.5, 1.0), 1.8)
        return self._with_fine(coupling, coarser * float(coupling.rough_meshes.sizes[-1]))

    def _with_fine(self, coupling: ReferenceCoupling, fine: float) -> ReferenceCoupling:
        return self._reference(with_value(coupling.scene, "reference.fine", fine))

    def _reference(self, scene: Scene) -> ReferenceCoupling:
        return cast(ReferenceCoupling, self.build(scene))

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
            meshed = self._with_first_meshes(self._reference(scene))
            if not _is_small(meshed):
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
        others = (self.given.body, self.given.counter_body, self.given.counter_surface)
        if any(one is not None for one in others):
            return False  # it is the block whose roughness is meshed, under a rigid plane
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
            trials=self.tally["trials"],
        )
        return coupling.changed(decision=decision)


def _is_small(coupling: ReferenceCoupling) -> bool:
    """Tell whether the meshes of a reference have no more unknowns than are chosen."""
    return sum(coupling.rough_meshes.unknowns) <= _MOST_UNKNOWNS


def _most_unrefined(coupling: MicroCoupling) -> float:
    """Return the unknowns that bodies may have so that their elements can be quadratic."""
    from patchlaw.macro.compliance.mesh_face import MOST_DOFS

    bodies = coupling.meshes
    return MOST_DOFS * sum(one.unknowns for one in bodies) / max(as_quadratic(bodies), 1)


def _measured(probe: ErrorProbe, load_history: LoadHistory) -> Errors:
    """Return the errors relative to the force where their sum is largest."""
    worst: Errors = {"grid": 0.0}
    model = probe.on_body(probe.model, probe.order)
    for value in sorted({load_history.largest, load_history.points[-1]}):
        state = model.press(load_history.control(value))
        if not state.force > 0.0:
            continue
        plane = state.plane
        measured = probe.measure(state.force, plane.approach, plane.tilt, start=state.guess)
        errors = {cause: error / state.force for cause, error in measured.parts.items()}
        worst = max(worst, errors, key=lambda each: sum(each.values()))
    return worst
