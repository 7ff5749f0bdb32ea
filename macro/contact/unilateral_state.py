"""What is told of the contact between a block's rough top and a rigid plane at a load step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from macro.block import Block
from macro.contact.face_nodes import TopNodes
from macro.contact.plane_over_nodes import PlaneOverNodes

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnilateralContactState:
    """Contact at one load step; numbers are the same on every rank.

    Attributes:
        approach: Rigid approach at the middle of the interface [mm].
        tilt: Change of the approach along x and y [mm/mm].
        displacement: This rank's owned degrees of freedom [mm].
        nodal_force: Contact forces of this rank's nodes of the top, shape (n,) [N].
        force: Normal force from the nodes [N].
        moment: First moments of the contact forces along x and y, about the middle of the
            interface, shape (2,) [N mm].
        reaction: Force that the bottom bears [N]; equals ``force`` in equilibrium.
        contact_area: Tributary area of the nodes in contact [mm²].
        contact_area_fine: Area with the border of contact between nodes, as `covered` tells [mm²].
        nodes: Number of nodes in contact.
        contacts: Number of connected regions of contact.
        mean_separation: Mean gap between the plane and the top [mm].
        patch_force: Forces on the patches, shape (N,) [N].
        patch_area: Contact areas of the patches, as ``contact_area``, shape (N,) [mm²].
        patch_closure: Approach of the plane over the middle of each patch minus the mean downward
            displacement of the patch's top, shape (N,) [mm].
        active_sets: Active sets that were solved for.
        linear_iterations: Iterations of the linear solver.
        reason: Why the iteration stopped.
    """

    approach: float
    tilt: tuple[float, float]
    displacement: Array
    nodal_force: Array
    force: float
    moment: Array
    reaction: float
    contact_area: float
    contact_area_fine: float
    nodes: int
    contacts: int
    mean_separation: float
    patch_force: Array
    patch_area: Array
    patch_closure: Array
    active_sets: int
    linear_iterations: int
    reason: str


class Found(NamedTuple):
    """A solution as a method finds it; arrays hold this rank's part.

    Attributes:
        plane: Approach at the middle [mm] and slopes, shape (3,).
        displacement: Owned degrees of freedom [mm].
        nodal_force: Contact forces of the nodes of the top, shape (n,) [N].
        touching: Whether these nodes are in contact, shape (n,).
        active_sets: Active sets that were solved for.
        linear_iterations: Iterations of the linear solver.
        reason: Why the iteration stopped.
    """

    plane: Array
    displacement: Array
    nodal_force: Array
    touching: Flags
    active_sets: int
    linear_iterations: int
    reason: str


def measured(
    block: Block, top: TopNodes, plane: PlaneOverNodes, found: Found
) -> UnilateralContactState:
    """Measure what is told of a solution.

    Args:
        block: The block.
        top: Its top.
        plane: The plane over the nodes of the top.
        found: The solution.

    Note:
        Collective.
    """
    displacement = block.stiffness.createVecRight()
    displacement.array[:] = found.displacement
    sag = -found.displacement[top.dofs]
    gap = -plane.penetration(found.plane, sag)
    loads = plane.levers.loads(found.nodal_force)
    lean = (top.patches.centres - plane.centre) @ found.plane[1:]
    nodal_force, touching = np.maximum(found.nodal_force, 0.0), found.touching
    area = np.where(touching, top.area, 0.0)
    weight = np.stack([top.area, top.area * gap, area, touching], axis=1)
    whole, room, contact, nodes = block.mesh.comm.allreduce(weight.sum(axis=0), op=MPI.SUM)
    return UnilateralContactState(
        approach=float(found.plane[0]),
        tilt=(float(found.plane[1]), float(found.plane[2])),
        displacement=found.displacement,
        nodal_force=found.nodal_force,
        force=float(loads[0]),
        moment=loads[1:],
        reaction=block.reaction(displacement),
        contact_area=float(contact),
        contact_area_fine=top.covered_area(touching, nodal_force, np.maximum(gap, 0.0)),
        nodes=round(nodes),
        contacts=top.regions(touching),
        mean_separation=float(room / whole),
        patch_force=top.patch_sums(found.nodal_force),
        patch_area=top.patch_sums(area),
        patch_closure=found.plane[0] + lean - top.patch_means(sag),
        active_sets=found.active_sets,
        linear_iterations=found.linear_iterations,
        reason=found.reason,
    )
