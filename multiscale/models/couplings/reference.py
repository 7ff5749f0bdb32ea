"""The reference among the couplings: the rough surface itself is meshed and pressed.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import ClusterNodes, MemoryRequest
from patchlaw.multiscale.models.couplings import validity
from patchlaw.multiscale.models.couplings.about import About
from patchlaw.multiscale.models.couplings.coupling import Coupling, Meshes
from patchlaw.multiscale.models.couplings.pressed_surface import (
    on_few_cells,
    placed,
    plane_at_largest_load,
    surface_parts,
)
from patchlaw.multiscale.models.couplings.reference_meshes import (
    ReferenceMeshes,
    block_compliance,
    contact_under,
    face_compliance,
    least_requests,
    plane_over_face,
    reference_meshes,
    reference_requests,
)
from patchlaw.multiscale.models.meshed_contact import MeshedContact, RoughMesh
from patchlaw.multiscale.readable import times
from patchlaw.multiscale.results.accuracy import ReferenceRecord, reference_record
from patchlaw.multiscale.scene.memory import check_memory
from patchlaw.multiscale.scene.parts import Source, block_section
from patchlaw.multiscale.scene.surfaces import located
from patchlaw.support.arrays import Array
from patchlaw.support.parallel import on_root

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.geometry import RefinedShape
    from patchlaw.macro import Block, MeshQuality, RoughFace
    from patchlaw.macro.contact.rough_face import FlatBody


@dataclass(eq=False)
class ReferenceCoupling(Coupling):
    """The rough surface of a body, meshed ever finer and pressed alike at every load step.

    All meshes see the same loads, halved steps included, and every accepted step has its error bar.
    The patches are what results are summed over; they do not change the solution.

    Attributes:
        nodes: The nodes of the run.
        arranged: The meshes; None on a body from a mesh until the coupling is attached to it.
    """

    nodes: ClusterNodes = field(default_factory=ClusterNodes)
    arranged: ReferenceMeshes | None = None

    @classmethod
    def from_scene(cls, source: Source) -> Self:
        """Make the coupling of a scene on one process; see `Coupling.from_scene`."""
        parts, scene = surface_parts(source), source.scene
        began, surface = time.perf_counter(), parts.surface
        model = HalfSpaceModel(surface, contact_modulus=parts.materials.contact_modulus)
        plane = plane_at_largest_load(parts.path, on_few_cells(model), surface)
        assert plane is not None
        spent = {**parts.seconds, "load estimate": time.perf_counter() - began}
        made = cls(replace(parts, plane_at_largest_load=plane, seconds=spent), source.nodes)
        if scene.block is not None:
            compliance = block_compliance(scene, surface.lengths, parts.body.depth)
            made.arranged = made._arranged(compliance)
        return made

    def __getstate__(self) -> Any:
        return self.parts, self.nodes, self.arranged

    def __setstate__(self, state: Any) -> None:
        self.__init__(*state)  # type: ignore[misc]

    @property
    def about(self) -> About:
        """What is said of the coupling and of its load steps."""
        return AboutMeshes(self)

    def attach(self, comm: Any, meshes: Meshes) -> None:
        """Put the coupling on its body, and arrange the meshes by how far its face sinks."""
        super().attach(comm, placed(self.parts, meshes))
        first = self._meshes[0]
        if first is None:
            return
        compliance = face_compliance(first, self.parts.surface.lengths)
        self.arranged = on_root(comm, lambda: self._arranged(compliance))

    def _arranged(self, compliance: Array) -> ReferenceMeshes:
        """Return the meshes for a body whose face moves by its compliance; on one process."""
        parts, scene = self.parts, self.scene
        surface, plane = parts.surface, parts.plane
        modulus = parts.materials.contact_modulus
        if parts.path.quantity == "approach":  # the plane under a force stays as it is
            model, turns = HalfSpaceModel(surface, contact_modulus=modulus), scene.loading.tilt
            plane = plane_over_face(plane, model, compliance, turns=turns == "free")
        check_memory(self.nodes, least_requests(scene, surface, plane))
        contact = contact_under(plane, surface, modulus)
        found = reference_meshes(scene, surface, parts.body, plane, contact)
        check_memory(self.nodes, reference_requests(scene, found))
        return found

    @property
    def rough_meshes(self) -> ReferenceMeshes:
        """The meshes, from coarse to fine."""
        assert self.arranged is not None
        return self.arranged

    # --- load steps

    @cached_property
    def model(self) -> MeshedContact:
        """The rough blocks, meshed when first needed; collective."""
        return cast(MeshedContact, super().model)

    def _make_model(self) -> MeshedContact:
        """Mesh the rough blocks."""
        from patchlaw.macro import UnilateralContactProblem

        made: list[RoughMesh] = []
        surface, flat, shapes = self.parts.surface, self._flat_body(), self.rough_meshes.shapes
        for shape in shapes:
            self.clock.tell("meshes", len(made), len(shapes))
            finest = shape is shapes[-1]
            with located(self.scene, "surface"):
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
        with located(self.scene, "body.mesh"):
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
        record = reference_record(
            steps,
            meshes.sizes,
            [one.problem.body.dofs for one in self.model.meshes],
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


class AboutMeshes(About):
    """Statements on the meshes of a reference."""

    @property
    def label(self) -> str:
        """The coupling, and the meshes that it works on."""
        size = 1e3 * float(self.coupling.rough_meshes.sizes[-1])
        return f"reference, meshed with edges of {size:.3g} µm"

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the errors of the reference.

        Args:
            steps: Load steps of this coupling.
        """
        yield self.coupling.all_meshes(steps).sentence
        missed = [step.step for step in steps if self.coupling.misses(step)]
        if missed:
            yield (
                f"no node of the finest mesh touches in {len(missed)} of {len(steps)} load steps, "
                f"first in step {missed[0]}, though the plane lies below the surface's highest "
                "point: the mesh is too coarse for contact there, and the force zero; refine "
                "reference.fine"
            )
        thinnest = min(one.quality.thinnest for one in self.coupling.model.meshes)
        steepest = max(one.quality.steepest for one in self.coupling.model.meshes)
        yield (
            f"the roughness leaves the cells at least {thinnest:.2g} of their volume; the steepest "
            f"edge of the top has a slope of {steepest:.2g}"
        )

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""
        several = len(self.coupling.rough_meshes.shapes) > 1
        return "" if several else "one mesh has no error bar (reference.meshes = 2)"

    @property
    def measures_errors(self) -> bool:
        """Further solutions measure nothing; the meshes of a load step do."""
        return False

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        made = self.coupling.made_model
        qualities = [one.quality for one in made.meshes] if isinstance(made, MeshedContact) else []
        return {"method": self.scene.reference.method, "mesh_quality": qualities}

    # --- what is known before the run

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, with its meshes."""
        yield from super().memory_requests()
        yield from reference_requests(self.scene, self.coupling.rough_meshes)

    def describe(self) -> dict[str, str]:
        """Return what will be done and why, and what the meshes are."""
        scene, meshes = self.scene, self.coupling.rough_meshes.statement
        said = super().describe() | {
            "coupling": "reference: the rough surface itself, meshed and pressed by "
            f"{scene.reference.method}; {times(self.parts.patches.grid)} patches gather the "
            "results"
        }
        if scene.block is not None:
            said["block"] = f"{meshes}; {scene.block.sides} sides"
        elif scene.body is not None:
            own = f"bisected from the {self.parts.body.cells} of {Path(scene.body.mesh).name}"
            said["body"] = f"{meshes}; {own}"
        if not self.unmeasured():
            said["error"] = "the meshes of the reference tell it, at every load step"
        return said

    def _of_bodies(self) -> Iterator[str]:
        """Yield what is doubtful of the block and of its meshes."""
        if not self.parts.body.on_mesh:
            yield from validity.proportions(self.parts)
        yield from self.parts.body.notes
        yield from self.coupling.rough_meshes.warnings()
        yield from validity.locking(
            self.parts.body.poisson_ratio, self.coupling.rough_meshes.degree
        )
