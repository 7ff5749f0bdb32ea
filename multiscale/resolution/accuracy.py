"""Chooses what a scene leaves open by errors that are measured at its largest load.

The contact problem on the scene's body is solved on coarse cells, its errors are measured
(`multiscale.errors.measured`), and the cells refined until the sum keeps the accuracy. Where other
causes than the cells exceed it, or meshing the roughness is predicted to take less time, the
meshes of a reference are refined likewise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from geometry.errors import InputError, NotConverged
from geometry.surface import Surface
from micro import HalfSpaceModel, resampled
from multiscale.costs.prediction import predicted_cost
from multiscale.couplings.blocks import SLOPES, OnBody, on_body
from multiscale.couplings.reference import make_reference
from multiscale.errors.load_steps import error_probe
from multiscale.machine.rates import this_machine
from multiscale.resolution.auto_keys import accuracy_of, auto_keys, couplings, map_grid
from multiscale.resolution.surface_grid import MOST_HEIGHTS, on_waves
from multiscale.scene.scene import Scene
from multiscale.setup.decision import Alternative, Decision
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.surface import make_surface

Build = Callable[[Scene], ProblemSetup]
Cells = tuple[int, int]
Errors = Mapping[str, float]

_SPARE = 0.8
"""Of the accuracy, that errors at the largest load may take: those at other loads differ."""
_ORDER = 1.5
"""Order of the force in the size of the cells, for the next grid to try."""
_LEAST_STEP, _LARGEST_STEP = 1.3, 2.0
"""Between two grids that are tried."""
_TRIALS = 6
_COARSE, _FINE = 8, 16
"""Heights along the shortest wave that are tried first, and that show summits and meshes enough."""
_FIRST_CELLS = 4
"""Parts of a given grid that are tried first, along a side."""
_LEAST_CELLS = 48
_DEFAULT_MESHES = 0.005
"""Error of the meshes that a reference takes by itself, roughly."""
_COARSEST_MESH = 1.8
_CHEAPER = 0.7
"""Time of a reference, of that of another coupling, from which on it is taken."""
_NOTHING_TO_SAVE = 4.0  # seconds


def accurate_stage(given: Scene, start: Scene, build: Build) -> ProblemSetup:
    """Return the ingredients of a scene, what it leaves open chosen so that its accuracy is kept.

    Args:
        given: The scene as it was given.
        start: The same with values to start from.
        build: Makes the ingredients of a scene without open keys.

    Raises:
        InputError: When nothing that the scene allows can be made.
        NotConverged: When a contact problem cannot be solved.
    """
    search, free = _Search(given, build), auto_keys(given)
    if "surface.grid" in free:
        by_cells = start.micro.model == "half-space" and start.coupling.kind != "reference"
        start = on_waves(start, _COARSE if by_cells else _FINE)
    setup = build(start)
    if "patches.grid" in free:
        patches = start.patches.model_copy(update={"grid": map_grid(setup.surface)})
        start = start.model_copy(update={"patches": patches})
        setup = build(start)
    if setup.meshes is not None:
        return search.reference(setup)
    return search.of_contacts(start, setup)


@dataclass(frozen=True)
class _Search:
    given: Scene
    build: Build

    @property
    def _accuracy(self) -> float:
        return accuracy_of(self.given)

    def of_contacts(self, start: Scene, setup: ProblemSetup) -> ProblemSetup:
        """Choose for a coupling that solves contacts on cells; it may end with a reference."""
        if not isinstance(setup.micro, HalfSpaceModel):
            return self._decided(setup, {})
        by_surface = "surface.grid" in auto_keys(self.given)
        model, errors = self._cells(start, setup, by_surface=by_surface)
        if by_surface:
            section = start.surface.model_copy(update={"grid": model.surface.grid})
            start = start.model_copy(update={"surface": section})
        setup = replace(self.build(start), micro=model)
        setup, others = self._cheapest(setup)
        if not self._may_be_meshed:
            return self._decided(setup, errors, others)
        seconds = _seconds(setup)
        needed = sum(errors.values()) > self._accuracy
        if not needed and seconds < _NOTHING_TO_SAVE:
            return self._decided(setup, errors, others)
        try:
            meshed = self.build(_meshed(start, {}))
            if self.given.reference.fine is None:
                meshed = self._with_meshes(start, self._first_size(meshed))
            if not needed and _seconds(meshed) > _CHEAPER * seconds:
                others = (*others, _alternative(meshed))
                return self._decided(setup, errors, others)
            found = self.reference(meshed)
        except (InputError, NotConverged):  # the block or the memory does not allow it
            return self._decided(setup, errors, others)
        decision = found.decision
        if decision is None or (needed and decision.error > sum(errors.values())):
            return self._decided(setup, errors, others)
        missed = errors if needed else {}
        others = (_alternative(setup), *others)
        return replace(found, decision=replace(decision, missed=missed, others=others))

    def _cells(
        self, start: Scene, setup: ProblemSetup, *, by_surface: bool
    ) -> tuple[HalfSpaceModel, Errors]:
        """Refine the cells of the half-space model until its errors keep the accuracy."""
        model = setup.micro
        assert isinstance(model, HalfSpaceModel)
        resample = not by_surface and "micro.model" in auto_keys(self.given)
        body = on_body(setup, None, half_space=not setup.embedded)
        cells = setup.surface.grid
        if resample:
            cells = _scaled(cells, 1.0 / _FIRST_CELLS)
        for trial in range(_TRIALS):
            model = replace(model, **_on_cells(start, setup.surface, cells, by_surface))
            errors = self._measured(setup, model, body)
            off, others = sum(errors.values()), sum(errors.values()) - errors.get("grid", 0.0)
            if off <= _SPARE * self._accuracy or not (by_surface or resample):
                break
            left = max(_SPARE * self._accuracy - others, 0.5 * others)
            if errors["grid"] <= left or max(cells) >= MOST_HEIGHTS or trial == _TRIALS - 1:
                break
            finer = (errors["grid"] / left) ** (1.0 / _ORDER)
            cells = _scaled(cells, min(max(finer, _LEAST_STEP), _LARGEST_STEP))
        return model, errors

    def _measured(self, setup: ProblemSetup, model: HalfSpaceModel, body: OnBody) -> Errors:
        """Return the errors relative to the force, at the load where their sum is largest."""
        load_history = self.given.loading.load_history
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

    def _cheapest(self, setup: ProblemSetup) -> tuple[ProblemSetup, tuple[Alternative, ...]]:
        """Return the stage with the coupling that is predicted to take least, and the others."""
        sections = [setup.scene.coupling]
        if "coupling.kind" in auto_keys(self.given):
            sections = list(couplings(self.given))
        tolerance = {"table_tolerance": 0.1 * self._accuracy}
        found = []
        for section in sections:
            if section.kind == "consistent" and section.table_tolerance is None:
                section = section.model_copy(update=tolerance)
            scene = setup.scene.model_copy(update={"coupling": section})
            found.append(replace(setup, scene=scene))
        if len(found) == 1:
            return found[0], ()
        found.sort(key=_seconds)
        return found[0], tuple(map(_alternative, found[1:]))

    @property
    def _may_be_meshed(self) -> bool:
        """Whether the scene leaves it open that its roughness be meshed."""
        stated = self.given.coupling.model_fields_set - {"kind"}
        free = auto_keys(self.given)
        return {"coupling.kind", "micro.model"} <= free and not stated

    def reference(self, setup: ProblemSetup) -> ProblemSetup:
        """Refine the meshes of a reference until its errors keep the accuracy."""
        assert setup.meshes is not None
        may_refine = self.given.reference.fine is None and not setup.meshes.hexahedral
        if may_refine and setup.scene.reference.fine is None:
            setup = self._with_meshes(setup.scene, self._first_size(setup))
        if setup.meshes is None or len(setup.meshes.shapes) == 1:  # which cannot tell of its error
            return self._decided(setup, {})
        for _ in range(_TRIALS):
            error = self._of_meshes(setup)
            fine = setup.scene.reference.fine
            if error <= self._accuracy or not may_refine or fine is None:
                break
            finer = (error / self._accuracy) ** (1.0 / setup.meshes.force_order)
            step = min(max(finer, _LEAST_STEP), _LARGEST_STEP)
            try:
                setup = self._with_meshes(setup.scene, fine / step)
            except InputError:  # more memory than there is
                break
        return self._decided(setup, {"mesh": error})

    def _of_meshes(self, setup: ProblemSetup) -> float:
        """Return the relative error of the meshes at the largest load."""
        coupling = make_reference(setup, None)
        load_history = setup.scene.loading.load_history
        step = coupling.press(load_history.control(load_history.largest))
        (found,) = coupling.record([step]).with_errors([step])
        if not step.force_N > 0.0:
            return 0.0
        if found.force_error_N is None or found.approach_error_mm is None:
            return 1.0
        if load_history.quantity == "force":
            return 1.5 * found.approach_error_mm / abs(found.approach_mm)  # F grows as δ^1.5
        return found.force_error_N / found.force_N

    def _first_size(self, setup: ProblemSetup) -> float:
        """Return the edge length to begin with [mm], from the one that is taken by default."""
        assert setup.meshes is not None
        coarser = (self._accuracy / _DEFAULT_MESHES) ** 0.5
        return float(setup.meshes.sizes[-1]) * min(max(coarser, 1.0), _COARSEST_MESH)

    def _with_meshes(self, scene: Scene, fine: float) -> ProblemSetup:
        return self.build(_meshed(scene, {"fine": fine}))

    def _decided(
        self, setup: ProblemSetup, errors: Errors, others: tuple[Alternative, ...] = ()
    ) -> ProblemSetup:
        decision = Decision(
            accuracy=self._accuracy, taken=_alternative(setup), errors=errors, others=others
        )
        return replace(setup, decision=decision)


def _on_cells(scene: Scene, surface: Surface, cells: Cells, by_surface: bool) -> dict[str, Any]:
    """Return what a half-space model of other cells has: made anew, or resampled."""
    if by_surface:
        section = scene.surface.model_copy(update={"grid": cells})
        surface = make_surface(scene.model_copy(update={"surface": section}))
        return {"surface": surface, "highest": surface.highest}
    return {"surface": resampled(surface, cells), "highest": surface.highest}


def _scaled(cells: Cells, factor: float) -> Cells:
    x, y = (
        min(max(8 * math.ceil(factor * count / 8 - 1e-9), _LEAST_CELLS), MOST_HEIGHTS)
        for count in cells
    )
    return x, y


def _meshed(scene: Scene, changes: dict[str, Any]) -> Scene:
    """Return a scene as a reference."""
    coupling = type(scene.coupling)(kind="reference")
    reference = scene.reference.model_copy(update=changes)
    return scene.model_copy(update={"coupling": coupling, "reference": reference})


def _seconds(setup: ProblemSetup) -> float:
    return predicted_cost(setup, this_machine()).total


def _alternative(setup: ProblemSetup) -> Alternative:
    if setup.meshes is not None:
        size = 1e3 * float(setup.meshes.sizes[-1])
        label = f"reference, meshed with edges of {size:.3g} µm"
    elif isinstance(setup.micro, HalfSpaceModel):
        x, y = setup.micro.surface.grid
        label = f"{setup.scene.coupling.kind} on {x} × {y} cells"
    else:
        label = f"{setup.scene.coupling.kind}, {setup.model.name}"
    return Alternative(label=label, seconds=_seconds(setup))
