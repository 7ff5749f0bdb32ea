"""The reference among the couplings: the rough surface itself is meshed and pressed.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from scipy.optimize import brentq

from geometry import Control, PatchGrid, RefinedShape, RigidPlane
from geometry.contact_state import ContactState, Spots, peaks_of
from geometry.meshes.families import ContactMap
from micro import HalfSpaceModel, influence_matrix
from multiscale.couplings import describe
from multiscale.couplings.contact_solver import on_few_cells, plane_at_largest_load
from multiscale.couplings.cost import SET_UP_CYCLES, Work
from multiscale.couplings.coupling import Meshes, Source
from multiscale.couplings.pressed_surface import PressedSurface
from multiscale.inputs.bodies import Cells, SceneBody, block_section
from multiscale.inputs.reference_meshes import (
    ReferenceMeshes,
    check_reference_memory,
    reference_meshes,
    reference_requests,
)
from multiscale.inputs.surfaces import located
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import StepSolver, step_count
from multiscale.machine import ClusterNodes, MemoryRequest
from multiscale.results.reference_record import ReferenceRecord, reference_record
from multiscale.scene.scene import Scene
from support.arrays import Array
from support.collective import on_root

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from geometry.meshes.families import Shape
    from macro import Block, FaceContactState, MeshQuality, RoughFace, UnilateralContactProblem
    from macro.contact.rough_body import FlatBody


_COUNTED = 0.9
"""Part of what the face of a body moves that its meshes count on."""

_MOST_CELLS = 512
"""Heights along a side on which contact is estimated."""


class RoughMesh(NamedTuple):
    """A body meshed with its roughness.

    Attributes:
        problem: Its contact problem.
        quality: How far the roughness has deformed its cells.
    """

    problem: UnilateralContactProblem
    quality: MeshQuality


class ReferenceSolver(StepSolver):
    """Presses all meshes alike; load steps are those of the finest, with the others beside it.

    Args:
        meshes: The meshes, from coarse to fine.
        patches: What results are summed over.

    Attributes:
        meshes: The meshes.
    """

    on_mesh = True

    def __init__(self, meshes: Sequence[RoughMesh], patches: PatchGrid) -> None:
        self.meshes, self._patches = meshes, patches
        self._last: tuple[FaceContactState, ...] = ()

    @property
    def finest(self) -> UnilateralContactProblem:
        """The contact problem that the load steps are those of."""
        return self.meshes[-1].problem

    @property
    def latest(self) -> FaceContactState | None:
        """The finest block at the latest load step; None before the first."""
        return self._last[-1] if self._last else None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step on every mesh; see `StepSolver.press`."""
        self._last = states = tuple(one.problem.solve(control) for one in self.meshes)
        patches = self._patches
        finest, nominal = states[-1], patches.area * patches.count
        # patches count whole nodes; all together they have the area with its border in the facets
        share = (finest.contact_area or 0.0) / finest.nodal_area if finest.nodal_area else 0.0
        return LoadStep.of_patches(
            patches,
            plane=(finest.approach, *finest.tilt),
            load=(finest.force, *finest.moment),
            closure=finest.patch_closure,
            pressure=finest.patch_pressure,
            area_fraction=share * finest.patch_area / patches.area,
            separation=finest.mean_separation,
            contacts=finest.contacts,
            newton_iterations=sum(state.iterations for state in states),
            linear_iterations=sum(state.linear_iterations for state in states),
            reason=finest.reason,
            imbalance=(finest.force - finest.reaction) / finest.force if finest.force else 0.0,
            peak_pressure_MPa=finest.peak_pressure,
            meshes=tuple(
                (state.approach, state.force, (state.contact_area or 0.0) / nominal)
                for state in states
            ),
        )

    def detail(self, latest: FaceContactState) -> ContactState:
        """Return the spots and fields of a contact.

        The area of a spot is that of its nodes times the area with its border in the facets over
        that of all nodes, so that the areas of all spots add up to the load step's.
        """
        from macro import nodal_contact

        nodes = nodal_contact(self.finest, latest)
        touching = np.flatnonzero(nodes.region >= 0)
        region, count = nodes.region[touching], latest.contacts
        share = (latest.contact_area or 0.0) / latest.nodal_area if latest.nodal_area else 0.0
        top = touching[peaks_of(region, nodes.pressure[touching], count)]
        some = nodes.area > 1e-9 * nodes.area.max()  # quadratic triangles: vertices have none
        spots = Spots(
            place=np.stack([nodes.x[top], nodes.y[top]], axis=1),
            area=share * np.bincount(region, nodes.area[touching], minlength=count),
            force=np.bincount(region, nodes.force[touching], minlength=count).astype(np.float64),
            peak_pressure=nodes.pressure[top],
        )
        return ContactState(
            plane=latest.plane,
            patches=self._patches,
            force=latest.force,
            spots=spots,
            x=nodes.x[some],
            y=nodes.y[some],
            pressure=nodes.pressure[some],
            gap=nodes.gap[some],
        )

    def state(self) -> Any:
        """Return the plane on every mesh."""
        return tuple((state.approach, *state.tilt) for state in self._last)

    def restore(self, state: Any) -> None:
        """Press every mesh by its plane again."""
        self._last = tuple(
            one.problem.solve(Control(approach=approach, tilt=(tx, ty)))
            for one, (approach, tx, ty) in zip(self.meshes, state, strict=False)
        )

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Any:
        """Return the finest block at the latest load step."""
        return self.latest

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of the finest rough block."""
        from macro import write_rough_fields

        write_rough_fields(path, self.finest, sorted(states.items()))

    @property
    def meshed_bodies(self) -> list[Any]:
        """The rough blocks, the finest last."""
        return [one.problem.body for one in self.meshes]

    @property
    def unknowns(self) -> int:
        """Degrees of freedom of the finest mesh."""
        return self.finest.body.dofs


@dataclass(kw_only=True, eq=False)
class ReferenceCoupling(PressedSurface):
    """The rough surface of a body, meshed ever finer and pressed alike at every load step.

    All meshes see the same loads, halved steps included, and every accepted step has its error bar.
    The patches are what results are summed over; they do not change the solution.

    Attributes:
        arranged: The meshes; None on a body from a mesh until the coupling is attached to it.
        nodes: The nodes of the run.
    """

    meshes_roughness: ClassVar[bool] = True
    patches_interact: ClassVar[bool] = False

    nodes: ClusterNodes
    arranged: ReferenceMeshes | None = None

    @classmethod
    def from_scene(cls, source: Source) -> Self:
        """Make the coupling of a scene on one process; see `Coupling.from_scene`."""
        parts, scene = cls._parts(source), source.scene
        began, surface = time.perf_counter(), parts["surface"]
        model = HalfSpaceModel(surface, contact_modulus=parts["materials"].contact_modulus)
        plane = plane_at_largest_load(parts["load_history"], on_few_cells(model), surface)
        assert plane is not None
        parts["seconds"]["load estimate"] = time.perf_counter() - began
        coupling = cls(plane_at_largest_load=plane, nodes=source.nodes, **parts)
        if scene.block is not None:
            compliance = _block_compliance(scene, surface.lengths, parts["body"].depth)
            coupling.arranged = coupling._arranged(coupling._plane_over_face(compliance))
        return coupling

    def attach(self, comm: Any, meshes: Meshes) -> None:
        """Put the coupling on its body, and arrange the meshes by how far its face sinks."""
        super().attach(comm, meshes)
        first = self._meshes[0]
        if first is None:
            return
        compliance = _face_compliance(first, self.surface.lengths)
        self.arranged = on_root(comm, lambda: self._arranged(self._plane_over_face(compliance)))

    def _arranged(self, plane: RigidPlane) -> ReferenceMeshes:
        """Return the meshes under a plane in coordinates of the rough face; on one process."""
        scene, surface = self.scene, self.surface
        check_reference_memory(scene, surface, plane, self.nodes)
        contact = self._contact_under(plane)
        found = reference_meshes(scene, surface, self.body, plane, contact)
        check_reference_memory(scene, surface, plane, self.nodes, found)
        return found

    def _contact_under(self, plane: RigidPlane) -> ContactMap:
        """Return where a half-space would be in contact under a plane.

        A body moves that little: contacts under the same load differ by finite slopes alone.
        """
        count_x, count_y = self.surface.grid
        model = HalfSpaceModel(self.surface, contact_modulus=self.materials.contact_modulus)
        model = model.resampled((min(count_x, _MOST_CELLS), min(count_y, _MOST_CELLS)))
        state = model.press(Control(approach=plane.approach, tilt=plane.tilt))
        if state.pressures is None or not state.contacts:
            return ContactMap.of_interference(self.surface, plane.approach, tilt=plane.tilt)
        found = ContactMap.of_pressures(
            model.surface, np.reshape(state.pressures, model.surface.grid)
        )
        return found.with_islands(self.surface, plane.approach, plane.tilt)

    @property
    def rough_meshes(self) -> ReferenceMeshes:
        """The meshes, from coarse to fine."""
        assert self.arranged is not None
        return self.arranged

    def _plane_over_face(self, compliance: Array) -> RigidPlane:
        """Return the rigid plane at the largest load in coordinates of the face that has moved.

        Under a prescribed force the plane on a half-space is that. At a prescribed approach the
        body takes a part of it; a tenth of that is kept in reserve.

        Args:
            compliance: Displacement of the face and its slopes by a mean pressure of 1 MPa, beyond
                those of a half-space, shape (3,).
        """
        plane = self.plane
        if self.load_history.quantity != "approach":
            return plane
        model = HalfSpaceModel(self.surface, contact_modulus=self.materials.contact_modulus)
        solver = on_few_cells(model)
        turns = np.array([1.0, 0.0, 0.0] if self.scene.loading.tilt == "free" else [1.0, 1.0, 1.0])

        def over_face(pressure: float) -> RigidPlane:
            moved = _COUNTED * pressure * compliance * turns
            tilt = plane.tilt[0] - moved[1], plane.tilt[1] - moved[2]
            return RigidPlane.above(self.surface, plane.approach - float(moved[0]), tilt)

        def excess(pressure: float) -> float:
            """Return what a half-space bears under the plane over the face, less the pressure."""
            at = over_face(pressure)
            step = solver.press(Control(approach=at.approach, tilt=at.tilt))
            return step.force_N / self.area - pressure

        most = excess(0.0)
        if most <= 0.0:
            return plane
        return over_face(brentq(excess, 0.0, most, rtol=0.01) if excess(most) < 0.0 else most)

    @classmethod
    def block_cells(cls, scene: Scene) -> Cells | None:
        """Return no cells: a flat block is never meshed beside the rough ones."""
        return None

    @property
    def label(self) -> str:
        """The coupling, and the meshes that it works on."""
        size = 1e3 * float(self.rough_meshes.sizes[-1])
        return f"reference, meshed with edges of {size:.3g} µm"

    # --- load steps

    @cached_property
    def solver(self) -> ReferenceSolver:
        """The rough blocks, meshed when first needed; collective."""
        with self.clock.phase("block"):
            return self._make_solver()

    def _make_solver(self) -> ReferenceSolver:
        """Mesh the rough blocks."""
        from macro import UnilateralContactProblem

        made, surface, flat = [], self.surface, self._flat_body()
        for shape in self.rough_meshes.shapes:
            finest = shape is self.rough_meshes.shapes[-1]
            with located(self.scene, "surface"):
                body, quality = self._rough(shape, flat)
            problem = UnilateralContactProblem(
                body,
                surface.highest - surface.mean_height,
                method=self.scene.reference.method,
                patches=self.patches if finest else None,
            )
            made.append(RoughMesh(problem, quality))
        return ReferenceSolver(made, self.patches)

    def _flat_body(self) -> FlatBody | None:
        """Return the body from a mesh; None of a block."""
        first, section = self._meshes[0], self.scene.body
        if first is None or section is None:
            return None
        from macro.contact.rough_body import FlatBody

        tag = first.body.mesh.facet_tag(section.contact)
        with located(self.scene, "body.mesh"):
            return FlatBody(
                body=first.body, contact=tag, frame=first.frame, lengths=self.surface.lengths
            )

    def _rough(self, shape: Shape, flat: FlatBody | None) -> tuple[Block | RoughFace, MeshQuality]:
        """Return a body with its roughness meshed."""
        from mpi4py import MPI

        from macro import Block, rough_block_mesh

        if flat is not None:
            assert isinstance(shape, RefinedShape)
            return flat.rough(shape, self.surface)
        mesh, quality = rough_block_mesh(shape, self.surface, self.comm or MPI.COMM_SELF)
        section = block_section(self.scene)
        return Block(mesh, section.material, sides=section.sides), quality

    def with_mesh_errors(
        self, steps: Sequence[LoadStep]
    ) -> tuple[tuple[LoadStep, ...], ReferenceRecord | None]:
        """Return load steps with the errors of the meshes, and the results of all meshes.

        Where all meshes miss contacts that must exist, their agreement is no error bar.

        Args:
            steps: Load steps of this coupling.
        """
        record = self.all_meshes(steps)
        return record.with_errors(steps), record

    def all_meshes(self, steps: Sequence[LoadStep]) -> ReferenceRecord:
        """Return the results of all meshes together, with their error bars.

        Args:
            steps: Load steps of this coupling.
        """
        meshes = self.rough_meshes
        record = reference_record(
            steps,
            meshes.sizes,
            [one.problem.body.dofs for one in self.solver.meshes],
            force_order=meshes.force_order,
            area_order=meshes.area_order,
            scatter=meshes.scatter(
                np.array([step.contact_area_fraction for step in steps], float),
                np.array([step.contacts for step in steps], float),
            ),
        )
        return record.without_bars(np.array([self._misses(step) for step in steps], dtype=bool))

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the errors of the reference.

        Args:
            steps: Load steps of this coupling.
        """
        yield self.all_meshes(steps).sentence
        missed = [step.step for step in steps if self._misses(step)]
        if missed:
            yield (
                f"no node of the finest mesh touches in {len(missed)} of {len(steps)} load steps, "
                f"first in step {missed[0]}, though the plane lies below the surface's highest "
                "point: the mesh is too coarse for contact there, and the force zero; refine "
                f"{self.rough_meshes.key}"
            )
        thinnest = min(one.quality.thinnest for one in self.solver.meshes)
        steepest = max(one.quality.steepest for one in self.solver.meshes)
        yield (
            f"the roughness leaves the cells at least {thinnest:.2g} of their volume; the steepest "
            f"edge of the top has a slope of {steepest:.2g}"
        )

    def _misses(self, step: LoadStep) -> bool:
        """Whether no node touches though the plane lies below the surface's highest point."""
        arm = np.subtract(self.surface.highest_point, np.multiply(0.5, self.surface.lengths))
        return not step.contacts and step.approach_mm + float(arm @ np.asarray(step.tilt)) > 0.0

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""
        several = len(self.rough_meshes.shapes) > 1
        return "" if several else "one mesh has no error bar (reference.meshes = 2)"

    @property
    def checks_steps(self) -> bool:
        """Further solutions measure nothing; the meshes of a load step do."""
        return False

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        made = self.made_solver
        qualities = (
            [one.quality for one in made.meshes] if isinstance(made, ReferenceSolver) else []
        )
        return {"method": self.scene.reference.method, "mesh_quality": qualities}

    # --- what is known before the run

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, with its meshes."""
        yield from super().memory_requests()
        yield from reference_requests(self.scene, self.rough_meshes)

    def work(self, ranks: int = 1) -> Work:
        """Count what a run computes; see `Coupling.work`."""
        unknowns = sum(self.rough_meshes.unknowns)
        steps = step_count(self.scene.loading)
        # 15 to 44 cycles a step with linear elements, 51 to 90 with quadratic ones
        cycles = SET_UP_CYCLES + steps * 30.0 * self.rough_meshes.degree
        return Work(unknowns=unknowns, cycles=unknowns * cycles, ranks=ranks)

    def coupling_statement(self) -> str:
        """Say how the rough surface is pressed."""
        return (
            "reference: the rough surface itself, meshed and pressed by "
            f"{self.scene.reference.method}; {describe.times(self.patches.grid)} patches gather "
            "the results"
        )

    def body_statements(self) -> Iterator[tuple[str, str]]:
        """Yield what the meshes are."""
        if self.scene.block is None:
            own = f"bisected from the {self.body.cells} of {self._mesh_name}"
            yield "body", f"{self.rough_meshes.statement}; {own}"
        else:
            sides = self.scene.block.sides
            yield "block", f"{self.rough_meshes.statement}; {sides} sides"

    @property
    def _mesh_name(self) -> str:
        """Name of the file of the body's mesh."""
        return "" if self.scene.body is None else Path(self.scene.body.mesh).name

    def error_statement(self) -> str:
        """Say how the run will know its error."""
        told = "the meshes of the reference tell it, at every load step"
        return super().error_statement() if self.unmeasured() else told

    def body_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the block and of its meshes."""
        if not self.body.on_mesh:
            yield from describe.proportions(self)
        yield from self.body.notes
        yield from self.rough_meshes.warnings()
        yield from describe.locking(self.body.poisson_ratio, self.rough_meshes.degree)


def _block_compliance(scene: Scene, lengths: tuple[float, float], height: float) -> Array:
    """Return the same of a block as `_face_compliance` of a body, a column that is pressed."""
    block = block_section(scene)
    nu, modulus = block.material.poisson_ratio, block.material.young_modulus
    confined = (1.0 + nu) * (1.0 - 2.0 * nu) / (1.0 - nu) if block.sides == "roller" else 1.0
    column = confined * height / modulus
    parts = PatchGrid(grid=(1, 1), lengths=lengths)
    half_space = float(influence_matrix(parts)[0, 0]) * block.material.surface_compliance / np.pi
    return np.array([column - half_space, 0.0, 0.0])


def _face_compliance(body: SceneBody, lengths: tuple[float, float]) -> Array:
    """Return what a body adds to a half-space under a uniform pressure on its rough rectangle.

    Args:
        body: The body, placed.
        lengths: Sides of the rectangle [mm].

    Returns:
        Displacement of the middle into the body [mm/MPa], and its slopes along x and y
        [1/MPa], shape (3,): the plane through the mean displacements of 4 × 4 parts.

    Note:
        Collective.
    """
    from macro import LoadedFace, displacements_under

    parts = PatchGrid(grid=(4, 4), lengths=lengths)
    face = LoadedFace(body.body, body.facets[0], parts)
    uniform = np.ones((1, parts.count))
    moved = displacements_under(face, uniform)[0]
    material = body.facts.materials[0]
    moved = moved - influence_matrix(parts) @ uniform[0] * material.surface_compliance / np.pi
    arms = parts.centres - 0.5 * np.asarray(lengths)
    plane = np.linalg.lstsq(np.column_stack([np.ones(parts.count), arms]), moved, rcond=None)[0]
    return np.asarray(plane)
