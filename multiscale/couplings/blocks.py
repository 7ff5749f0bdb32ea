"""Blocks for couplings: what the contact problem sees of them, their compliance, their mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from micro import FiniteSlopes, FreeSides, HalfSpace, HalfSpaceModel, MicroModel
from multiscale.couplings.body import Body
from multiscale.scene import Scene
from multiscale.stage import Stage

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface, Material

Array = NDArray[np.float64]

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
    model = _sharp(stage.model)
    if stage.scene.coupling.kind == "isolated":
        return model
    if not isinstance(model, HalfSpaceModel):
        if not stage.embedded:
            return model
        return replace(model, body=_body(stage).term(comm))  # type: ignore[type-var]
    if not stage.embedded:
        section = stage.scene.block
        half_space = HalfSpace(section.young_modulus, section.poisson_ratio)
        slopes = FiniteSlopes(model.surface, half_space) if stage.finite_slopes else None
        return replace(model, slopes=slopes)
    model = replace(model, sides=free_sides(stage))
    if not stage.finite_slopes:
        return replace(model, body=_body(stage).term(comm))
    body, rough = _body(stage).terms_of_rough(model.surface, comm)
    return replace(model, body=body, slopes=rough)


def _body(stage: Stage) -> Body:
    """Return the block of a scene under its contact."""
    return Body(
        shape=stage.shape,
        material=block_material(stage),
        sides=stage.scene.block.sides,
        known=free_sides(stage),
    )


def _sharp(model: MicroModel) -> MicroModel:
    """Return a micro model whose own error is none beside the tolerances of what it goes into."""
    return replace(model, tolerance=_SHARP) if isinstance(model, HalfSpaceModel) else model


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
        return _body(stage).patch_compliance(stage.patches, comm)
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
