"""Couplings of a micro model of the whole surface; without laws the contact problem at every step.

``analytic`` is the micro model on a half-space, ``concurrent`` the same on the scene's body: they
differ by a term of the compliance.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry import Asperities, Control, PatchGrid, Surface, rough_sides
from patchlaw.micro import AsperityModel, HalfSpaceModel, MicroModel
from patchlaw.micro.friction.friction_model import FrictionModel
from patchlaw.multiscale.bodies.bodies import SLOPES, OnBody, on_body
from patchlaw.multiscale.couplings import describe, validity
from patchlaw.multiscale.couplings.contact_solver import ContactSolver, plane_at_largest_load
from patchlaw.multiscale.couplings.pressed_surface import PressedSurface
from patchlaw.multiscale.inputs.bodies import FIELD_CELLS
from patchlaw.multiscale.inputs.cost import CELL_OF_CONTACT
from patchlaw.multiscale.inputs.scene_parts import Source
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.loading.stepper import StepSolver, load_steps
from patchlaw.multiscale.measured_errors.contact import MOST_CHECKED_CELLS, ErrorProbe
from patchlaw.multiscale.measured_errors.errors import response_of
from patchlaw.multiscale.measured_errors.shear import BY_COUPLING, checked
from patchlaw.multiscale.readable import Caution, times
from patchlaw.support.arrays import Array
from patchlaw.support.collective import on_root_alone
from patchlaw.support.errors import InputError, NotConverged

_COARSE = 32
"""Cells a side on which it is found whether friction is coupled where the scene does not say."""
MOST_NEGLECTED = 0.1
"""Largest change of the shear by the coupling that is neglected unless the scene says so."""
_FEW_CELLS = 1000
"""Cells that can touch, at most, for load steps by one matrix, of 8 MB, with the finite slopes."""


@dataclass(kw_only=True, eq=False)
class MicroCoupling(PressedSurface):
    """A micro model of the whole surface, on the body of the scene."""

    needs_plane: ClassVar[bool] = False
    """Whether something needs the plane at the largest load before the load steps."""

    micro: MicroModel

    @classmethod
    def from_scene(cls, source: Source) -> Self:
        """Make the coupling of a scene on one process; see `Coupling.from_scene`."""
        parts, scene = cls._parts(source), source.scene
        began, surface = time.perf_counter(), parts["surface"]
        model = source.micro_model(surface, parts["materials"])
        if source.cells is not None and isinstance(model, HalfSpaceModel):
            model = model.resampled(source.cells)
        if not math.isfinite(model.first_touch):
            raise InputError(
                "the surface has no summit that could carry load",
                key="micro.model",
                value=scene.micro.model,
                allowed="half-space",
            )
        solver = None
        if cls.needs_plane or scene.on_mesh or not isinstance(model, HalfSpaceModel):
            # laws end at this plane, and statements say it of summits
            solver = ContactSolver(model, parts["patches"], parts["mean_heights"])
        plane = plane_at_largest_load(parts["load_history"], solver, surface)
        parts["seconds"]["load estimate"] = time.perf_counter() - began
        return cls(micro=model, plane_at_largest_load=plane, **parts)

    @property
    def sloped_surfaces(self) -> Sequence[Surface]:
        """The rough sides of the bodies, whose slopes count."""
        sides = rough_sides(self.surface, self.counter_surface, self.materials)
        return [surface for surface, _ in sides]

    # --- the micro model and the body

    @property
    def finite_slopes(self) -> bool:
        """Whether finite slopes of the surface count."""
        return self.scene.micro.finite_slopes is not False and self.cells is not None

    @property
    def cells(self) -> tuple[int, int] | None:
        """Cells of the half-space of contact problems; None where these have no cells."""
        return self.micro.surface.grid if isinstance(self.micro, HalfSpaceModel) else None

    @cached_property
    def asperities(self) -> Asperities:
        """The surface's summits; found when first needed."""
        return super().asperities if self.summits is None else self.summits

    @property
    def summits(self) -> Asperities | None:
        """The summits that the micro model consists of; None where it knows the whole surface."""
        return self.micro.asperities if isinstance(self.micro, AsperityModel) else None

    @cached_property
    def put_on_body(self) -> OnBody:
        """What puts half-space models on the bodies, which are solved for once; collective."""
        bodies = self.bodies if self.has_body else None
        with self.clock.phase("block"):
            return on_body(bodies, self.materials, self.counter_surface)

    def model_on_body(self) -> MicroModel:
        """Return the micro model on the body that it is pressed on, finite slopes included.

        Note:
            Collective.
        """
        if isinstance(self.micro, HalfSpaceModel):
            return self.put_on_body(self.micro, SLOPES if self.finite_slopes else 0)
        if not self.has_body:
            return self.micro
        with self.clock.phase("block"):
            terms = self.bodies.terms(side_term=False)
            body = terms.term(terms.face(self.comm))
        return replace(self.micro, body=body)  # type: ignore[type-var]

    def contact_solver(self, model: MicroModel) -> ContactSolver:
        """Return what solves the contact problem of a model of the surface."""
        friction = None if self.has_laws else self.friction_model
        largest = self.load_history.largest_controls
        # with friction a run that goes on presses again, which a memory of later loads would change
        if isinstance(model, HalfSpaceModel) and friction is None and len(largest) == 1:
            quick = model.quick_up_to(largest[0])
            if quick is not None and quick.few is not None and len(quick.few) <= _FEW_CELLS:
                model = quick
        return ContactSolver(model, self.patches, self.mean_heights, self.comm, friction)

    @cached_property
    def friction_model(self) -> FrictionModel | None:
        """Friction of the surface; None where the scene has none; collective."""
        if self.scene.friction is None:
            return None
        body = None
        if self.has_body:
            with self.clock.phase("block"):
                body = self.bodies.terms(side_term=False).traction_term(self.comm)
        model = FrictionModel(
            materials=self.materials,
            coefficient=self.scene.friction.coefficient,
            spacing=self.surface.spacing,
            periodic=self.scene.surface.periodic,
            body=body,
            coupled=bool(self.scene.friction.coupled),
        )
        if self.scene.friction.coupled is not None or self.has_laws:
            return model
        on_bodies = self.put_on_body  # collective
        share = on_root_alone(self.comm, partial(self._coupled_share, model, on_bodies))
        return replace(model, coupled=share > MOST_NEGLECTED)

    @property
    def friction_is_coupled(self) -> bool:
        """Whether pressures and tractions see each other."""
        model = None if self.has_laws else self.friction_model
        return model is not None and model.coupled

    def _coupled_share(self, friction: FrictionModel, on_bodies: OnBody) -> float:
        """Return what coupling changes in the shear on a few cells, over the largest.

        It counts as in measured errors; infinite where it is not found.
        """
        assert self.cells is not None and isinstance(self.micro, HalfSpaceModel)
        grid = min(self.cells[0], _COARSE), min(self.cells[1], _COARSE)
        model, found = on_bodies(self.micro.resampled(grid), 0), []
        friction = replace(friction, spacing=model.surface.spacing)
        if friction.cross(grid) is None:
            return 0.0
        history = self.load_history.by_turning_points
        patches = PatchGrid(grid=(1, 1), lengths=model.surface.lengths)
        mean = np.array([model.surface.mean_height])
        for coupled in (False, True):
            solver = ContactSolver(
                model, patches, mean, friction=replace(friction, coupled=coupled)
            )
            try:
                steps = list(load_steps(solver, history))
            except NotConverged:
                return math.inf
            found.append(np.array([response_of(one, by_shift=history.by_shift) for one in steps]))
        largest = float(np.hypot(*found[0].T).max())
        apart = float(np.hypot(*(found[1] - found[0]).T).max())
        return BY_COUPLING * apart / largest if largest > 0.0 else 0.0

    # --- errors

    def error_probe(self) -> ErrorProbe:
        """Return what measures the errors of load steps, with a half-space model; collective."""
        assert isinstance(self.micro, HalfSpaceModel)
        return ErrorProbe(
            model=self.micro,
            on_body=self.put_on_body,
            order=SLOPES if self.finite_slopes else 0,
            by_laws=self.has_laws,
            zero=self.zero_error,
        )

    def checked(
        self, step: LoadStep, past: Sequence[LoadStep] = (), *, normal: bool = True
    ) -> LoadStep:
        """Return a load step with the errors of its normal force and of its shear measured."""
        known = None if self.has_laws else self.solver.latest
        start = None if known is None else known.guess
        probe, friction, history = self.error_probe(), self.friction_model, self.load_history
        measured = partial(checked, step, past, probe, history, friction, start, normal=normal)
        return on_root_alone(self.comm, measured)

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield why errors by the body are not known."""
        found = [error for step in steps for error in (*step.errors, *step.shear_errors)]
        if ("body", math.inf) in found:
            yield Caution(
                "the error by body is not known: its linear elements are too many for a second "
                "solution with quadratic ones; take larger cells with element = 'quadratic', whose "
                "error linear ones tell"
            )

    def coarser_gap(self, step: LoadStep, factor: int) -> Array | None:
        """Return the gaps under the load of a step on fewer cells a side."""
        if self.cells is None:
            return None
        nx, ny = (max(count // factor, 4) for count in self.cells)
        probe, control = self.error_probe(), Control(approach=step.approach_mm, tilt=step.tilt)
        if self.load_history.quantity_in(step.stage) == "force":
            control = Control(force=step.force_N, tilt=step.tilt)

        def solve() -> Array:
            model = probe.model.resampled((nx, ny))
            return probe.on_body(model, probe.order).press(control).open_gap

        return on_root_alone(self.comm, solve)

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""
        if self.cells is None:
            return f"{self.micro.name} contacts have no measure of it, half-space has"
        if self.scene.loads_bodies:
            return "the measure does not know of loads of the body besides the contact"
        return "output.check = 'none'" if self.scene.output.check == "none" else ""

    # --- what is known before the run

    @property
    def contact_memory(self) -> float:
        """Memory of the largest contact problem of cells, that of an error check included [B]."""
        if self.cells is None:
            return 0.0
        size = math.prod(self.cells)
        checked = self.finite_slopes and self.scene.output.check != "none"
        return CELL_OF_CONTACT * size * (4 if checked and 4 * size <= MOST_CHECKED_CELLS else 1)

    @property
    def interfering_summits(self) -> NDArray[np.bool_]:
        """Which summits have a positive interference, shape (n,)."""
        summits = self.asperities
        return self.interference(summits.x, summits.y, summits.z) > 0.0

    @property
    def interfering_border_maxima(self) -> int:
        """Number of maxima on the border of the surface with a positive interference."""
        cut = self.asperities
        return int(np.sum(self.interference(cut.border_x, cut.border_y, cut.border_z) > 0.0))

    # --- statements

    def describe(self) -> dict[str, str]:
        """Return what will be done and why, of summits and of the body."""
        said = super().describe()
        if self.summits is not None:
            within = f"{int(self.interfering_summits.sum())} within the largest approach"
            said["contact"] = f"{len(self.summits)} summits, {within}; the others cost nothing"
        if self.has_body and not self.body.on_mesh:
            said["block"] = describe.block(self)
        elif self.has_body:
            said |= {"body": describe.body(self), "body term": describe.body_term(self)}
        return said

    @property
    def error_causes(self) -> str:
        """The causes of errors that a run measures."""
        body = ", body" if self.has_body else "; there is no block"
        shear = "; those of the shear as well" * (self.scene.friction is not None)
        return f"grid, zero, slopes{body}{' and laws' * self.has_laws}{shear}"

    def contact_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the contact and of its micro model."""
        yield from super().contact_warnings()
        if self.summits is None:
            return
        if self.interfering_border_maxima:
            yield (
                "maxima on the surface's border within the largest approach: "
                f"{self.interfering_border_maxima}; an 8-neighbour search cannot confirm them, and "
                "they carry no load here"
            )
        if self.summits.flat:
            yield (
                f"{self.summits.flat} summits are flat, as heights in steps are: without radii "
                "they carry no load here; take micro.model = 'half-space'"
            )

    def body_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the bodies."""
        if self.body.on_mesh:
            yield from validity.of_meshes(self)
            return
        yield from validity.proportions(self)
        if not self.scene.decomposed:
            yield from validity.coarse_cells(self)

    @property
    def shows_cells(self) -> bool:
        """Whether pressures of the surface's cells will be known."""
        without = ("auto", "none") if self.has_laws else ("none",)
        return self.cells is not None and self.scene.output.contact not in without

    # --- for the record

    def surface_record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the surface alone, by name."""
        if self.summits is None:
            return {}
        return {
            "summits": self.summits.count,
            "summits_in_reach": int(self.interfering_summits.sum()),
            "border_maxima_in_reach": self.interfering_border_maxima,
        }


@dataclass(kw_only=True, eq=False)
class ConcurrentCoupling(MicroCoupling):
    """The whole surface on the scene's body at every load step, without laws."""

    shows_contacts: ClassVar[bool] = True

    def _make_solver(self) -> StepSolver:
        solver = self.contact_solver(self.model_on_body())
        if self.has_body:
            solver.held = self.bodies.terms(side_term=False).held
        return solver

    @property
    def field_parts(self) -> PatchGrid:
        """The parts of the contact face that contacts are seen on: facets of a block's mesh."""
        nx, ny, _ = FIELD_CELLS if self.body.shape is None else self.body.shape.cells
        if self.body.shape is None:
            nx, ny = map(min, self.surface.grid, (nx, ny))
        return PatchGrid(grid=(nx, ny), lengths=self.surface.lengths)

    def describe(self) -> dict[str, str]:
        """Return what will be done and why."""
        return super().describe() | {
            "coupling": "concurrent: the whole surface on the block at every load step, no laws; "
            f"{times(self.patches.grid)} patches gather the results"
        }


@dataclass(kw_only=True, eq=False)
class AnalyticCoupling(ConcurrentCoupling):
    """The micro model alone on a half-space, without finite elements."""

    has_body: ClassVar[bool] = False
    shows_contacts: ClassVar[bool] = False
    patches_interact: ClassVar[bool] = False

    def describe(self) -> dict[str, str]:
        """Return what will be done and why."""
        text = "analytic: the micro model alone on a half-space, no finite elements"
        if self.scene.surface.periodic:
            text += "; displacements, and so the approach, count from the mean of the surface"
        return super().describe() | {"coupling": text}
