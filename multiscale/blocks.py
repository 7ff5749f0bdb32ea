"""Blocks for couplings: the meshed block under its interface, its compliance, its correction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from micro import influence_matrix
from multiscale.stage import Stage

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface
    from macro.correction import Correction

Array = NDArray[np.float64]


def embedding(stage: Stage, comm: Any) -> Interface:
    """Mesh and assemble the block of a scene, with its patches on top.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Block, Interface, Material, block_mesh

    section = stage.scene.block
    mesh = block_mesh(stage.shape, comm or MPI.COMM_SELF)
    material = Material(young_modulus=section.young_modulus, poisson_ratio=section.poisson_ratio)
    return Interface(Block(mesh, material, sides=section.sides), stage.patches)


def patch_compliance(stage: Stage, comm: Any) -> Array:
    """Return the compliance of a scene's block under its patches, shape (N, N) [mm/MPa].

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if stage.scene.coupling.decomposed:
        correction = smooth_correction(stage, stage.patches, comm)
        half_space = influence_matrix(stage.patches) / (np.pi * stage.model.contact_modulus)
        return half_space + correction.patch_compliance(stage.patches)
    from macro import plain_compliance

    interface = embedding(stage, comm)
    return plain_compliance(interface.block, interface)


def smooth_correction(stage: Stage, loads: PatchGrid, comm: Any) -> Correction:
    """Return what the scene's block adds to the half-space.

    Args:
        stage: The scene's ingredients.
        loads: Rectangles that pressures are gathered on.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Material
    from macro.correction import make_correction
    from micro.boussinesq import HalfSpace

    e, nu = stage.scene.block.young_modulus, stage.scene.block.poisson_ratio
    return make_correction(
        stage.shape,
        Material(young_modulus=e, poisson_ratio=nu),
        stage.scene.block.sides,
        loads,
        HalfSpace(e, nu),
        comm or MPI.COMM_SELF,
    )


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
