"""Contact of a block's rough top with a rigid plane: primal-dual active set on its nodes.

The nodal displacements u minimise the elastic energy under u_z ≤ g at the nodes of the top, g
their distance from the plane. With the nodal contact forces λ = −(K u)_z that is

    u_z ≤ g,   λ ≥ 0,   λ (g − u_z) = 0:    no penetration, no tension, force in contact alone.

The active set holds the nodes that touch; in turn the block is solved with u_z = g on it, and it
loses the nodes that are pulled and gains those that penetrate (Hintermüller, Ito & Kunisch 2002,
doi 10.1137/S1052623401383558). All systems are solved by conjugate gradients on the free degrees
of freedom with the multigrid of the block without contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.errors import NotConverged
from macro import compat
from macro.block import Block
from macro.free_solver import FreeSolver
from macro.mesh import TOP

Array = NDArray[np.float64]

_TOLERANCE = 1e-9  # residual relative to the contact forces, at a solution
_MOST_SETS = 60
_LOOSE = 1e-3  # relative residual while the active set still changes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObstacleState:
    """Contact at one approach, whose conditions hold exactly; arrays hold this rank's part.

    Attributes:
        approach: Rigid approach at the middle of the interface [mm].
        displacement: Owned degrees of freedom [mm].
        pressing: Contact forces of this rank's nodes of the top, shape (n,) [N].
        force: Normal force from the nodes [N].
        reaction: Force that the bottom bears [N].
        contact_area: Tributary area of the nodes in contact [mm²].
        nodes: Number of nodes in contact.
        active_sets: Active sets that were solved for.
        linear_iterations: Iterations of the linear solver.
    """

    approach: float
    displacement: Array
    pressing: Array
    force: float
    reaction: float
    contact_area: float
    nodes: int
    active_sets: int
    linear_iterations: int


class ObstacleBlock:
    """A block with a rough top, pressed by a rigid plane.

    Args:
        block: The block; its top is where the mesh puts it.
        highest: Height of the highest point of the top, which the approach counts from [mm].

    Attributes:
        dofs: Vertical degrees of freedom of this rank's nodes of the top, shape (n,).
        x: Abscissae of this rank's nodes of the top, shape (n,) [mm].
        y: Their ordinates [mm].
        height: Their heights [mm].
        area: Their tributary areas, projected on the plane [mm²].

    Note:
        Everything here is collective.
    """

    def __init__(self, block: Block, highest: float) -> None:
        self.block, self._highest = block, highest
        space = block.space
        found = fem.locate_dofs_topological(space, 2, block.mesh.facet_tags.find(TOP))
        found = np.sort(found[found < space.dofmap.index_map.size_local])
        self.dofs = 3 * found + 2
        self.x, self.y, self.height = space.tabulate_dof_coordinates()[found].T.copy()
        self.area = self._areas()
        self._solver = FreeSolver(block.stiffness, block.solver.pc)
        self._work = block.stiffness.createVecRight()
        self._last: list[tuple[float, Array, NDArray[np.bool_]]] = []

    def press(self, approach: float, tilt: tuple[float, float] = (0.0, 0.0)) -> ObstacleState:
        """Find the contact at one approach, starting from those before.

        Args:
            approach: Rigid approach at the middle of the interface, from first touch [mm].
            tilt: Slopes of the approach along x and y.

        Raises:
            NotConverged: When the active set does not settle, or a linear solve fails.
        """
        lx, ly = self.block.mesh.shape.interface
        lean = tilt[0] * (self.x - 0.5 * lx) + tilt[1] * (self.y - 0.5 * ly)
        gap = self._highest - (approach + lean) - self.height
        displacement = self.block.stiffness.createVecRight()
        active = self._start(displacement, approach, gap)
        spent, tolerance = 0, _LOOSE
        for sets in range(1, _MOST_SETS + 1):
            spent += self._solve(displacement, active, gap, tolerance)
            forces = self._forces(displacement)
            touching = displacement.array_r[self.dofs] > gap
            new = np.where(active, forces > 0.0, touching)
            changed, total = self._count(new != active), self._count(active)
            if not changed and tolerance <= _TOLERANCE:
                return self._state(approach, displacement, active, sets, spent)
            # a settled or nearly settled set is worth solving for well
            tolerance = _TOLERANCE if changed <= max(1, total // 200) else _LOOSE
            active = new
        raise NotConverged(
            f"the contact of the rough block at an approach of {approach:.6g} mm",
            reason="ACTIVE_SET_CYCLES",
            iterations=_MOST_SETS,
            remedy="take smaller load steps (load.steps)",
        )

    def _start(self, displacement: PETSc.Vec, approach: float, gap: Array) -> NDArray[np.bool_]:
        """Extrapolate from the last two solutions; nodes that would penetrate are active."""
        if not self._last:
            return gap < 0.0
        approach1, values, active = self._last[-1]
        displacement.array[:] = values
        if len(self._last) > 1 and approach1 != self._last[-2][0]:
            approach0, before, _ = self._last[-2]
            ahead = (approach - approach1) / (approach1 - approach0)
            displacement.array[:] += ahead * (values - before)
        return active | (displacement.array_r[self.dofs] > gap)

    def _solve(
        self, displacement: PETSc.Vec, active: NDArray[np.bool_], gap: Array, tolerance: float
    ) -> int:
        """Solve with the active nodes on the plane; return the linear iterations."""
        if not self._count(active):
            displacement.set(0.0)
            return 0
        held = self.dofs[active]
        displacement.array[held] = gap[active]
        residual = self._residual(displacement)
        scale = np.sqrt(self._sum(float(np.sum(residual.array_r[held] ** 2))))
        self._solver.hold(held)
        return self._solver.improve(displacement, residual, 0.5 * tolerance * scale)

    def _residual(self, displacement: PETSc.Vec) -> PETSc.Vec:
        """Return −K u, whose entries at the top are the contact forces with their sign turned."""
        self.block.stiffness.mult(displacement, self._work)
        self._work.scale(-1.0)
        return self._work

    def _forces(self, displacement: PETSc.Vec) -> Array:
        return self._residual(displacement).array_r[self.dofs].copy()

    def _state(
        self,
        approach: float,
        displacement: PETSc.Vec,
        active: NDArray[np.bool_],
        sets: int,
        spent: int,
    ) -> ObstacleState:
        values = displacement.array_r.copy()
        self._last = [*self._last[-1:], (approach, values, active)]
        pressing = np.where(active, self._forces(displacement), 0.0)
        return ObstacleState(
            approach=approach,
            displacement=values,
            pressing=pressing,
            force=self._sum(float(pressing.sum())),
            reaction=self.block.reaction(displacement),
            contact_area=self._sum(float(self.area[active].sum())),
            nodes=self._count(active),
            active_sets=sets,
            linear_iterations=spent,
        )

    def _areas(self) -> Array:
        """Return the projected areas that belong to this rank's nodes of the top."""
        space, mesh = self.block.space, self.block.mesh
        test = ufl.TestFunction(space)
        ds = ufl.Measure("ds", domain=mesh.mesh, subdomain_data=mesh.facet_tags)
        normal = ufl.FacetNormal(mesh.mesh)
        form = compat.compile_form(test[2] * normal[2] * ds(TOP))
        return compat.assemble_vector(form).array_r[self.dofs].copy()

    def _count(self, which: NDArray[np.bool_]) -> int:
        return int(self.block.mesh.comm.allreduce(int(np.count_nonzero(which))))

    def _sum(self, value: float) -> float:
        return float(self.block.mesh.comm.allreduce(value))
