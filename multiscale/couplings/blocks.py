"""Blocks for couplings: what the contact problem sees of them, their compliance, their mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from micro import (
    BodyModes,
    FiniteSlopes,
    FreeSides,
    HalfSpace,
    HalfSpaceModel,
    MicroModel,
    SideStresses,
    coarse_grid,
    half_space_modes,
    influence_matrix,
    side_modes,
)
from multiscale.scene import Scene
from multiscale.stage import Stage

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface, Material

Array = NDArray[np.float64]

OnBody = Callable[[HalfSpaceModel, int], HalfSpaceModel]
"""Puts a half-space model on a body; with finite slopes up to an order, 0 for none."""

SLOPES = 2
"""Order of finite slopes where they are seen."""

_REACH = 0.25
"""Reach of free sides in the micro model, of the shortest side of the block."""
_SHARP = 1e-10
"""Residual of half-space solutions: their forces are then right to 1e-12, so that neither the unit
of length nor the number of ranks is seen in a result. It costs a tenth more than 1e-8."""


def contact_model(stage: Stage, comm: Any) -> MicroModel:
    """Return a scene's micro model on the body that it is pressed on, finite slopes included.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    model, alone = stage.model, stage.scene.coupling.kind == "isolated"
    if isinstance(model, HalfSpaceModel):
        order = SLOPES if stage.finite_slopes else 0
        return on_body(stage, comm, half_space=alone or not stage.embedded)(model, order)
    if alone or not stage.embedded:
        return model
    return replace(model, body=body_modes(stage, None, comm))  # type: ignore[type-var]


def on_body(stage: Stage, comm: Any, *, half_space: bool = False) -> OnBody:
    """Return what puts half-space models on a scene's body, which is solved for once.

    Args:
        stage: The scene's ingredients, with a half-space model.
        comm: MPI communicator; None for this process alone.
        half_space: Whether the body is a half-space instead of the scene's block.

    Returns:
        A function from a model and the order of finite slopes, 0 for none, to the model on the
        body. It is not collective.

    Note:
        Collective.
    """
    sides = None if half_space else free_sides(stage)
    body = None if half_space else body_modes(stage, sides, comm)
    material = _half_space(stage)

    def put(model: HalfSpaceModel, order: int) -> HalfSpaceModel:
        placed = replace(model, tolerance=_SHARP, sides=sides, body=body)
        if not order:
            return placed
        surface, beside = model.surface, []
        if sides is not None:
            cells = coarse_grid(surface)
            spacing = surface.lengths[0] / cells[0], surface.lengths[1] / cells[1]
            beside = [SideStresses(sides, spacing)]
        return replace(placed, slopes=FiniteSlopes(surface, material, order=order, beside=beside))

    return put


def free_sides(stage: Stage) -> FreeSides | None:
    """Return the free sides that a scene's half-space model takes into account itself.

    None where there are none, or the micro model is another one.

    Args:
        stage: The scene's ingredients.
    """
    free = stage.embedded and stage.scene.block.sides == "free" and not stage.shape.margin
    if not (free and isinstance(stage.model, HalfSpaceModel)):
        return None
    return FreeSides(
        lengths=stage.surface.lengths,
        poisson_ratio=stage.scene.block.poisson_ratio,
        reach=_REACH * min(*stage.surface.lengths, stage.shape.height),
    )


def body_modes(stage: Stage, sides: FreeSides | None, comm: Any) -> BodyModes:
    """Return what a scene's block adds to the half-space and to some free sides.

    Args:
        stage: The scene's ingredients.
        sides: Free sides that are known apart, if there are any.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import cached_face_compliance, mode_count

    count = mode_count(stage.shape)
    section = stage.scene.block
    found = cached_face_compliance(
        stage.shape, block_material(stage), section.sides, count, comm or MPI.COMM_SELF
    )
    lengths = stage.surface.lengths
    known = half_space_modes(lengths, count)
    if sides is not None:
        known = known + side_modes(sides, count)
    return BodyModes(lengths, found.normal - known / stage.model.contact_modulus)


def patch_displacements(stage: Stage, comm: Any, *, dense: bool) -> Callable[[Array], Array]:
    """Return what gives the mean displacements of patches in the macro model of a scene.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.
        dense: Whether the macro model is the compliance of the patches, or the mesh itself.

    Returns:
        A function from pressures of N patches at m load steps to displacements, (m, N) both, [MPa]
        to [mm]. It is collective.

    Note:
        Collective.
    """
    if dense:
        compliance = patch_compliance(stage, comm)
        return lambda pressures: np.asarray(pressures @ compliance.T)
    interface = embedding(stage, comm)

    def solved(pressures: Array) -> Array:
        rows = []
        for row in pressures:
            if not row.any():
                rows.append(np.zeros(len(row)))
                continue
            field = interface.block.solve(interface.load(row))
            rows.append(interface.patch_displacements(field.x.array[: interface.block.owned_dofs]))
        return np.array(rows)

    return solved


def patch_compliance(stage: Stage, comm: Any) -> Array:
    """Return the compliance of a scene's block under its patches, shape (N, N) [mm/MPa].

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if stage.scene.coupling.decomposed:
        half_space = influence_matrix(stage.patches) / (np.pi * stage.model.contact_modulus)
        body = body_modes(stage, None, comm)
        return np.asarray(half_space + body.patch_compliance(stage.patches))
    from mpi4py import MPI

    from macro import plain_compliance
    from macro.compliance_cache import cached
    from macro.solvers import users_options

    def compute() -> dict[str, Array]:
        return {"compliance": plain_compliance(embedding(stage, comm))}

    sides = stage.scene.block.sides
    key = (stage.shape, block_material(stage), sides, stage.patches, users_options())
    return cached("plain", key, compute, comm or MPI.COMM_SELF)["compliance"]


def embedding(stage: Stage, comm: Any) -> Interface:
    """Mesh and assemble the block of a scene, with its patches on top.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Block, Interface, block_mesh

    section = stage.scene.block
    mesh = block_mesh(stage.shape, comm or MPI.COMM_SELF)
    return Interface(Block(mesh, block_material(stage), sides=section.sides), stage.patches)


def load_together(scene: Scene, comm: Any) -> None:
    """Load the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job: one rank alone must not.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone, which loads them when it needs them.

    Note:
        Collective.
    """
    if comm is not None and scene.coupling.kind != "analytic":
        import macro  # noqa: F401


def block_material(stage: Stage) -> Material:
    """Return the elastic constants of a scene's block."""
    from macro import Material

    section = stage.scene.block
    return Material(young_modulus=section.young_modulus, poisson_ratio=section.poisson_ratio)


def _half_space(stage: Stage) -> HalfSpace:
    section = stage.scene.block
    return HalfSpace(section.young_modulus, section.poisson_ratio)


def final_field(stage: Stage, pressure: Array, comm: Any) -> tuple[Interface, Array]:
    """Return the meshed block and its displacements under pressures that are uniform on patches.

    Args:
        stage: The scene's ingredients.
        pressure: Pressures of the patches, shape (N,) [MPa].
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    interface = embedding(stage, comm)
    function = interface.block.solve(interface.load(pressure))
    return interface, function.x.array[: interface.block.owned_dofs].copy()
