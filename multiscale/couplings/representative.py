"""The coupling with laws of periodic samples at the points of a contact face.

Theory: docs/theory.md, sections 10 and 11.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from geometry import Control, PatchGrid, Regions, RigidPlane, Surface
from geometry.plausibility import check_finite_slopes
from geometry.statistics import roughness
from micro import HalfSpaceModel
from multiscale.couplings import describe
from multiscale.couplings.coupling import Coupling, Facts
from multiscale.couplings.law_coupling import LawCoupling, LawSolver, NewtonChoice
from multiscale.couplings.sample_laws import SampleLaws
from multiscale.couplings.work import (
    BYTES_PER_CELL,
    PRODUCTS,
    SET_UP_CYCLES,
    SLOPES_PRODUCTS,
    SOLUTIONS_OF_LAWS,
    Work,
)
from multiscale.inputs.block import LAW_BLOCK_CELLS, Cells, make_shape
from multiscale.inputs.body_facts import BodyFacts, second_material
from multiscale.inputs.loads import check_load, load_history_on
from multiscale.inputs.memory import law_requests
from multiscale.inputs.surfaces import RegionSamples, located, region_samples, sample_surface
from multiscale.law_solvers.embedded import EmbeddedLaws
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import BeyondLaws, step_count
from multiscale.machine import ClusterNodes, MemoryRequest
from multiscale.readable import Observer, number, quantity
from multiscale.scene.scene import Scene

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, LoadedFace

Array = NDArray[np.float64]

_TOLERANCE = 5e-4
"""Interpolation error of laws by default."""
_CYCLES_AT_POINTS = 24
"""Multigrid cycles of a load step with laws at points: 6 to 60 on four parts."""
_MANY_SAMPLES = 4.0
"""Sides of a face over those of its sample below which its law is hardly representative."""
_HALF_SPACE = 0.95
"""Mean displacement of a square of a half-space by a uniform pressure, times E*, over its side."""


@dataclass(kw_only=True, eq=False)
class RepresentativeCoupling(LawCoupling):
    """Laws of samples on the contact face of a body; they are extended where a step needs it.

    Attributes:
        samples: The samples of every region of the face.
        model: Micro model of the first sample, the periodic half-space.
    """

    samples: tuple[RegionSamples, ...]
    model: HalfSpaceModel
    _extensions: list[str] = field(default_factory=list, init=False)

    @classmethod
    def from_scene(
        cls,
        scene: Scene,
        facts: Facts,
        nodes: ClusterNodes,
        *,
        like: Coupling | None = None,
        cells: tuple[int, int] | None = None,
    ) -> Self:
        """Make the coupling of a scene on one process; see `Coupling.from_scene`."""
        began = time.perf_counter()
        cls.check_memory(scene, nodes)
        face, counter = facts
        if face is None:
            sample = sample_surface(scene, scene.surface, "surface")
            face = BodyFacts.of_block(scene, make_shape(scene, sample, cls.cells_unstated(scene)))
        samples = region_samples(scene, face.materials, second_material(scene, counter))
        surface, materials = samples[0].surfaces[0], samples[0].materials
        surfaces = tuple(one for region in samples for one in region.surfaces)
        check_load(scene, surfaces, face.area, face)
        model = HalfSpaceModel(
            surface,
            contact_modulus=materials.contact_modulus,
            periodic=True,
            hardness=scene.micro.hardness,
        )
        return cls(
            scene=scene,
            surface=surface,
            patches=PatchGrid(grid=(1, 1), lengths=surface.lengths),
            materials=materials,
            body=face,
            counter=counter,
            load_history=load_history_on(scene, surfaces),
            seconds={"surface": time.perf_counter() - began},
            samples=samples,
            model=model,
        )

    @classmethod
    def cells_unstated(cls, scene: Scene) -> Cells:
        """Return the cells of a block that a scene states none for."""
        return LAW_BLOCK_CELLS

    def __post_init__(self) -> None:
        """Refuse finite slopes of samples that are too steep for them."""
        if self.finite_slopes:
            with located(self.scene, "micro.finite_slopes"):
                for surface in self.rough_surfaces:
                    check_finite_slopes(surface)

    @classmethod
    def requests(cls, scene: Scene) -> Iterator[MemoryRequest]:
        """Yield the memory that a scene needs."""
        yield from super().requests(scene)
        yield from law_requests(scene)

    # --- what is known before the run

    @property
    def regions(self) -> Regions:
        """The regions of the face."""
        return Regions(tuple(region.name for region in self.samples))

    @property
    def area(self) -> float:
        """Nominal contact area [mm²]."""
        return self.body.area

    @property
    def rough_surfaces(self) -> tuple[Surface, ...]:
        """All samples of all regions."""
        return tuple(one for region in self.samples for one in region.surfaces)

    @property
    def finite_slopes(self) -> bool:
        """Whether finite slopes of the samples count: where the scene says so."""
        return bool(self.scene.micro.finite_slopes)

    @property
    def shown_bodies(self) -> list[BodyFacts]:
        """What is known of the bodies that the record of a run tells."""
        return [self.body] if self.counter is None else [self.body, self.counter]

    @property
    def label(self) -> str:
        """The coupling, and the cells that it works on."""
        x, y = self.surface.grid
        return f"representative on {x} × {y} cells"

    @property
    def table_tolerance(self) -> float:
        """Interpolation error that laws are tabulated to."""
        return self.scene.coupling.table_tolerance or _TOLERANCE

    @property
    def sample_plane(self) -> RigidPlane | None:
        """The plane on a sample at the largest approach; None under a force.

        The body takes part of the approach, and the plane is an upper bound.
        """
        if self.load_history.quantity == "force":
            return None
        mean = self.model.reference_height - self.surface.mean_height
        return RigidPlane.above(self.surface, min(self.load_history.largest, mean))

    def newton(self, table: LawTable | None = None) -> NewtonChoice:
        """Choose the Newton that load steps are found with."""
        return NewtonChoice(False, "laws of samples hold at the points of the mesh")

    def work(self, ranks: int = 1) -> Work:
        """Count what a run computes; see `Coupling.work`."""
        steps, size = step_count(self.scene.loading), self.surface.heights.size
        rows = SOLUTIONS_OF_LAWS * max(len(self.rough_surfaces), 1)
        unknowns = sum(facts.unknowns for facts in self.meshes) or self.body.unknowns
        return Work(
            size=int(size),
            solutions=float(rows),
            rows=rows,
            products=rows * size * PRODUCTS * (SLOPES_PRODUCTS if self.finite_slopes else 1.0),
            unknowns=unknowns,
            cycles=unknowns * (SET_UP_CYCLES + steps * _CYCLES_AT_POINTS),
            ranks=ranks,
            memory=BYTES_PER_CELL * size,
        )

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps."""
        return "laws of samples have no measure of it, but for errors between rows and scatter"

    # --- laws

    @cached_property
    def _laws(self) -> SampleLaws:
        return SampleLaws(
            scene=self.scene,
            bodies=self.bodies,
            samples=self.samples,
            model=self.model,
            load_history=self.load_history,
            finite_slopes=self.finite_slopes,
            tolerance=self.table_tolerance,
        )

    def _make_table(self, observe: Observer | None) -> LawTable:
        """Tabulate the laws; collective."""
        return self._laws.table(observe)

    # --- load steps

    def _make_solver(self, table: LawTable) -> LawSolver:
        """Make what finds load steps from laws at the points of the mesh."""
        return self._solver_on(self.bodies.contact_face(), table)

    def _solver_on(self, face: LoadedFace | FacePair, table: LawTable) -> EmbeddedLaws:
        from macro import FacePair, LawContactProblem

        problem = LawContactProblem(face, table.laws, mode="pointwise", crown=self._crown())
        if not isinstance(face, FacePair):  # such laws are steep: 3 steps of Newton instead of 11
            problem.start_from(np.ones(face.patches.count))
        return EmbeddedLaws(problem, table, face)

    def _crown(self) -> Callable[[Array, Array], Array] | None:
        """Return the depth of a crowned face at points of its plane [mm]; None without a crown."""
        radii = self.scene.law.crown
        if radii is None:
            return None
        middle = 0.5 * np.asarray(self.body.lengths)
        curvature = [0.0 if one == "inf" else 1.0 / float(one) for one in radii]

        def depth(x: Array, y: Array) -> Array:
            along, across = x - middle[0], y - middle[1]
            return 0.5 * (curvature[0] * along**2 + curvature[1] * across**2)

        return depth

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step, with longer laws where these end too early."""
        while True:
            try:
                return super().press(control)
            except BeyondLaws:
                longer = self._laws.table(None, before=self.table)
                if longer is self.table:
                    raise
                last, face = self._solver.state(), self._solver.face
                self.table, self._solver = longer, self._solver_on(face, longer)
                self._solver.restore(last)
                self._extensions.append(
                    f"the laws were extended to {number(longer.largest_pressure)} MPa, which a "
                    "load step needed"
                )

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the approximations behind load steps."""
        if self.table is not None:
            yield from self.table.notes(self.table_tolerance)
        yield from super().notes(steps)
        yield from self._extensions

    @property
    def areas(self) -> Array:
        """Nominal areas of the regions, shape (N,) [mm²]."""
        return np.asarray(self._solver.face.areas)

    def face_pressures(self) -> Array | None:
        """Return places on the face and the pressures there; see `Coupling.face_pressures`."""
        return self._embedded.face_pressures() if "_solver" in self.__dict__ else None

    @property
    def _embedded(self) -> EmbeddedLaws:
        solver = self._solver
        assert isinstance(solver, EmbeddedLaws)
        return solver

    def field_state(self, step: LoadStep) -> Any:
        """Return this rank's displacements of the mesh and pressures at its points."""
        return self._embedded.displacement, self._embedded.point_pressures

    def write_fields(
        self, path: Path, states: Mapping[int, Any], steps: Sequence[LoadStep]
    ) -> None:
        """Write the fields of the body; the first body alone has the pressures."""
        from multiscale.couplings.fields import write_displaced

        def pressures(step: int, counter: bool) -> Any:
            return None if counter else states[step][1]

        moved = {step: state[0] for step, state in states.items()}
        write_displaced(path, self._solver.face, moved, pressures)

    # --- statements

    def contact_statement(self) -> str:
        """Say what is in contact."""
        cells, plane = f"{self.surface.heights.size} cells", self.sample_plane
        if plane is None:
            return cells
        surface = self.surface
        depth = surface.highest - surface.heights
        within = plane.at(surface.x[:, None], surface.y) > depth
        return f"{cells}, {int(within.sum())} within the largest approach"

    def model_statement(self) -> str:
        """Say which micro model solves contacts, and how."""
        micro = self.scene.micro
        unused = micro.solver != type(micro)().solver
        return f"{self.model.name}; it has no use for micro.solver" if unused else self.model.name

    def coupling_statement(self) -> str:
        """Say what the laws are made from."""
        parts = []
        for region in self.samples:
            x, y = (quantity(side, "mm") for side in region.surfaces[0].lengths)
            count = len(region.surfaces)
            samples = f"{count} periodic samples" if count > 1 else "a periodic sample"
            parts.append(f"{region.name}: {samples} of {x} × {y}")
        return f"representative: {'; '.join(parts)}; the law holds at every point of the face"

    def body_statements(self) -> Iterator[tuple[str, str]]:
        """Yield what the bodies are, with topics."""
        yield "body", describe.body(self)

    def error_statement(self) -> str:
        """Say how the run will know its error."""
        return f"not measured: {self.unmeasured()}"

    @property
    def size(self) -> float:
        """Size of the interferences, or of the roughness where these are not known [mm]."""
        plane, surface = self.sample_plane, self.surface
        if plane is None:
            return roughness(surface).sq
        depth = surface.highest - surface.heights
        interference = plane.at(surface.x[:, None], surface.y) - depth
        return max(plane.approach, float(interference.max()))

    @property
    def shows_cells(self) -> bool:
        """Whether pressures of cells will be known: never those of the whole face."""
        return False

    def body_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the bodies, and whether samples can stand for the face."""
        yield from describe.mesh_warnings(self)
        side = math.sqrt(self.body.area)
        for region in self.samples:
            largest = max(max(surface.lengths) for surface in region.surfaces)
            if side < _MANY_SAMPLES * largest:
                yield (
                    f"the sample of {region.name} is {quantity(largest, 'mm')} long and the face "
                    f"about {quantity(side, 'mm')}: a sample stands for faces that are much larger"
                )
            if region.mirrored:
                yield (
                    f"the heights of {region.name} do not continue periodically: their sample is "
                    "four mirror images, twice as long and wide"
                )
        history, second = self.load_history, self.materials.second
        if self.both_elastic and second is not None and history.quantity == "force":
            pressure = history.largest / self.body.area
            moved = _HALF_SPACE * pressure * side * second.surface_compliance
            yield (
                "the compliance of the counter-body, a half-space, counts on the scale of the "
                f"sample alone; under the whole face it would add about {1e3 * moved:.3g} µm: give "
                "it a mesh where that matters"
            )

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        return {"micro_model": {"name": self.model.name}}
