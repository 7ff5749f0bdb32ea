"""Sets up the problem of a scene on all ranks, with its bodies on their meshes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from geometry.patches import PatchGrid
from multiscale.machine import ClusterNodes, large_object_comm
from multiscale.planning.problem_setup import make_setup
from multiscale.scene.scene import Scene
from multiscale.setup.body_reader import scene_bodies
from multiscale.setup.mesh_bodies import SceneBodies, SceneBody
from multiscale.setup.problem import ProblemSetup
from support.collective import on_root_alone
from support.errors import InputError

_COVERED = 1e-6
"""Part of the surface's rectangle beside the contact face that is rounding."""


def set_up(
    scene: Scene,
    comm: Any,
    *,
    resolved: Mapping[str, Any] | None = None,
    nodes: ClusterNodes | None = None,
) -> ProblemSetup:
    """Set up the problem of a scene: read its bodies, make all else on rank 0, and check the fit.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
        resolved: What auto values became when the run began.
        nodes: The nodes of the run; None for this process alone.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    bodies, large = scene_bodies(scene, comm), large_object_comm(comm)
    faces = bodies.facts
    setup: ProblemSetup = on_root_alone(
        large, lambda: make_setup(scene, resolved, nodes, faces=faces)
    )
    setup = replace(setup, bodies=bodies)
    if not setup.samples:
        _place(setup, bodies)
    return setup


def _place(setup: ProblemSetup, bodies: SceneBodies) -> None:
    """Put the surface's rectangle on the contact faces, which must cover it."""
    section = setup.scene.body
    if bodies.first is not None and section is not None:
        free = np.subtract(bodies.first.facts.lengths, setup.surface.lengths)
        bodies.place(section.place or (0.5 * float(free[0]), 0.5 * float(free[1])))
    for body, key in ((bodies.first, "body"), (bodies.counter, "counter_body")):
        if body is not None:
            _check_covered(setup, body, key)


def _check_covered(setup: ProblemSetup, body: SceneBody, key: str) -> None:
    from macro import LoadedFace

    lengths = setup.surface.lengths
    whole = PatchGrid(grid=(1, 1), lengths=lengths)
    try:
        covered = float(LoadedFace(body.body, body.facets[0], whole).areas[0]) / whole.area
    except InputError:  # no facet lies in it
        covered = 0.0
    if covered < 1.0 - _COVERED:
        x, y = body.facts.lengths
        raise InputError(
            f"the surface's rectangle, {lengths[0]:g} × {lengths[1]:g} mm, does not lie on the "
            f"contact face, which covers {100.0 * covered:.3g} % of it and is {x:.6g} × {y:.6g} mm "
            "large",
            key=f"{key}.place" if key == "body" else f"{key}.contact",
            allowed="a rectangle on the face; or law.kind = 'representative', where the surface "
            "is a sample and the face may have any size and outline",
            file=setup.scene.file,
        )
