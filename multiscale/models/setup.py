"""From a scene that states every key to the coupling that finds its load steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from patchlaw.multiscale.bodies.reader import read_bodies
from patchlaw.multiscale.machine import ClusterNodes, large_object_comm
from patchlaw.multiscale.models.couplings.coupling import Coupling, Meshes
from patchlaw.multiscale.models.couplings.dispatch import coupling_class, open_keys
from patchlaw.multiscale.scene.parts import Source
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import located
from patchlaw.support.arguments import Comm, checked
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_root_alone


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
    if opened := sorted(open_keys(scene)):
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
    with located(scene):
        first, counter = meshes = read(scene, comm)
        facts = first.facts if first else None, counter.facts if counter else None
        source = Source(scene, facts, nodes)
        coupling: Coupling = on_root_alone(
            large_object_comm(comm), lambda: coupling_class(scene).from_scene(source)
        )
        coupling.attach(comm, meshes)
        return coupling
