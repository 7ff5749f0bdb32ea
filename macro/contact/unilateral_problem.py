"""A body whose rough face is meshed, under a rigid plane: one load step at a time.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.meshes.block import require_inside
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from macro import compat
from macro.block import Block
from macro.contact.active_set import PrimalDualActiveSet
from macro.contact.augmented_lagrangian import AugmentedLagrangian
from macro.contact.face_nodes import TopNodes
from macro.contact.node_contact import ContactSolution, PlaneOverNodes
from macro.contact.rough_face import RoughFace
from macro.elastic_body import ElasticBody
from support.errors import InputError

Array = NDArray[np.float64]
Method = Literal["active-set", "augmented-lagrangian"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnilateralContactState:
    """Contact between a rough top and a rigid plane at one load step.

    Numbers, and arrays by patch, are the same on every rank.

    Attributes:
        approach: Rigid approach at the middle of the interface [mm].
        tilt: Change of the approach along x and y [mm/mm].
        displacement: This rank's owned degrees of freedom [mm].
        nodal_force: Contact forces of this rank's nodes of the top, shape (n,) [N].
        force: Normal force from the nodes [N].
        moment: First moments of the contact forces along x and y, about the middle of the
            interface, shape (2,) [N mm].
        reaction: Force that the supports bear [N]; equals ``force`` in equilibrium.
        contact_area: Tributary area of the nodes in contact [mm²].
        contact_area_fine: Area whose border lies between nodes, see `covered` [mm²].
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
        gap: Gaps of this rank's nodes of the top, shape (n,) [mm].
        region: Regions 0 … m − 1 of contact that they are in, −1 outside, shape (n,).
        peak_pressure: Largest nodal pressure [MPa].
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
    gap: Array
    region: NDArray[np.intp]
    peak_pressure: float


class UnilateralContactProblem:
    """A body with a rough face, its top, pressed by a rigid plane.

    Args:
        body: A block whose top is rough, or the rough face of any body.
        reference_height: Height of the highest point above the plane of the face's frame, from
            which the approach counts [mm].
        method: ``"active-set"``: no node of the top penetrates; ``"augmented-lagrangian"``: no
            quadrature point of its facets does.
        patches: Patches on the top, for forces and areas by patch; None: one of the whole top.

    Attributes:
        body: The body.
        top: Nodes of the top, of this rank.
        method: The method that finds the contact.

    Raises:
        InputError: When there is no such method, the block's top has a margin, or a patch reaches
            beyond the top.

    Note:
        Everything here is collective.
    """

    def __init__(
        self,
        body: Block | RoughFace,
        reference_height: float,
        *,
        method: Method = "active-set",
        patches: PatchGrid | None = None,
    ) -> None:
        if method not in get_args(Method):
            raise InputError(
                "unknown contact of the reference",
                value=method,
                allowed=", ".join(get_args(Method)),
            )
        face = body if isinstance(body, RoughFace) else RoughFace.of_block(body)
        patches = patches or face.whole
        require_inside(face.lengths, patches)
        self.body, self.top = face.body, TopNodes(face, patches)
        x, y, distance = self.top.x, self.top.y, reference_height - self.top.height
        if self.body.preload is not None:  # moved by its supports or other loads before contact
            distance = distance - self.body.preload[self.top.dofs]
        self._plane = PlaneOverNodes(x, y, distance, face.lengths, self.body.comm)
        kind = PrimalDualActiveSet if method == "active-set" else AugmentedLagrangian
        self.method: PrimalDualActiveSet | AugmentedLagrangian = kind(face, self.top, self._plane)

    def solve(self, control: Control) -> UnilateralContactState:
        """Find the contact of one load step, with an initial guess from the steps before.

        A force and a moment of zero are met to `macro.linear_solvers.constrained.TOLERANCE` of the
        force, or to what ``-patchlaw_ksp_rtol`` asks for. Without any force the plane just touches
        the highest node, tilted as is prescribed or as it was last.

        Args:
            control: What is prescribed of the plane.

        Raises:
            NotConverged: When an iteration fails, or nothing can hold the plane; the earlier
                solutions stay what they were, so that a smaller step can be tried.
        """
        state = _state(self.body, self.top, self._plane, self.method.solve(control))
        compat.collect_garbage(self.body.stiffness.comm)
        return state


class NodalContact(NamedTuple):
    """Contact of all nodes of the top, the same on every rank.

    Attributes:
        x: Abscissae of the n nodes, shape (n,) [mm].
        y: Their ordinates [mm].
        force: Their contact forces [N].
        area: Their tributary areas [mm²].
        pressure: Their contact pressures [MPa]; 0 at the vertices of quadratic triangles, which
            have no area.
        gap: Their gaps [mm].
        region: Regions 0 … m − 1 of contact that they are in; −1 outside.
    """

    x: Array
    y: Array
    force: Array
    area: Array
    pressure: Array
    gap: Array
    region: NDArray[np.intp]


def nodal_contact(problem: UnilateralContactProblem, state: UnilateralContactState) -> NodalContact:
    """Gather the contact of all nodes of the top, in the order of their places.

    Args:
        problem: The contact problem.
        state: One of its states.

    Note:
        Collective.
    """
    top, force = problem.top, np.maximum(state.nodal_force, 0.0)
    own = (top.x, top.y, force, top.area, top.pressure(force), state.gap, state.region)
    parts = problem.body.comm.allgather(own)
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.lexsort((columns[1], columns[0]))
    return NodalContact(*(column[order] for column in columns))


def _state(
    body: ElasticBody, top: TopNodes, plane: PlaneOverNodes, found: ContactSolution
) -> UnilateralContactState:
    """Return the state of a solution; collective."""
    displacement = body.stiffness.createVecRight()
    displacement.array[:] = found.displacement
    downward = -found.displacement[top.dofs]
    gap = -plane.penetration(found.plane, downward)
    loads = plane.levers.loads(found.nodal_force)
    tilted = (top.patches.centres - plane.centre) @ found.plane[1:]
    nodal_force, touching = np.maximum(found.nodal_force, 0.0), found.touching
    area = np.where(touching, top.area, 0.0)
    weight = np.stack([top.area, top.area * gap, area, touching], axis=1)
    region, contacts = top.regions(touching)
    pressure = float(top.pressure(nodal_force).max(initial=0.0))
    whole, volume, contact, nodes = body.comm.allreduce(weight.sum(axis=0), op=MPI.SUM)
    return UnilateralContactState(
        approach=float(found.plane[0]),
        tilt=(float(found.plane[1]), float(found.plane[2])),
        displacement=found.displacement + (0.0 if body.preload is None else body.preload),
        nodal_force=found.nodal_force,
        force=float(loads[0]),
        moment=loads[1:],
        reaction=body.reaction(displacement),
        contact_area=float(contact),
        contact_area_fine=top.covered_area(touching, nodal_force, np.maximum(gap, 0.0)),
        nodes=round(nodes),
        contacts=contacts,
        mean_separation=float(volume / whole),
        patch_force=top.patch_sums(found.nodal_force),
        patch_area=top.patch_sums(area),
        patch_closure=found.plane[0] + tilted - top.patch_means(downward),
        active_sets=found.active_sets,
        linear_iterations=found.linear_iterations,
        reason=found.reason,
        gap=gap,
        region=region,
        peak_pressure=body.comm.allreduce(pressure, op=MPI.MAX),
    )
