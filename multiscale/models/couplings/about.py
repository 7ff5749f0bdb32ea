"""What is said of a coupling: what a run would do and why, what is doubtful, what it takes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from patchlaw.geometry.statistics import roughness
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models.couplings import describe, validity
from patchlaw.multiscale.readable import Detail, number, percent, quantity, times
from patchlaw.multiscale.results.history import range_notes
from patchlaw.multiscale.scene.memory import body_request, memory_statement


class About:
    """Statements on a coupling; those of one kind alone are in the classes beside the couplings.

    Args:
        coupling: The coupling, a `Coupling`.

    Attributes:
        coupling: The coupling.
        parts: What is made from its scene.
        scene: The scene.
    """

    def __init__(self, coupling: Any) -> None:
        self.coupling, self.parts, self.scene = coupling, coupling.parts, coupling.scene

    @property
    def label(self) -> str:
        """The coupling, and the cells, meshes or micro model that it works on, in few words."""
        kind, micro = self.scene.kind, self.parts.micro
        if isinstance(micro, HalfSpaceModel):
            return f"{kind} on {times(micro.surface.grid)} cells"
        return kind if micro is None else f"{kind}, {micro.name}"

    def statements(self, memory: str = "") -> Iterator[tuple[str, str]]:
        """Yield pairs of topic and sentence that say what will be done and why, in one order.

        Args:
            memory: The memory that it takes, see `memory_statement`; empty says nothing of it.
        """
        said = self.describe() | ({"memory": memory} if memory else {})
        yield from ((topic, said[topic]) for topic in describe.TOPICS if topic in said)

    def describe(self) -> dict[str, str]:
        """Return what will be done and why, a sentence for each of some of `describe.TOPICS`."""
        parts, why = self.parts, self.unmeasured()
        has_body, heights = self.coupling.traits.has_body, parts.surface.heights.size
        count = math.prod(parts.cells or parts.surface.grid)
        cells = f"{count} cells"
        said = {
            "inputs": f"{describe.materials(parts)}; a surface of "
            f"{describe.dimensions(parts, has_body=has_body)}",
            "surface": describe.surface(parts),
            "contact": cells,
            "micro model": parts.micro.name if parts.micro else describe.MESHED_CONTACTS,
            "load": describe.load(parts),
            "error": f"not measured: {why}" if why else describe.checks(parts, self.error_causes),
        }
        if parts.plane_at_largest_load is not None:
            within = int((parts.cell_interference > 0.0).sum())
            which = str(within) if count == heights else f"{within} of {heights} heights"
            said["contact"] = f"{cells}, {which} within the largest approach"
            if parts.path.quantity == "force":
                approach = quantity(parts.plane.approach - parts.zero, "mm", 3)
                said["load"] += f"; on a half-space its approach is about {approach}"
        if self.scene.counter_surface is not None:
            said["two rough sides"] = describe.two_sides(parts)
        if parts.decision is not None:
            said["choice"] = parts.decision.sentence
        if self.coupling.traits.has_laws:
            said |= self._of_laws()
        return said

    def _of_laws(self) -> dict[str, str]:
        """Return how load steps are found from laws."""
        condensed, coefficients = self.coupling.condensed, self.scene.coefficients
        said = {"newton": "condensed to the patches" if condensed else "on the mesh of the body"}
        if coefficients:
            said["friction"] = (
                f"coefficient {describe.of_zones(self.parts, map(number, coefficients))}; the laws "
                "are beds of springs with a slider each; GMRES, as tangents are unsymmetric"
            )
        return said

    # --- errors

    @property
    def error_causes(self) -> str:
        """The causes of errors that a run measures."""
        return ""

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""
        return "output.check = 'none'" if self.scene.output.check == "none" else ""

    @property
    def measures_errors(self) -> bool:
        """Whether further solutions measure errors, see `Coupling.measured_errors`."""
        return not self.unmeasured()

    # --- what is doubtful

    def warnings(self) -> Iterator[str]:
        """Yield what a user should know about the validity of the scene."""
        parts, has_body = self.parts, self.coupling.traits.has_body
        known = parts.plane_at_largest_load is not None
        size = parts.largest_interference if known else roughness(parts.surface).sq
        yield from validity.of_surface(parts, size)
        yield from self._of_contact()
        yield from validity.of_output(parts, has_body=has_body, cells=self._shows_cells)
        if has_body:
            yield from validity.compressibility(parts)
            yield from self._of_bodies()
        if parts.decision is not None and parts.decision.warning:
            yield parts.decision.warning

    def _of_contact(self) -> Iterator[str]:
        """Yield what is doubtful of the contact and of its micro model."""
        parts = self.parts
        if parts.plane_at_largest_load is not None and not parts.samples:
            if not parts.interfering_patches:
                yield "nothing lies within the largest approach: no force will act"

    def _of_bodies(self) -> Iterator[str]:
        """Yield what is doubtful of the bodies."""
        return validity.of_meshes(self.parts)

    @property
    def _shows_cells(self) -> bool:
        """Whether pressures of the surface's cells will be known."""
        return False

    # --- memory

    @property
    def contact_memory(self) -> float:
        """Memory of the largest contact problem of cells [B]."""
        return 0.0

    @property
    def leak_cells(self) -> int:
        """Cells of the largest map of gaps that a fluid flows through."""
        return math.prod(self.parts.cells or self.parts.surface.grid)

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, key by key of its scene."""
        parts, scene = self.parts, self.scene
        yield from self.coupling.traits.requests(scene)
        steps = scene.loading.expected_count
        sections = {"body": scene.body, "counter_body": scene.counter_body}
        for (key, section), facts in zip(
            sections.items(), (parts.body, parts.counter), strict=True
        ):
            if section is not None and section.mesh and facts is not None:
                in_parts = section.mesh.lower().endswith(".xdmf")
                element, unknowns = facts.element, facts.unknowns
                yield body_request(key, element, unknowns, steps, in_parts=in_parts)

    def memory_statement(self, program: float, ranks: int) -> str:
        """Say the memory that a run takes, and what takes most of it.

        Args:
            program: Memory of a process before anything of the scene is in it [B].
            ranks: Processes of the MPI job.
        """
        # dolfinx and matplotlib take 70 MB each
        program += 70e6 * (self.coupling.traits.has_body + bool(self.scene.output.figures))
        requests = self.memory_requests()
        leak = 0.0
        if self.scene.leak is not None:
            from patchlaw.multiscale.laws.transmissivity import flow_memory  # others do without

            leak = flow_memory(self.leak_cells)
        return memory_statement(self.parts, self.contact_memory, requests, program, ranks, leak)

    # --- of load steps

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the approximations behind load steps.

        Args:
            steps: The load steps.
        """
        table = self.coupling.table
        if table is not None:
            yield from table.notes(self.coupling.table_tolerance)
        imbalances = [abs(step.imbalance) for step in steps if step.imbalance is not None]
        if imbalances:
            equal = percent(max(imbalances))
            yield Detail(f"force against the support's reaction: equal to {equal}")
        yield from range_notes(steps, table)

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of errors that the coupling knows of itself.

        Args:
            steps: The load steps.
        """
        return iter(())

    # --- for the record

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        micro = self.parts.micro
        return {} if micro is None else {"micro_model": {"name": micro.name}}

    def surface_record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the surface alone, by name."""
        return {}
