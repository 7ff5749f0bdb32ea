"""From a scene that states every key to the coupling that finds its load steps."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from patchlaw.multiscale.bodies.reader import read_bodies
from patchlaw.multiscale.machine import ClusterNodes, large_object_comm
from patchlaw.multiscale.models.coupling import Coupling, Meshes
from patchlaw.multiscale.models.scene_parts import scene_parts
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import located
from patchlaw.support.arguments import Comm, checked
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_root_alone

_COUPLINGS = {
    "analytic": "cells.CellCoupling",
    "concurrent": "cells.CellCoupling",
    "consistent": "patch_laws.ConsistentCoupling",
    "isolated": "patch_laws.IsolatedCoupling",
    "representative": "samples.RepresentativeCoupling",
    "reference": "reference.ReferenceCoupling",
}
"""Module in this folder, and class, of every coupling; a run loads its own."""


@checked
def make_setup(
    scene: Scene,
    comm: Comm | None = None,
    *,
    nodes: ClusterNodes | None = None,
    read: Callable[[Scene, Any], Meshes] = read_bodies,
) -> Coupling:
    """Make the coupling of a scene: read its bodies, make all else on rank 0, and check the fit.

    Args:
        scene: The scene, of which an accuracy leaves nothing open; see `resolve`.
        comm: MPI communicator; None for this process alone.
        nodes: The nodes of the run; None for this process alone.
        read: Reads the bodies of a scene from their meshes; collective.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    if opened := sorted(scene.open_keys):
        raise InputError(
            f"leaves {', '.join(opened)} open",
            key="accuracy",
            value=scene.accuracy,
            allowed="make_setup(resolve(scene)), as run does",
            file=scene.file,
        )
    return trial_setup(scene, comm, nodes or ClusterNodes(), read)


def trial_setup(
    scene: Scene, comm: Any, nodes: ClusterNodes, read: Callable[[Scene, Any], Meshes]
) -> Coupling:
    """Make the coupling of a scene whose open keys are as they are by default; see `make_setup`."""
    module, _, name = _COUPLINGS[scene.kind].partition(".")
    with located(scene):
        first, counter = meshes = read(scene, comm)
        facts = first.facts if first else None, counter.facts if counter else None
        parts = on_root_alone(large_object_comm(comm), lambda: scene_parts(scene, facts, nodes))
        kind = getattr(import_module(f"patchlaw.multiscale.models.{module}"), name)
        made: Coupling = kind(parts, comm, meshes, nodes)
        return made


def load_finite_elements(scene: Scene, comm: Any) -> None:
    """Import the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job, so that one rank alone must not
    import it.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone, which imports them when it needs them.

    Note:
        Collective.
    """
    meshed = scene.body is not None or (scene.counter_body and scene.counter_body.mesh)
    if comm is not None and (scene.has_body or meshed):
        import patchlaw.macro.bodies  # noqa: F401
