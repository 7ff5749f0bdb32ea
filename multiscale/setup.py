"""From a scene to the coupling that finds its load steps, with auto values resolved."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from multiscale.auto.keys import (
    auto_keys,
    is_measured,
    map_grid,
    provisional,
    with_resolved,
    with_value,
)
from multiscale.bodies.reader import read_bodies
from multiscale.couplings.coupling import Coupling, Source
from multiscale.couplings.dispatch import coupling_class
from multiscale.inputs.surfaces import located, make_surface
from multiscale.machine import ClusterNodes, large_object_comm
from multiscale.scene.scene import Scene
from support.collective import on_root_alone

if TYPE_CHECKING:
    from multiscale.auto.search import MeshError


def make_setup(
    scene: Scene,
    comm: Any = None,
    *,
    resolved: Mapping[str, Any] | None = None,
    nodes: ClusterNodes | None = None,
    like: Coupling | None = None,
    mesh_error: MeshError | None = None,
) -> Coupling:
    """Make the coupling of a scene: read its bodies, make all else on rank 0, and check the fit.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
        resolved: What auto values became when the run began; see `resolved_sections`.
        nodes: The nodes of the run; None for this process alone.
        like: A coupling with the same surface, which is taken from it.
        mesh_error: Measures the relative error of a reference's meshes at the largest load, by
            default `measured_mesh_error`.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    with located(scene):
        first, counter = meshes = read_bodies(scene, comm)
        facts = first.facts if first else None, counter.facts if counter else None
        source = Source(scene, facts, nodes or ClusterNodes(), like)
        coupling: Coupling = on_root_alone(
            large_object_comm(comm), lambda: _made(source, resolved or {}, mesh_error)
        )
        coupling.attach(comm, meshes)
    return coupling


def _made(source: Source, known: Mapping[str, Any], mesh_error: MeshError | None) -> Coupling:
    """Return the coupling of a scene, with its auto values as they were or as they are chosen."""
    began, scene = time.perf_counter(), source.scene
    auto: frozenset[str] = frozenset() if known else auto_keys(scene)
    start = provisional(with_resolved(scene, known), auto)

    def build(stated: Scene) -> Coupling:
        return coupling_class(stated).from_scene(source._replace(scene=stated, like=None))

    if not known and is_measured(scene):
        from multiscale.auto.search import coupling_by_accuracy, measured_mesh_error

        chosen = coupling_by_accuracy(scene, start, build, mesh_error or measured_mesh_error)
        return replace(chosen, seconds={"surface": 0.0, "choice": time.perf_counter() - began})
    if "patches.grid" in auto:
        start = with_value(start, "patches.grid", map_grid(start, make_surface(start)))
    cells = known.get("micro") and (int(known["micro"][0]), int(known["micro"][1]))
    return coupling_class(start).from_scene(source._replace(scene=start, cells=cells))
