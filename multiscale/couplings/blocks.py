"""The block of a scene: its terms in the contact problem, its compliance, its mesh."""

from __future__ import annotations

import gc
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Material, Surface
from micro import (
    FiniteSlopes,
    FreeSides,
    HalfSpaceModel,
    MicroModel,
    SurfaceStress,
    coarse_grid,
    side_stresses,
)
from multiscale.couplings.body_terms import Body
from multiscale.scene.scene import Scene
from multiscale.setup.problem import ProblemSetup

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Block, FaceCompliance, Interface

Array = NDArray[np.float64]

OnBody = Callable[[HalfSpaceModel, int], HalfSpaceModel]
"""Puts a half-space model on a body; with finite slopes up to an order, 0 for none."""

SLOPES = 2
"""Order of finite slopes where they are taken into account."""

_DECAY_LENGTH = 0.25
"""Decay length of the effect of free sides in the micro model, relative to the shortest side of
the block."""

_RESIDUAL = 1e-10
"""Residual of half-space solutions. Their forces are then right to 1e-12, so that neither the unit
of length nor the number of ranks changes a result. It costs a tenth more than 1e-8."""


def contact_model(setup: ProblemSetup, comm: Any, put_on_body: OnBody | None = None) -> MicroModel:
    """Return a scene's micro model on the body that it is pressed on, finite slopes included.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.
        put_on_body: What puts a half-space model on the scene's body, where that was solved for
            already, see `on_body`.

    Note:
        Collective.
    """
    model = setup.model
    isolated = setup.scene.coupling.kind == "isolated"
    if isinstance(model, HalfSpaceModel):
        put_on_body = put_on_body or on_body(setup, comm, half_space=isolated)
        return put_on_body(model, SLOPES if setup.finite_slopes else 0)
    if isolated or not setup.has_block:
        return model
    body = scene_body(setup)
    return replace(model, body=body.term(body.face(comm)))  # type: ignore[type-var]


def on_body(
    setup: ProblemSetup,
    comm: Any,
    *,
    half_space: bool = False,
    modes: int | None = None,
    coarse: bool = False,
    face: FaceCompliance | None = None,
) -> OnBody:
    """Return what puts half-space models on a scene's body, which is solved for once.

    Args:
        setup: The problem set up from the scene, with a half-space model.
        comm: MPI communicator; None for this process alone.
        half_space: Whether the body is a half-space even where the scene has a block.
        modes: Modes of the body along a side; by default those of its shape.
        coarse: Whether to take coarser elements for the body.
        face: Compliance of the body's top, where that was solved for; then it is not collective.

    Returns:
        A function from a model and the order of finite slopes, 0 for none, to the model on the
        body. It is not collective.

    Note:
        Collective.
    """
    body = None if half_space or not setup.has_block else scene_body(setup)
    if body is not None and face is None:
        face = body.face(comm, modes=modes, coarse=coarse)
    material = block_material(setup)

    def put(model: HalfSpaceModel, order: int) -> HalfSpaceModel:
        surface, model = model.surface, replace(model, tolerance=_RESIDUAL)
        # With finite slopes heights count from the highest point, near the loads, where slopes add
        # least. The flat body then ends at it, while the block's height is that of the mean plane.
        higher = surface.highest - surface.mean_height if order else 0.0
        edge_stresses: list[SurfaceStress] = []
        if body is not None and face is not None:
            model = replace(model, sides=body.side_term, body=body.term(face, higher=higher))
            edge_stresses = _stresses(body, face, surface) if order else []
        if not order:
            return model
        plane = surface.highest if edge_stresses else None
        slopes = FiniteSlopes(
            surface,
            material,
            order=order,
            periodic=model.periodic,
            plane=plane,
            edge_stresses=edge_stresses,
        )
        return replace(model, slopes=slopes)

    return put


def _stresses(body: Body, face: FaceCompliance, surface: Surface) -> list[SurfaceStress]:
    """Return the stresses in a contact face beyond those of the half-space."""
    grid = coarse_grid(surface)
    found: list[SurfaceStress] = []
    if body.side_term is not None:
        spacing = surface.lengths[0] / grid[0], surface.lengths[1] / grid[1]
        found.append(side_stresses(body.side_term, spacing))
    return [*found, body.stresses(face, grid)]


def scene_body(setup: ProblemSetup) -> Body:
    """Return the block of a scene; its free sides are a term of their own in half-space models.

    Args:
        setup: The problem set up from the scene.
    """
    return Body(
        shape=setup.shape,
        material=block_material(setup),
        sides=setup.scene.block.sides,
        side_term=free_sides(setup) if isinstance(setup.model, HalfSpaceModel) else None,
    )


def free_sides(setup: ProblemSetup) -> FreeSides | None:
    """Return the free sides of a scene's block that bound its interface; None without them.

    Args:
        setup: The problem set up from the scene.
    """
    if not setup.has_block or setup.scene.block.sides != "free" or setup.shape.margin:
        return None
    return FreeSides(
        lengths=setup.surface.lengths,
        poisson_ratio=setup.scene.block.poisson_ratio,
        decay_length=_DECAY_LENGTH * min(*setup.surface.lengths, setup.shape.height),
    )


def patch_displacements(setup: ProblemSetup, comm: Any, *, dense: bool) -> Callable[[Array], Array]:
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
        compliance = patch_compliance(setup, comm)
        return lambda pressures: np.asarray(pressures @ compliance.T)
    from macro import displacements_under

    interface = embedding(setup, comm)
    return lambda pressures: displacements_under(interface, pressures)


def patch_compliance(setup: ProblemSetup, comm: Any) -> Array:
    """Return the compliance of a scene's block under its patches, shape (N, N) [mm/MPa].

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if setup.scene.coupling.decomposed:
        body = replace(scene_body(setup), side_term=free_sides(setup))
        return body.patch_compliance(setup.patches, comm)
    from mpi4py import MPI

    from macro import patch_compliance_matrix
    from macro.compliance.cache import cached
    from macro.linear_solvers.options import users_options

    def compute() -> dict[str, Array]:
        return {"compliance": patch_compliance_matrix(embedding(setup, comm))}

    sides = setup.scene.block.sides
    key = (setup.shape, block_material(setup), sides, setup.patches, users_options())
    return cached("plain", key, compute, comm or MPI.COMM_SELF)["compliance"]


def embedding(setup: ProblemSetup, comm: Any) -> Interface:
    """Mesh and assemble the block of a scene, with its patches on top.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Block, Interface, block_mesh

    section = setup.scene.block
    mesh = block_mesh(setup.shape, comm or MPI.COMM_SELF)
    return Interface(Block(mesh, block_material(setup), sides=section.sides), setup.patches)


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
    if comm is not None and scene.coupling.kind != "analytic":
        import macro  # noqa: F401


def block_material(setup: ProblemSetup) -> Material:
    """Return the elastic constants of a scene's block."""
    section = setup.scene.block
    return Material(young_modulus=section.young_modulus, poisson_ratio=section.poisson_ratio)


def field_under(setup: ProblemSetup, pressure: Array, comm: Any) -> tuple[Interface, Array]:
    """Return the meshed block and its displacements under pressures that are uniform on patches.

    Args:
        setup: The problem set up from the scene.
        pressure: Pressures of the patches, shape (N,) [MPa].
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    interface = embedding(setup, comm)
    function = interface.block.solve(interface.load(pressure))
    return interface, function.x.array[: interface.block.owned_dofs].copy()


def free_blocks(blocks: list[Block]) -> None:
    """Free blocks that nothing else refers to any more.

    PETSc keeps objects that Python drops until it is asked on their own communicator. Without this
    a program that makes many runs would grow by a block with each.

    Args:
        blocks: The blocks; the list is emptied.

    Note:
        Collective.
    """
    if not blocks:
        return
    from macro.compat import collect_garbage

    comms = [block.stiffness.comm.duplicate() for block in blocks]  # these outlive their blocks
    blocks.clear()
    gc.collect()  # a block and its contact problem refer to each other
    for comm in comms:
        collect_garbage(comm)
        comm.destroy()
