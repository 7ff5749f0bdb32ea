"""The rough surface itself, meshed and pressed: the model of references, and their coupling.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.contact_state import ContactState, Spots, peaks_of
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.bodies.reader import Meshes
from patchlaw.multiscale.loading.load_step import LoadStep, PatchState
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models import describe
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.problem import Model
from patchlaw.multiscale.models.reference_meshes import (
    ReferenceMeshes,
    added_compliance,
    contact_under,
    least_requests,
    plane_over_face,
    reference_meshes,
)
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.scene.memory import check_memory
from patchlaw.multiscale.scene.parts import SceneParts, block_section
from patchlaw.support import Array, located, on_root_alone
from patchlaw.support.readable import ProgressObserver, unobserved

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.geometry import RefinedShape
    from patchlaw.macro import (
        Block,
        FaceEquilibrium,
        MeshQuality,
        RoughFace,
        UnilateralContactProblem,
    )
    from patchlaw.macro.contact.rough_face import FlatBody


class RoughMesh(NamedTuple):
    """A body meshed with its roughness.

    Attributes:
        problem: Its contact problem.
        quality: How far the roughness has deformed its cells.
    """

    problem: UnilateralContactProblem
    quality: MeshQuality


class MeshedContact(Model):
    """Presses all meshes alike; load steps are those of the finest, with the others beside it.

    Args:
        meshes: The meshes, from coarse to fine.
        patches: What results are summed over.
        observe: Told of the meshes that are pressed.

    Attributes:
        meshes: The meshes.
    """

    on_mesh = True

    def __init__(
        self,
        meshes: Sequence[RoughMesh],
        patches: PatchGrid,
        observe: ProgressObserver | None = None,
    ) -> None:
        self.meshes, self._patches, self._observe = meshes, patches, observe or unobserved
        self._last: tuple[FaceEquilibrium, ...] = ()

    @property
    def finest(self) -> UnilateralContactProblem:
        """The contact problem that the load steps are those of."""
        return self.meshes[-1].problem

    @property
    def latest(self) -> FaceEquilibrium | None:
        """The finest block at the latest load step; None before the first."""
        return self._last[-1] if self._last else None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step on every mesh; see `Model.press`."""
        states = []
        for done, one in enumerate(self.meshes, 1):
            states.append(one.problem.solve(control))
            self._observe("meshes pressed", done, len(self.meshes))
        self._last = tuple(states)
        patches = self._patches
        finest, nominal = states[-1], patches.area * patches.count
        fractions = _area_share(finest) * finest.patch_area / patches.area
        return LoadStep.of_patches(
            patches,
            plane=(finest.approach, *finest.tilt),
            load=(finest.force, *finest.moment),
            patches=PatchState(finest.patch_closure, finest.patch_pressure, fractions),
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

    def detail(self, latest: FaceEquilibrium) -> ContactState:
        """Return the spots and fields of a contact.

        The area of a spot is that of its nodes times the area with its border in the facets over
        that of all nodes, so that the areas of all spots add up to the load step's.
        """
        from patchlaw.macro import nodal_contact

        nodes = nodal_contact(self.finest, latest)
        touching = np.flatnonzero(nodes.region >= 0)
        region, count = nodes.region[touching], latest.contacts
        top = touching[peaks_of(region, nodes.pressure[touching], count)]
        some = nodes.area > 1e-9 * nodes.area.max()  # quadratic triangles: vertices have none
        spots = Spots(
            place=np.stack([nodes.x[top], nodes.y[top]], axis=1),
            area=_area_share(latest) * np.bincount(region, nodes.area[touching], minlength=count),
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

    def field_record(self, state: Any) -> Any:
        """Return what the load step was found from; displacements are of one rank."""
        return self.state()

    def field_state_again(self, record: Any, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what fields are made from; see `Model.field_state_again`."""
        last = self.state()
        self.restore(record)
        found = self.field_state(step, parts)
        self.restore(last)
        return found

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of the finest rough block."""
        from patchlaw.macro import write_rough_fields

        write_rough_fields(path, self.finest, sorted(states.items()))

    @property
    def meshed_bodies(self) -> list[Any]:
        """The rough blocks, the finest last."""
        return [one.problem.body for one in self.meshes]

    @property
    def unknowns(self) -> int:
        """Degrees of freedom of the finest mesh."""
        return self.finest.body.dofs


def _area_share(state: FaceEquilibrium) -> float:
    """Return the contact area with its border in facets over that of whole nodes, as in patches."""
    return (state.contact_area or 0.0) / state.nodal_area if state.nodal_area else 0.0


class ReferenceCoupling(Coupling):
    """The rough surface of a body, meshed ever finer and pressed alike at every load step.

    All meshes see the same loads, halved steps included, and every accepted step has its error bar.
    The patches are what results are summed over; they do not change the solution.

    Attributes:
        rough_meshes: The meshes, from coarse to fine.
    """

    def __init__(self, parts: SceneParts, comm: Any, meshes: Meshes) -> None:
        super().__init__(parts, comm, meshes)
        compliance = added_compliance(parts, self._meshes[0])
        self.rough_meshes = on_root_alone(comm, lambda: self._arranged(compliance))

    def _arranged(self, compliance: Array) -> ReferenceMeshes:
        """Return the meshes for a body whose face moves by its compliance; on one process."""
        parts, scene = self.parts, self.scene
        surface, plane = parts.surface, parts.plane
        modulus = parts.materials.contact_modulus
        if parts.path.quantity == "approach":  # the plane under a force stays as it is
            model, turns = HalfSpaceModel(surface, contact_modulus=modulus), scene.loading.tilt
            plane = plane_over_face(plane, model, compliance, turns=turns == "free")
        check_memory(parts.nodes, least_requests(scene, surface, plane))
        contact = contact_under(plane, surface, modulus)
        found = reference_meshes(scene, surface, parts.body, plane, contact)
        check_memory(parts.nodes, found.requests(scene))
        return found

    # --- what is said of it

    @property
    def label(self) -> str:
        """The coupling, and the edges of the finest mesh, in few words."""
        size = 1e3 * float(self.rough_meshes.sizes[-1])
        return f"reference, meshed with edges of {size:.3g} µm"

    @property
    def statement(self) -> str:
        """What the coupling is, in a sentence."""
        method = self.scene.reference.method
        text = f"reference: the rough surface itself, meshed and pressed by {method}"
        return f"{text}; {describe.gathered(self.parts)}"

    @property
    def unmeasured(self) -> str:
        """Why errors cannot be measured; empty where they can."""
        several = len(self.rough_meshes.shapes) > 1
        return "" if several else "one mesh has no error bar (reference.meshes = 2)"

    @property
    def checks(self) -> str:
        """What tells errors, in words."""
        return "the meshes of the reference tell it, at every load step"

    def further_requests(self) -> Iterator[MemoryRequest]:
        """Yield what the meshes need memory for."""
        yield from self.rough_meshes.requests(self.scene)

    def record(self) -> dict[str, Any]:
        """Return how the meshes are pressed, and their quality where they are made."""
        made: Any = self.made_model
        qualities = [] if made is None else [one.quality for one in made.meshes]
        return {"method": self.scene.reference.method, "mesh_quality": qualities}

    # --- load steps

    @property
    def _pressed(self) -> Sequence[RoughMesh]:
        """The meshes that load steps are solved on, made when first needed; collective."""
        assert isinstance(self.model, MeshedContact)
        return self.model.meshes

    def _make_model(self) -> MeshedContact:
        """Mesh the rough blocks."""
        from patchlaw.macro import UnilateralContactProblem

        made: list[RoughMesh] = []
        surface, flat, shapes = self.parts.surface, self._flat_body(), self.rough_meshes.shapes
        for shape in shapes:
            self.clock.tell("meshes", len(made), len(shapes))
            finest = shape is shapes[-1]
            with located(self.scene.file, "surface"):
                body, quality = self._rough(shape, flat)
            problem = UnilateralContactProblem(
                body,
                surface.highest - surface.mean_height,
                method=self.scene.reference.method,
                patches=self.parts.patches if finest else None,
            )
            made.append(RoughMesh(problem, quality))
        return MeshedContact(made, self.parts.patches, self.clock.tell)

    def _flat_body(self) -> FlatBody | None:
        """Return the body from a mesh; None of a block."""
        first, section = self._meshes[0], self.scene.body
        if first is None or section is None:
            return None
        from patchlaw.macro.contact.rough_face import FlatBody

        tag = first.body.mesh.facet_tag(section.contact)
        with located(self.scene.file, "body.mesh"):
            return FlatBody(
                body=first.body, contact=tag, frame=first.frame, lengths=self.parts.surface.lengths
            )

    def _rough(
        self, shape: RefinedShape, flat: FlatBody | None
    ) -> tuple[Block | RoughFace, MeshQuality]:
        """Return a body with its roughness meshed."""
        from mpi4py import MPI

        from patchlaw.macro import Block, rough_block_mesh

        if flat is not None:
            return flat.rough(shape, self.parts.surface)
        mesh, quality = rough_block_mesh(shape, self.parts.surface, self.comm or MPI.COMM_SELF)
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
        record = ReferenceRecord.of(
            steps,
            meshes.sizes,
            [one.problem.body.dofs for one in self._pressed],
            force_order=meshes.force_order,
            scatter=meshes.scatter(
                np.array([step.contact_area_fraction for step in steps], float),
                np.array([step.contacts for step in steps], float),
            ),
        )
        return record.without_bars(np.array([self.misses(step) for step in steps], dtype=bool))

    def misses(self, step: LoadStep) -> bool:
        """Whether no node touches though the plane lies below the surface's highest point."""
        arm = np.subtract(
            self.parts.surface.highest_point, np.multiply(0.5, self.parts.surface.lengths)
        )
        return not step.contacts and step.approach_mm + float(arm @ np.asarray(step.tilt)) > 0.0

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the errors of the reference.

        Args:
            steps: Load steps of this coupling.
        """
        yield self.all_meshes(steps).sentence
        missed = [step.step for step in steps if self.misses(step)]
        if missed:
            yield (
                f"no node of the finest mesh touches in {len(missed)} of {len(steps)} load steps, "
                f"first in step {missed[0]}, though the plane lies below the surface's highest "
                "point: the mesh is too coarse for contact there, and the force zero; refine "
                "reference.fine"
            )
        thinnest = min(one.quality.thinnest for one in self._pressed)
        steepest = max(one.quality.steepest for one in self._pressed)
        yield (
            f"the roughness leaves the cells at least {thinnest:.2g} of their volume; the steepest "
            f"edge of the top has a slope of {steepest:.2g}"
        )
