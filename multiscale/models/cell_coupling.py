"""The couplings `analytic` and `concurrent`: the contact of the whole surface at every load step.

``analytic`` is the micro model on a half-space, ``concurrent`` the same on the scene's body: they
differ by a term of the compliance.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.patches import field_means
from patchlaw.micro import FrictionModel, HalfSpaceModel, MicroModel
from patchlaw.micro.boundary_elements.finite_slopes import SLOPES
from patchlaw.micro.half_space.error_probe import ErrorProbe, OnBody, error_by_cells, on_grid
from patchlaw.multiscale.bodies.bodies import on_body
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models import describe
from patchlaw.multiscale.models.cell_contact import CellContact
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.errors import ERRORS_OF, WearErrors
from patchlaw.multiscale.models.measured_errors.shear import (
    BY_COUPLING,
    Walks,
    measured_errors,
    response_of,
)
from patchlaw.multiscale.models.problem import Model, Problem
from patchlaw.multiscale.scene.parts import FIELD_CELLS, SceneParts
from patchlaw.support import Array, NotConverged, on_root_alone
from patchlaw.support.readable import Caution, times

_COARSE = 32
"""Cells a side on which it is found whether friction is coupled where the scene does not say."""
MOST_NEGLECTED = 0.1
"""Largest change of the shear by the coupling that is neglected unless the scene says so."""
_FEW_CELLS = 1000
"""Cells that can touch, at most, for load steps by one matrix, of 8 MB, with the finite slopes."""


class CellCoupling(Coupling):
    """A micro model of the whole surface, on the body of the scene or a half-space."""

    _coarser: tuple[int, dict[CellContact, LoadStep]] = 0, {}
    """What has worn on fewer cells, as far as so many load steps, each with the last of them."""

    @property
    def micro(self) -> MicroModel:
        """The micro model of the surface on a half-space."""
        assert self.parts.micro is not None
        return self.parts.micro

    @cached_property
    def _walks(self) -> Walks:
        """How far the path of the shear was gone again when its errors were measured last."""
        return {}

    # --- what is said of it

    @property
    def label(self) -> str:
        """The coupling, and the cells or micro model that it works on, in few words."""
        if self.parts.cells is None:
            return f"{self.scene.kind}, {self.micro.name}"
        return f"{self.scene.kind} on {times(self.parts.cells)} cells"

    @property
    def statement(self) -> str:
        """What the coupling is, in a sentence."""
        if self.scene.has_body:
            text = "concurrent: the whole surface on the block at every load step, no laws"
            return f"{text}; {describe.gathered(self.parts)}"
        text = "analytic: the micro model alone on a half-space, no finite elements"
        if self.scene.surface.periodic:
            text += "; displacements, and so the approach, count from the mean of the surface"
        return text

    @property
    def causes(self) -> str:
        """Causes of the errors that are measured, in words."""
        return f"grid, zero, slopes{', body' if self.scene.has_body else '; there is no block'}"

    @property
    def unmeasured(self) -> str:
        """Why errors cannot be measured; empty where they can."""
        if self.parts.cells is None:
            return f"{self.micro.name} contacts have no measure of it, half-space has"
        if self.scene.loads_bodies:
            return "the measure does not know of loads of the body besides the contact"
        return ""

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield whether the error by the body is known."""
        found = [error for step in steps for error in (*step.errors, *step.shear_errors)]
        if ("body", math.inf) in found:
            yield Caution(
                "the error by body is not known: its linear elements are too many for a second "
                "solution with quadratic ones; take larger cells with element = 'quadratic', whose "
                "error linear ones tell"
            )

    # --- on the body

    @cached_property
    def put_on_body(self) -> OnBody:
        """What puts half-space models on the bodies, which are solved for once; collective."""
        parts = self.parts
        with self.clock.phase("block"):
            terms = self.bodies.terms(side_term=True) if self.scene.has_body else None
            return on_body(terms, parts.materials, parts.counter_surface, comm=self.comm)

    def model_on_body(self) -> MicroModel:
        """Return the micro model on the body that it is pressed on, finite slopes included.

        Note:
            Collective.
        """
        if isinstance(self.micro, HalfSpaceModel):
            return self.put_on_body(self.micro, SLOPES if self.parts.finite_slopes else 0)
        if not self.scene.has_body:
            return self.micro
        with self.clock.phase("block"):
            terms = self.bodies.terms(side_term=False)
            body = terms.term(terms.face(self.comm))
        return replace(self.micro, body=body)  # type: ignore[type-var]

    def contact_of(self, model: MicroModel) -> CellContact:
        """Return the contact problem of a model of the surface."""
        friction = None if self.scene.by_laws else self.friction_model
        wear = 0.0 if self.scene.wear is None else self.scene.wear.coefficient
        largest = self.parts.path.largest_controls
        # with friction a run that goes on presses again, which a memory of later loads would change
        remembers = friction is None and not wear
        if isinstance(model, HalfSpaceModel) and remembers and len(largest) == 1:
            quick = model.quick_up_to(largest[0])
            if quick is not None and quick.few is not None and len(quick.few) <= _FEW_CELLS:
                model = quick
        parts = self.parts
        return CellContact(model, parts.patches, parts.mean_heights, self.comm, friction, wear)

    def _make_model(self) -> Model:
        made = self.contact_of(self.model_on_body())
        if self.scene.has_body and any(self._meshes):  # whose supports may lie beside the face
            made.held = self.bodies.terms(side_term=False).held
        return made

    @cached_property
    def friction_model(self) -> FrictionModel | None:
        """Friction of the surface; None where the scene has none; collective."""
        parts, body = self.parts, None
        if self.scene.friction is None:
            return None
        if self.scene.has_body:
            with self.clock.phase("block"):
                body = self.bodies.terms(side_term=False).traction_term(self.comm)
        pressed = self.micro.surface if isinstance(self.micro, HalfSpaceModel) else parts.surface
        model = FrictionModel(
            materials=parts.materials,
            coefficient=self.scene.friction.coefficient,
            spacing=pressed.spacing,
            periodic=self.scene.surface.periodic,
            body=body,
            coupled=bool(self.scene.friction.coupled),
            wear=0.0 if self.scene.wear is None else self.scene.wear.coefficient,
        )
        stated = self.scene.friction.coupled is not None or not self.scene.loading.shear_key
        if stated or self.scene.by_laws:
            return model
        on_bodies = self.put_on_body  # collective
        share = on_root_alone(self.comm, partial(_coupled_share, parts, model, on_bodies))
        return replace(model, coupled=share > MOST_NEGLECTED)

    @property
    def friction_is_coupled(self) -> bool:
        """Whether pressures and tractions see each other."""
        model = None if self.scene.by_laws else self.friction_model
        return model is not None and model.coupled

    # --- errors

    def error_probe(self) -> ErrorProbe:
        """Return what measures the errors of load steps, with a half-space model; collective."""
        assert isinstance(self.micro, HalfSpaceModel)
        return ErrorProbe(
            model=self.micro,
            on_body=self.put_on_body,
            order=SLOPES if self.parts.finite_slopes else 0,
            by_laws=self.scene.by_laws,
            zero=self.parts.zero_error,
            tell=self.clock.tell,
        )

    def measured_errors(
        self, step: LoadStep, past: Sequence[LoadStep] = (), *, normal: bool = True
    ) -> dict[str, Any]:
        """Measure the errors of the normal force and of the shear of a load step."""
        known = None if self.scene.by_laws else self.model.latest
        start = None if known is None else known.guess
        sheared = self.scene.rubs_on_mesh or self.scene.loading.shear_key
        probe, friction = self.error_probe(), self.friction_model if sheared else None
        behind = self._worn_by(step)

        def measured() -> dict[str, Any]:
            own, pressed, worn = probe, None, None if known is None else known.worn_depth
            wears = self.scene.wear is not None and not sheared
            wear = WearErrors((0.0,) * 6) if wears else None
            if behind is not None:  # laws stand for cells that have worn
                own = replace(probe, model=as_worn(probe.model, behind))
                apart = {"laws": self._worn_apart(step, behind)}
                wear = WearErrors(self.errors_of_wear(step), apart)
            elif worn is not None:
                stiffness = step.approach_stiffness_N_per_mm
                slope = math.nan if stiffness is None else stiffness
                slope = slope if step.force_N else 0.0
                by_cells, off = self._wear_error_by_cells([*past, step], probe, friction, slope)
                pressed = replace(probe, model=as_worn(probe.model, worn), by_cells=by_cells)
                assert isinstance(self.model, CellContact)
                # the steps of a shear are a cause of their own
                wear = None if sheared else WearErrors(self.model.wear_errors, {"grid": off})
            every = normal or worn is not None or behind is not None
            options: Any = {"normal": every, "pressed": pressed, "walks": self._walks}
            return measured_errors(step, past, own, friction, start, wear=wear, **options)

        return on_root_alone(self.comm, measured)

    def _worn_by(self, step: LoadStep) -> Array | None:
        """Return what has worn off the cells behind laws by a load step; None without laws."""
        return None

    def errors_of_wear(self, step: LoadStep) -> tuple[float, ...]:
        """Return the errors by the steps of wear under laws, see `micro.wear.Worn`; none here."""
        return (0.0,) * 6

    def _worn_apart(self, step: LoadStep, behind: Array) -> Array:
        """Return what depths of a load step, mean and largest of patches, err by the laws, (2,).

        Args:
            step: The load step.
            behind: The depth that has worn off the cells behind the laws, shape (nx, ny) [mm].
        """
        means = field_means(behind, self.parts.surface.lengths, self.parts.patches)
        known = np.array([step.mean_worn_depth_mm, step.worn_depth_mm], float)
        return np.abs(known - [behind.mean(), means.max()])

    def _wear_error_by_cells(
        self,
        steps: Sequence[LoadStep],
        probe: ErrorProbe,
        friction: FrictionModel | None,
        slope: float,
    ) -> tuple[Array, Array]:
        """Return errors by the cells of a worn surface.

        The surface wears once more on half and on a quarter of the cells along a side.

        Args:
            steps: The load steps so far.
            probe: What has the model of the surface as it was made.
            friction: Friction under a shear; None without.
            slope: Change of the force with the approach [N/mm].

        Returns:
            Those of force, contact area fraction and mean gap, shape (3,), and of the mean and the
            largest worn depth, shape (2,).
        """
        assert self.scene.wear is not None
        nx, ny = probe.model.surface.grid
        pressed, coarser = self._coarser
        if not coarser or pressed > len(steps):
            pressed, coarser = 0, {}
            for some in (2, 4):
                coarse = probe.model.resampled((max(nx // some, 4), max(ny // some, 4)))
                rubs = friction and replace(friction, spacing=coarse.surface.spacing)
                model, wear = probe.on_body(coarse, probe.order), self.scene.wear.coefficient
                coarser[CellContact(model, friction=rubs, wear=wear)] = steps[-1]
        self._coarser = 0, {}  # where a step is not found all begin anew
        for step in steps[pressed:]:
            assert step.control is not None
            coarser = {one: one.press(step.control) for one in coarser}
        self._coarser = len(steps), coarser
        found = [steps[-1], *coarser.values()]
        names = "approach_mm", "force_N", *ERRORS_OF, "mean_worn_depth_mm", "worn_depth_mm"
        read = np.array([[getattr(one, name) for name in names] for one in found])
        approach, force, area, gap, mean, largest = error_by_cells(*read)
        # borders of worn spots follow cells, and may not be as jagged as their area allows for
        touching = float((self.model.latest.pressures > 0.0).mean())
        area = max(area, touching - steps[-1].contact_area_fraction)
        normal = np.array([approach * slope if steps[-1].by_force else force, area, gap])
        return normal, np.array([mean, largest])

    def other_gap(self, step: LoadStep, factor: int = 1, *, worn: bool = False) -> Array | None:
        """Return the gaps under the load of a step, solved once more; see `Coupling.other_gap`."""
        if self.parts.cells is None:
            return None
        nx, ny = (max(count // factor, 4) for count in self.parts.cells)
        probe, control = self.error_probe(), Control(approach=step.approach_mm, tilt=step.tilt)
        if step.by_force:
            control = Control(force=step.force_N, tilt=step.tilt)

        def solve() -> Array:
            known = self.model.latest
            depth = None if known is None else known.worn_depth
            if worn and depth is not None and isinstance(self.model, CellContact):
                depth = depth + self.model.past.slid.apart
            whole = probe.model if depth is None else as_worn(probe.model, depth)
            start = by_slopes = None
            if known is not None and not self.scene.by_laws:
                values = on_grid(known.pressures, (nx, ny))
                start = replace(known.guess, values=values, by_slopes=None)
                by_slopes = None if known.by_slopes is None else on_grid(known.by_slopes, (nx, ny))
            order = probe.order if by_slopes is None else 0  # slopes are those of the step
            model = probe.on_body(whole.resampled((nx, ny)), order)
            return model.press(control, start=start, displaced=by_slopes).open_gap

        return on_root_alone(self.comm, solve)

    @property
    def field_parts(self) -> PatchGrid:
        """The parts of the contact face that contacts are seen on: facets of a block's mesh."""
        if not self.scene.shows_contacts:
            return super().field_parts
        shape, surface = self.parts.body.shape, self.parts.surface
        nx, ny, _ = FIELD_CELLS if shape is None else shape.cells
        if shape is None:
            nx, ny = map(min, surface.grid, (nx, ny))
        return PatchGrid(grid=(nx, ny), lengths=surface.lengths)


def as_worn(model: HalfSpaceModel, depth: Array) -> HalfSpaceModel:
    """Return the model of a surface that has worn, whose approach counts as before.

    Args:
        model: The model of the surface as it was made, without finite slopes.
        depth: The depth that has worn off, shape (nx, ny) [mm].
    """
    surface, highest = model.surface, model.reference_height
    return replace(
        model, surface=replace(surface, heights=surface.heights - depth), highest=highest
    )


def _coupled_share(parts: SceneParts, friction: FrictionModel, on_bodies: OnBody) -> float:
    """Return what coupling changes in the shear on a few cells, over the largest.

    It counts as in measured errors; infinite where it is not found.
    """
    assert parts.cells is not None and isinstance(parts.micro, HalfSpaceModel)
    grid = min(parts.cells[0], _COARSE), min(parts.cells[1], _COARSE)
    model, found = on_bodies(parts.micro.resampled(grid), 0), []
    friction = replace(friction, spacing=model.surface.spacing, wear=0.0)
    if friction.cross(grid) is None:
        return 0.0
    for coupled in (False, True):
        contact = CellContact(model, friction=replace(friction, coupled=coupled))
        try:
            steps = list(Problem(contact, parts.path.turning_points).steps())
        except NotConverged:
            return math.inf
        found.append(np.array([response_of(one) for one in steps]))
    largest = float(np.hypot(*found[0].T).max())
    apart = float(np.hypot(*(found[1] - found[0]).T).max())
    return BY_COUPLING * apart / largest if largest > 0.0 else 0.0
