"""Refines cells, meshes and samples of a scene until its measured errors keep an accuracy.

What exceeds its share of the accuracy is refined for the next trial. The contact problem on the
scene's body is solved on coarse cells first; the mesh of a body is refined as long as what the body
adds falls by a fifth. The meshes of a reference are refined by their own error. Under laws of
samples the turning points of the load history are solved on the meshes and samples of every trial:
elements become quadratic, cells are cut into eight as long as that lowers their error by a fifth,
samples get more heights, finite slopes are taken into account.

The rule in words: docs/choosing.md.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, cast

from patchlaw.geometry.surface import Zero
from patchlaw.micro.half_space.error_probe import ZERO, ErrorProbe, read
from patchlaw.multiscale.bodies.reader import Meshes
from patchlaw.multiscale.loading.path import Path
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.models.cell_coupling import CellCoupling
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.faces import (
    MOST_CHECKED_UNKNOWNS,
    OF_LINEAR,
    OF_QUADRATIC,
)
from patchlaw.multiscale.models.problem import Problem
from patchlaw.multiscale.models.reference_coupling import ReferenceCoupling
from patchlaw.multiscale.models.representative_coupling import RepresentativeCoupling
from patchlaw.multiscale.models.setup import trial_coupling
from patchlaw.multiscale.results.accuracy import relative_error
from patchlaw.multiscale.scene.loads import loads_on
from patchlaw.multiscale.scene.parts import BodyFacts, stated_cells
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import make_surface, most_waves
from patchlaw.support import on_root_alone
from patchlaw.support.readable import ProgressObserver, times, unobserved

MOST_HEIGHTS = 2048
"""Heights or cells along a side of grids that are chosen, at most."""
MOST_UNKNOWNS = 1_000_000
"""Unknowns of bodies, or of all meshes of a reference, beyond which they are not refined of
themselves: 1.6 to 3.5 GB."""
TRIALS = 6
"""Most trials of a grid, of a mesh, or of the size of meshes."""
Errors = Mapping[str, float]
"""Errors of the force by cause, relative to it."""
Grid = tuple[int, int]

_DEGREES = {1: "linear", 2: "quadratic"}
_ELEMENTS = ("mesh", "quadrature")


class Found(NamedTuple):
    """What was taken.

    Attributes:
        scene: The scene, with the keys that were chosen.
        errors: Its errors; empty where they cannot be measured before the run.
        label: The coupling, and the cells, meshes or micro model that it works on.
    """

    scene: Scene
    errors: Errors
    label: str


@dataclass(frozen=True)
class Share:
    """What some causes of error have of an accuracy.

    Args:
        errors: Errors of all causes.
        causes: Those that are refined together.
        accuracy: Relative error of the force that may be left.
    """

    errors: Errors
    causes: Collection[str]
    accuracy: float

    @property
    def error(self) -> float:
        """Their error."""
        return sum(self.errors.get(cause, 0.0) for cause in self.causes)

    @property
    def excess(self) -> float:
        """Error over allowed error; above 1 where they are to be refined.

        They may leave what the others do, or half of the others where that is more. At other loads
        errors differ: the sum may take 0.8 of the accuracy.
        """
        others = sum(error for cause, error in self.errors.items() if cause not in self.causes)
        allowed = max(0.8 * self.accuracy - others, 0.5 * others)
        return 0.0 if not self.error else self.error / allowed


def refinement(excess: float, order: float) -> float:
    """Return the refinement for the next trial.

    Args:
        excess: Error over allowed error.
        order: Known order of the error in the size.
    """
    return min(max(excess ** (1.0 / order), 1.3), 2.0)


def scaled(cells: Grid, factor: float) -> Grid:
    """Return cells along the sides times a factor, as multiples of 8 within the limits.

    Args:
        cells: Cells along x and y.
        factor: The factor.
    """
    x, y = (min(max(8 * math.ceil(factor * count / 8 - 1e-9), 48), MOST_HEIGHTS) for count in cells)
    return x, y


def _unknowns(bodies: Sequence[BodyFacts]) -> int:
    return sum(body.unknowns for body in bodies)


def _as_quadratic(bodies: Sequence[BodyFacts]) -> int:
    """Return the unknowns that bodies have with quadratic elements, about."""
    return sum(body.unknowns * (8 if body.degree == 1 else 1) for body in bodies)


@dataclass(frozen=True, kw_only=True)
class Search:
    """A search for values of what a scene leaves open. All methods are collective.

    Args:
        accuracy: Relative error of the force that may be left.
        opened: The keys that are open.
        comm: MPI communicator; None for this process alone.
        nodes: The nodes of the run.
        read: Reads the bodies of a scene from their meshes.
        mesh_error: Returns the relative error of the force by the meshes of a reference.
        observe: Told of every trial; see `ProgressObserver`.

    Attributes:
        tally: Counts ``trials`` of cells and meshes.
    """

    accuracy: float
    opened: frozenset[str]
    comm: Any
    nodes: ClusterNodes
    read: Callable[[Scene, Any], Meshes]
    mesh_error: Callable[[ReferenceCoupling], float]
    observe: ProgressObserver = unobserved
    tally: Counter[str] = field(default_factory=Counter)

    def build(self, scene: Scene) -> Coupling:
        """Make the coupling of a scene."""
        return trial_coupling(scene, self.comm, self.nodes, self.read)

    # --- meshes of bodies

    def _sections(self, field: str) -> list[str]:
        """Return the sections that leave a key open."""
        keys = (key.partition(".") for key in self.opened)
        return sorted(name for name, _, key in keys if key == field)

    def of_degree(self, scene: Scene, degree: int) -> Scene:
        """Return the scene with another degree of the displacements, wherever it is open."""
        names = {f"{name}.element": _DEGREES[degree] for name in self._sections("element")}
        if "block.element" in names and scene.block is not None:
            names["block.element"] = f"{scene.block.element[0]}{degree}"
        return scene.with_(names)

    def refined(self, scene: Scene, coupling: Coupling, most: float) -> Scene | None:
        """Return the scene with every cell of bodies cut into eight, wherever that is open.

        Args:
            scene: The scene.
            coupling: Its coupling, which knows its present meshes.
            most: Unknowns that all bodies may have together.

        Returns:
            The scene; None where nothing is open, or the unknowns would be more.
        """
        names = self._sections("refinements")
        cut = {name: getattr(scene, name).refinements + 1 for name in names}
        changes: dict[str, Any] = {f"{name}.refinements": count for name, count in cut.items()}
        if "block.cells" in self.opened and scene.law.representative:
            cells = stated_cells(scene)
            changes["block.cells"] = [2 * count for count in cells]
            names = [*names, "body"]
        known = {"body": coupling.parts.body, "counter_body": coupling.parts.counter}
        more = [one for name, one in known.items() if one and name in names]
        same = [one for name, one in known.items() if one and name not in names and one.on_mesh]
        if not more or _unknowns(same) + 8 * _unknowns(more) > most:
            return None
        return scene.with_(changes)

    # --- cells

    def on_waves(self, scene: Scene, count: int) -> Scene:
        """Return a scene on a grid with so many heights along the shortest wavelength.

        Args:
            scene: The scene, of a spectrum.
            count: Heights along the wavelength.
        """
        section = scene.surface
        assert section.spectrum is not None and section.lengths is not None, "refused otherwise"
        waves = most_waves(section.spectrum, section.lengths)
        grid = [min(max(8 * math.ceil(count * k / 8), 32), MOST_HEIGHTS) for k in waves]
        return scene.with_({"surface.grid": grid})

    def on_cells(self, scene: Scene) -> Found:
        """Refine the cells of the half-space model, and the meshes of its bodies.

        No errors are measured where contacts have no cells, or of loads besides the contact.
        """
        if scene.micro.model != "half-space" or scene.loads_bodies:
            return Found(scene, {}, self.build(scene).label)
        before = math.inf
        for _ in range(TRIALS):
            coupling = cast(CellCoupling, self.build(scene))
            probe = replace(coupling.error_probe(), by_laws=False)
            refined = partial(self._refined_cells, coupling, probe)
            cells, errors, tried = on_root_alone(self.comm, refined)
            self.tally["trials"] += tried
            if "surface.grid" in self.opened:
                scene = scene.with_({"surface.grid": cells})
            elif "micro.model" in self.opened:
                scene = scene.with_({"micro.cells": cells})
            share, finer = Share(errors, ("body",), self.accuracy), None
            if share.excess > 1.0 and share.error <= 0.8 * before:
                finer = self.refined(scene, coupling, _most_unrefined(coupling))
            coupling.release()
            if finer is None:
                break
            scene, before = finer, share.error
        return Found(scene, errors, f"{scene.kind} on {times(cells)} cells")

    def _refined_cells(self, coupling: CellCoupling, probe: ErrorProbe) -> tuple[Grid, Errors, int]:
        """Return the cells, their errors, and how many were tried; not collective."""
        scene, path, model = coupling.scene, coupling.parts.path, probe.model
        new_surface = "surface.grid" in self.opened
        may_refine = new_surface or "micro.model" in self.opened
        cells = coupling.parts.surface.grid if may_refine else model.surface.grid
        if may_refine and not new_surface:
            x, y = scaled(cells, 0.25)
            cells = max(x, scene.patches.grid[0]), max(y, scene.patches.grid[1])
        for trial in range(TRIALS):
            self.observe(f"trial of {times(cells)} cells", 0, 0)
            if new_surface:
                surface = make_surface(scene.with_({"surface.grid": cells}))
                model = replace(model, surface=surface, highest=surface.highest)
                path = loads_on(scene, (surface,), surface.area).path
                probe = replace(probe, zero=Zero(scene.loading.zero).error([surface]))
            else:
                model = replace(model, surface=coupling.parts.surface).resampled(cells)
            errors = _measured(replace(probe, model=model), path)
            causes = ("grid", ZERO) if new_surface else ("grid",)
            share = Share(errors, causes, self.accuracy)
            last = trial == TRIALS - 1 or max(cells) >= MOST_HEIGHTS
            if not may_refine or last or share.excess <= 1.0:
                break
            cells = scaled(cells, refinement(share.excess, order=1.5))
        return cells, errors, trial + 1

    # --- the roughness meshed

    def first_meshes(self, scene: Scene) -> ReferenceCoupling:
        """Return a reference with the meshes to try first, coarser for a lower accuracy."""
        coupling = cast(ReferenceCoupling, self.build(scene))
        if scene.reference.fine is not None:
            return coupling
        # the default meshes are off by some 0.005
        coarser = min(max((self.accuracy / 0.005) ** 0.5, 1.0), 1.8)
        return self._with_edges(coupling, coarser * float(coupling.rough_meshes.sizes[-1]))

    def meshed(self, coupling: ReferenceCoupling) -> Found:
        """Refine the meshes of a reference, where they are open, until their error is small enough.

        Args:
            coupling: The reference with the meshes to try first.
        """
        errors: Errors = {}
        for _ in range(TRIALS if len(coupling.rough_meshes.shapes) > 1 else 0):
            self.observe(f"trial of the {coupling.label}", 0, 0)
            errors, fine = {"mesh": self.mesh_error(coupling)}, coupling.scene.reference.fine
            self.tally["trials"] += 1
            if errors["mesh"] <= self.accuracy or "reference.fine" not in self.opened or not fine:
                break
            order = coupling.rough_meshes.force_order
            finer = fine / refinement(errors["mesh"] / self.accuracy, order)
            refined = self._with_edges(coupling, finer)
            if not self.is_small(refined):
                break
            coupling = refined
        return Found(coupling.scene, errors, coupling.label)

    def _with_edges(self, coupling: ReferenceCoupling, fine: float) -> ReferenceCoupling:
        scene = coupling.scene.with_({"reference.fine": f"{fine!r} mm"})
        return cast(ReferenceCoupling, self.build(scene))

    def is_small(self, coupling: ReferenceCoupling) -> bool:
        """Tell whether the meshes of a reference have no more unknowns than are chosen."""
        return sum(coupling.rough_meshes.unknowns) <= MOST_UNKNOWNS

    # --- laws of samples

    def by_samples(self, scene: Scene) -> Found:
        """Refine elements, heights and rows: the first that keeps the accuracy, or the last tried.

        Args:
            scene: The scene. Quadratic elements are tried first, linear ones where these are too
                many.
        """
        coupling, linear = self._of_samples(self.of_degree(scene, 2)), self.of_degree(scene, 1)
        if linear != coupling.scene and _unknowns(coupling.parts.shown_bodies) > MOST_UNKNOWNS:
            coupling = self._of_samples(linear)
        errors, before = self._load_step_errors(coupling), math.inf
        for _ in range(TRIALS - 1):
            by_elements = Share(errors, _ELEMENTS, self.accuracy).error
            # other meshes may be what is too coarse
            finer = self._finer(coupling, errors, elements=by_elements <= 0.8 * before)
            if finer == coupling.scene:
                break
            if (finer.body, finer.block) != (coupling.scene.body, coupling.scene.block):
                before = by_elements
            coupling.release()
            coupling = self._of_samples(finer, coupling)
            errors = self._load_step_errors(coupling)
        taken, errors = self._coarser(coupling, errors)
        if taken != coupling.scene:
            coupling.release()
            coupling = self._of_samples(taken)
        label = coupling.label
        coupling.release()
        return Found(taken, errors, label)

    def _of_samples(
        self, scene: Scene, before: RepresentativeCoupling | None = None
    ) -> RepresentativeCoupling:
        """Return the coupling of a scene, with the laws of one before where they are the same.

        Laws differ in their ends alone on other meshes; load steps extend them where that matters.
        """
        coupling = cast(RepresentativeCoupling, self.build(scene))
        if before is not None and (scene.surface, scene.micro) == (
            before.scene.surface,
            before.scene.micro,
        ):
            coupling.table = before.table
        return coupling

    def _load_step_errors(self, coupling: RepresentativeCoupling) -> Errors:
        """Return the errors relative to the force, at the turning point where they are largest."""
        self.observe(f"trial of {coupling.label}", 0, 0)
        found: list[Errors] = [{}]
        path = coupling.parts.path.turning_points
        decisive = path if path[0].stage else (path.furthest(path.quantity), path[-1])
        steps = Problem(coupling.model, path).steps()
        for turning, step in zip(path, steps, strict=True):
            if turning in decisive and step.force_N > 0.0:
                errors = coupling.measured_errors(step).get("errors", ())
                found.append({cause: error / step.force_N for cause, error in errors})
        self.tally["trials"] += 1
        return max(found, key=lambda errors: sum(errors.values()))

    def _finer(self, coupling: RepresentativeCoupling, errors: Errors, *, elements: bool) -> Scene:
        """Return the scene with all refined that exceeds its share.

        Args:
            coupling: The latest trial.
            errors: Its errors.
            elements: Whether elements may be refined.
        """
        scene, grid = coupling.scene, coupling.scene.surface.grid
        excess = {
            causes: Share(errors, causes, self.accuracy).excess
            for causes in (_ELEMENTS, ("grid",), ("slopes",))
        }
        if elements and excess[_ELEMENTS] > 1.0:
            quadratic = self.of_degree(scene, 2)
            if quadratic != scene and _as_quadratic(coupling.parts.shown_bodies) <= MOST_UNKNOWNS:
                scene = quadratic
            else:
                scene = self.refined(scene, coupling, MOST_UNKNOWNS) or scene
        by_cells = excess["grid",]
        if by_cells > 1.0 and "surface.grid" in self.opened and grid and max(grid) < MOST_HEIGHTS:
            finer = scaled(grid, refinement(by_cells, order=1.5))
            scene = scene.with_({"surface.grid": finer})
        if excess["slopes",] > 1.0 and "micro.finite_slopes" in self.opened:
            scene = scene.with_({"micro.finite_slopes": True})
        return scene

    def _coarser(self, coupling: RepresentativeCoupling, errors: Errors) -> tuple[Scene, Errors]:
        """Return the scene with linear elements instead where their error is allowed, too.

        The change of the force from one to the other tells the errors of both.
        """
        taken, bodies = coupling.scene, coupling.parts.shown_bodies
        linear = self.of_degree(taken, 1)
        known = {**errors, "mesh": errors.get("mesh", 0.0) * OF_LINEAR / OF_QUADRATIC}
        excess = Share(known, _ELEMENTS, self.accuracy).excess
        fits = excess <= 1.0 and sum(known.values()) <= self.accuracy
        told = _unknowns(bodies) <= MOST_CHECKED_UNKNOWNS and all(one.degree == 2 for one in bodies)
        return (linear, known) if linear != taken and fits and told and errors else (taken, errors)


def measured_mesh_error(coupling: ReferenceCoupling) -> float:
    """Return the relative error of the force by the meshes of a reference at the largest load.

    Args:
        coupling: The reference, with several meshes.

    Raises:
        NotConverged: When the contact problem cannot be solved.
    """
    path = coupling.parts.path
    control = path.control(path.largest())
    step = replace(coupling.model.press(control), control=control)
    (with_error,), _ = coupling.with_mesh_errors([step])
    coupling.release()
    if not step.force_N > 0.0:
        return 0.0
    error = relative_error(with_error)
    return 1.0 if error is None else error


def _most_unrefined(coupling: CellCoupling) -> float:
    """Return the unknowns that bodies may have so that their elements can be quadratic."""
    from patchlaw.macro.compliance.mesh_face import MOST_DOFS

    bodies = coupling.parts.meshes
    return MOST_DOFS * _unknowns(bodies) / max(_as_quadratic(bodies), 1)


def _measured(probe: ErrorProbe, path: Path) -> Errors:
    """Return the errors relative to the force where their sum is largest."""
    found: list[Errors] = [{"grid": 0.0}]
    model = probe.on_body(probe.model, probe.order)
    for value in sorted({path.largest(), path.known(path.quantity)[-1].value}):
        state = model.press(path.control(value))
        if state.force > 0.0:
            plane = state.plane
            measured = probe.measure(read(state), plane.approach, plane.tilt, start=state.guess)
            found.append({cause: error / state.force for cause, error in measured.parts.items()})
    return max(found, key=lambda errors: sum(errors.values()))
