"""What plan and report say of a coupling: its method and what it takes, warnings, notes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models import describe, validity
from patchlaw.multiscale.models.measured_errors.contact import MOST_CHECKED_CELLS
from patchlaw.multiscale.readable import Detail, number, percent, quantity
from patchlaw.multiscale.results.history import range_notes
from patchlaw.multiscale.scene.memory import (
    CELL_OF_CONTACT,
    body_request,
    memory_statement,
    modes_request,
    scene_requests,
)
from patchlaw.multiscale.scene.parts import block_section, meshed_cells


class About:
    """Statements on a coupling and on its load steps.

    Args:
        coupling: The coupling, a `Coupling`.

    Attributes:
        coupling: The coupling.
        parts: What is known of its scene.
        scene: The scene.
    """

    def __init__(self, coupling: Any) -> None:
        self.coupling, self.parts, self.scene = coupling, coupling.parts, coupling.scene

    # --- what a run would do

    def statements(self, memory: str = "") -> Iterator[tuple[str, str]]:
        """Yield pairs of topic and sentence that say what will be done and why, in one order.

        Args:
            memory: The memory that it takes, see `memory_statement`; empty says nothing of it.
        """
        said = self._described() | ({"memory": memory} if memory else {})
        yield from ((topic, said[topic]) for topic in describe.TOPICS if topic in said)

    def _described(self) -> dict[str, str]:
        """Return what will be done and why, a sentence for each of some of `describe.TOPICS`."""
        parts, scene, why = self.parts, self.scene, self.unmeasured()
        said = {
            "inputs": f"{describe.materials(parts)}; a surface of "
            f"{describe.dimensions(parts, has_body=scene.has_body)}",
            "surface": describe.surface(parts),
            "contact": describe.contact(parts),
            "micro model": parts.micro.name if parts.micro else describe.MESHED_CONTACTS,
            "coupling": self.coupling.statement,
            "load": describe.load(parts),
            "error": f"not measured: {why}" if why else self.coupling.checks,
        }
        if parts.plane_at_largest_load is not None and parts.path.quantity == "force":
            approach = quantity(parts.plane.approach - parts.zero, "mm", 3)
            said["load"] += f"; on a half-space its approach is about {approach}"
        if scene.has_body:
            said |= self._of_bodies()
        if scene.counter_surface is not None:
            said["two rough sides"] = describe.two_sides(parts)
        if parts.decision is not None:
            said["choice"] = parts.decision.sentence
        if scene.by_laws:
            condensed = self.coupling.condensed
            said["newton"] = "condensed to the patches" if condensed else "on the mesh of the body"
        if scene.by_laws and (coefficients := scene.coefficients):
            said["friction"] = (
                f"coefficient {describe.of_zones(parts, map(number, coefficients))}; the laws "
                "are beds of springs with a slider each; GMRES, as tangents are unsymmetric"
            )
        return said

    def _of_bodies(self) -> dict[str, str]:
        """Return what the bodies are, and how contact problems see them."""
        parts, scene = self.parts, self.scene
        if scene.meshes_roughness:
            meshes = self.coupling.rough_meshes.statement
            if scene.block is not None:
                return {"block": f"{meshes}; {scene.block.sides} sides"}
            own = f"bisected from the {parts.body.cells} of {Path(scene.body.mesh).name}"
            return {"body": f"{meshes}; {own}"}
        if parts.samples:
            return {"body": describe.body(parts)}
        if not parts.body.on_mesh:
            return {"block": describe.block(parts)}
        return {"body": describe.body(parts), "body term": describe.body_term(parts)}

    # --- errors

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""
        why, asked = self.coupling.unmeasured, self.scene.output.check != "none"
        return why or ("" if asked or not self.coupling.causes else "output.check = 'none'")

    @property
    def measures_errors(self) -> bool:
        """Whether further solutions measure errors, see `Coupling.measured_errors`."""
        return bool(self.coupling.causes) and not self.unmeasured()

    def warnings(self) -> Iterator[str]:
        """Yield what a user should know about the validity of the scene."""
        meshes = self.coupling.rough_meshes if self.scene.meshes_roughness else None
        return validity.warnings(self.parts, meshes)

    # --- memory

    @property
    def contact_memory(self) -> float:
        """Memory of the largest contact problem of cells, that of an error check included [B]."""
        parts = self.parts
        if parts.samples:
            return CELL_OF_CONTACT * parts.surface.heights.size
        if parts.cells is None:
            return 0.0
        size = math.prod(parts.cells)
        checked = parts.finite_slopes and self.scene.output.check != "none"
        return CELL_OF_CONTACT * size * (4 if checked and 4 * size <= MOST_CHECKED_CELLS else 1)

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, key by key of its scene."""
        parts, scene = self.parts, self.scene
        yield from scene_requests(scene)
        steps = scene.loading.expected_count
        sections = {"body": scene.body, "counter_body": scene.counter_body}
        bodies = {"body": parts.body, "counter_body": parts.counter}
        for key, section in sections.items():
            if section is not None and section.mesh and (facts := bodies[key]) is not None:
                in_parts = section.mesh.lower().endswith(".xdmf")
                yield body_request(key, facts.element, facts.unknowns, steps, in_parts=in_parts)
        if scene.vibration is not None:
            yield modes_request(self._unknowns, scene.vibration.modes)
        yield from self.coupling.further_requests()

    @property
    def _unknowns(self) -> int:
        """Degrees of freedom of the bodies that have a mesh."""
        own = [one for one in (self.parts.body, self.parts.counter) if one is not None]
        if (cells := meshed_cells(self.scene)) is None:
            return sum(one.unknowns for one in own)
        order = int(block_section(self.scene).element[1])
        return sum(one.unknowns for one in own) + 3 * math.prod(order * n + 1 for n in cells)

    def memory_statement(self, program: float, ranks: int) -> str:
        """Say the memory that a run takes, and what takes most of it.

        Args:
            program: Memory of a process before anything of the scene is in it [B].
            ranks: Processes of the MPI job.
        """
        parts, scene, leak = self.parts, self.scene, 0.0
        # dolfinx and matplotlib take 70 MB each
        program += 70e6 * (scene.has_body + bool(scene.output.figures))
        if scene.leak is not None:
            from patchlaw.multiscale.laws.transmissivity import flow_memory  # others do without

            each = parts.patches.count if scene.by_laws else 1  # laws have a map for every patch
            leak = flow_memory(math.prod(parts.cells or parts.surface.grid) // each)
        requests = self.memory_requests()
        return memory_statement(parts, self.contact_memory, requests, program, ranks, leak)

    # --- of load steps

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the approximations behind load steps.

        Args:
            steps: The load steps.
        """
        yield from validity.large_strains(self.parts, steps)
        table = self.coupling.table
        if table is not None:
            yield from table.notes(self.coupling.table_tolerance)
        imbalances = [abs(step.imbalance) for step in steps if step.imbalance is not None]
        if imbalances:
            equal = percent(max(imbalances))
            yield Detail(f"force against the support's reaction: equal to {equal}")
        yield from range_notes(steps, table)
        yield from self.coupling.extensions

    # --- for the record

    def surface_record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the surface alone, by name."""
        parts = self.parts
        if parts.summits is None:
            return {}
        return {
            "summits": parts.summits.count,
            "summits_in_reach": int(parts.interfering_summits.sum()),
            "border_maxima_in_reach": parts.interfering_border_maxima,
        }
