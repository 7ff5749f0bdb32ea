"""From a scene to the coupling that finds its load steps, with auto values resolved."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from patchlaw.multiscale.auto.keys import (
    auto_keys,
    is_measured,
    map_grid,
    provisional,
    with_resolved,
    with_value,
)
from patchlaw.multiscale.bodies.reader import read_bodies
from patchlaw.multiscale.couplings.coupling import Coupling, Meshes
from patchlaw.multiscale.couplings.dispatch import coupling_class
from patchlaw.multiscale.inputs.scene_parts import Source
from patchlaw.multiscale.inputs.surfaces import located, make_surface
from patchlaw.multiscale.machine import ClusterNodes, large_object_comm
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.arguments import Comm, checked
from patchlaw.support.parallel import on_root_alone


@checked
def make_setup(
    scene: Scene,
    comm: Comm | None = None,
    *,
    resolved: Mapping[str, Any] | None = None,
    nodes: ClusterNodes | None = None,
    mesh_error: Callable[[Any], float] | None = None,
) -> Coupling:
    """Make the coupling of a scene: read its bodies, make all else on rank 0, and check the fit.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
        resolved: What auto values became when the run began; see `resolved_sections`.
        nodes: The nodes of the run; None for this process alone.
        mesh_error: Measures the relative error of a reference's meshes at the largest load, by
            default `measured_mesh_error`.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    began, known = time.perf_counter(), resolved or {}
    auto: frozenset[str] = frozenset() if known else auto_keys(scene)
    build = _Builder(comm, nodes or ClusterNodes())
    with located(scene):
        start = provisional(with_resolved(scene, known), auto)
        if not known and is_measured(scene):
            from patchlaw.multiscale.auto.search import coupling_by_accuracy, measured_mesh_error

            measure = mesh_error or measured_mesh_error
            chosen = coupling_by_accuracy(scene, start, build, measure, comm)
            seconds = {"surface": 0.0, "choice": time.perf_counter() - began}
            return chosen.changed(seconds=seconds)
        if "patches.grid" in auto:
            grid = on_root_alone(comm, lambda: map_grid(start, make_surface(start)))
            start = with_value(start, "patches.grid", grid)
        cells = known.get("micro") and (int(known["micro"][0]), int(known["micro"][1]))
        return build(start, cells=cells)


@dataclass(frozen=True)
class _Builder:
    """Makes couplings of scenes without auto values, on bodies that are read once.

    Args:
        comm: MPI communicator; None for this process alone.
        nodes: The nodes of the run.
    """

    comm: Any
    nodes: ClusterNodes
    _read: dict[str, Any] = field(default_factory=dict)

    def __call__(self, scene: Scene, *, cells: tuple[int, int] | None = None) -> Coupling:
        """Make the coupling of a scene, on its bodies; collective.

        Args:
            scene: The scene.
            cells: Cells of the half-space of contact problems; None when they are the surface's.
        """
        first, counter = meshes = self._meshes(scene)
        facts = first.facts if first else None, counter.facts if counter else None
        source = Source(scene, facts, self.nodes, cells)
        coupling: Coupling = on_root_alone(
            large_object_comm(self.comm), lambda: coupling_class(scene).from_scene(source)
        )
        coupling.attach(self.comm, meshes)
        return coupling

    def _meshes(self, scene: Scene) -> Meshes:
        """Return the bodies of a scene; those of the latest one are at hand."""
        sections = (scene.body, scene.counter_body)
        if self._read.get("sections") != sections:
            self._read.clear()  # before others take memory
            self._read.update(meshes=read_bodies(scene, self.comm), sections=sections)
        meshes: Meshes = self._read["meshes"]
        return meshes
