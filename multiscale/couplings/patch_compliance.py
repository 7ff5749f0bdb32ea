"""What patches give way by in the macro model of a scene: one body, or both.

One rule holds for a counter-body that is a half-space. A compliance of the patches as a matrix is
that of both bodies. A mesh is that of the first body alone; then the laws, whose closures count its
displacements alone, contain what the half-space gives way.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from micro import influence_matrix
from multiscale.couplings.body import scene_body
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.surface_and_block import block_section

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, LoadedFace

Array = NDArray[np.float64]
Displacements = Callable[[Array], Array]
"""From pressures of N patches at m load steps to their mean displacements, [MPa] to [mm]."""


def patch_displacements(setup: ProblemSetup, comm: Any, *, dense: bool) -> Displacements:
    """Return what gives the mean displacements of patches in the macro model of a scene.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.
        dense: Whether the macro model is the compliance of the patches, or the mesh itself.

    Returns:
        A function from pressures of N patches at m load steps to displacements, (m, N) both, [MPa]
        to [mm]. It is collective.

    Note:
        Collective.
    """
    # with fewer patches than rows of laws the compliance takes fewer solutions of the mesh
    if dense or setup.patches.count <= setup.table_rows:
        compliance = patch_compliance(setup, comm) if dense else _of_first(setup, comm)
        return lambda pressures: np.asarray(pressures @ compliance.T)
    from macro import displacements_under

    face = embedding(setup, comm)
    return lambda pressures: displacements_under(face, pressures)


def patch_compliance(setup: ProblemSetup, comm: Any) -> Array:
    """Return the compliance of both sides of a scene's patches, shape (N, N) [mm/MPa].

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    first, second = _of_first(setup, comm), setup.materials.second
    # two meshes are loaded together; decomposed, they are two half-spaces and what bodies add
    decomposed = setup.counter_face is not None and setup.scene.decomposed
    if second is None or not (setup.both_give_way or decomposed):
        return first
    return np.asarray(first + influence_matrix(setup.patches) * second.surface_compliance / np.pi)


def _of_first(setup: ProblemSetup, comm: Any) -> Array:
    """Return the compliance of the meshes under the patches, of the first body or of both."""
    if setup.scene.decomposed:
        return scene_body(setup, side_term=True).patch_compliance(setup.patches, comm)
    from mpi4py import MPI

    from macro import patch_compliance_matrix
    from macro.compliance.cache import cached
    from macro.linear_solvers.options import users_options

    def compute() -> dict[str, Array]:
        return {"compliance": patch_compliance_matrix(embedding(setup, comm))}

    key = (*_bodies_as_text(setup), setup.patches, users_options())
    return cached("plain", key, compute, comm or MPI.COMM_SELF)["compliance"]


def _bodies_as_text(setup: ProblemSetup) -> tuple[Any, ...]:
    """Return all that the compliance of the meshes depends on, besides the patches."""
    scene, counter = setup.scene, setup.scene.counter_body
    parts: list[Any] = []
    if setup.block_shape is not None:
        parts += [setup.shape, setup.materials.first, block_section(scene).sides]
    for section, face in ((scene.body, setup.face), (counter, setup.counter_face)):
        if section is not None and face is not None:
            parts += [section.model_dump_json(), face.digest]
    return tuple(parts)


def embedding(setup: ProblemSetup, comm: Any) -> LoadedFace | FacePair:
    """Return the patches on the contact face of a scene's body, or of two bodies on meshes.

    A block is meshed for it.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from macro import FacePair, LoadedFace

    first, counter = _first_face(setup, comm), setup.bodies.counter
    if counter is None:
        return first
    second = LoadedFace(counter.body, counter.facets[0], setup.patches)
    if setup.samples and setup.face is not None:
        second = LoadedFace.of_regions(counter.body, counter.facets, setup.face.lengths)
    return FacePair(first, second)


def _first_face(setup: ProblemSetup, comm: Any) -> LoadedFace:
    """Return the patches, or regions under laws of samples, on the first body."""
    from mpi4py import MPI

    from macro import Block, LoadedFace, block_mesh
    from macro.mesh.contact_face import top_facets

    body: Any
    if setup.bodies.first is not None:
        body, facets = setup.bodies.first.body, setup.bodies.first.facets
    else:
        sides = block_section(setup.scene).sides
        mesh = block_mesh(setup.shape, comm or MPI.COMM_SELF)
        body = Block(mesh, setup.materials.first, sides=sides)
        if not setup.samples:
            return LoadedFace.of_block(body, setup.patches)
        facets = (top_facets(mesh),)
    if setup.samples and setup.face is not None:
        return LoadedFace.of_regions(body, facets, setup.face.lengths)
    return LoadedFace(body, facets[0], setup.patches)
