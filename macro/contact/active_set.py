"""Contact at the nodes of a rough top by a primal-dual active set.

The nodal displacements u minimise the elastic energy under d ≤ 0 at the nodes of the top, d their
depth beyond the plane. With the nodal contact forces λ = −(K u)_z that is

    d ≤ 0,   λ ≥ 0,   λ d = 0:    no penetration, no tension, force in contact alone.

The active set holds the nodes that touch; in turn the block is solved with d = 0 on it, and it
loses the nodes that are pulled and gains those that penetrate (Hintermüller, Ito & Kunisch 2002,
doi 10.1137/S1052623401383558). Sets that still change are solved for roughly, the last one well.
Motions of the plane that follow from its loads are unknowns of the same linear solves: the active
nodes move with the plane. Conjugate gradients are preconditioned by the multigrid of the block
without contact, mended around the active nodes.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.rigid_plane import Control
from macro.block import Block
from macro.contact.extrapolated_start import Start, StepHistory
from macro.contact.face_nodes import TopNodes
from macro.contact.plane_over_nodes import PlaneOverNodes, not_found
from macro.contact.unilateral_state import Found
from macro.linear_solvers.constrained import ConstrainedSolver, contact_tolerance

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_LOOSE, _CLOSER = 0.1, 1e-2  # relative residuals while the active set changes, and hardly does
_MOST_SOLVES = 100
_PATIENCE = 10  # solves without progress before nodes change one by one
_CLOSED = 1e-8  # gap, relative to the displacements, that is none
_ROUNDING = 1e-15  # of the block's size: nothing
_SOFT = 8.0  # springs under a plane that nothing holds yet: E* times this over the block's width


class PrimalDualActiveSet:
    """Presses the nodes of a rough top; see the module.

    Args:
        block: The block.
        top: Its top.
        plane: The plane over the nodes of the top.

    Note:
        Everything here is collective.
    """

    def __init__(self, block: Block, top: TopNodes, plane: PlaneOverNodes) -> None:
        self._block, self._top, self._plane = block, top, plane
        # one layer of quadratic elements reaches as far as two of linear ones
        self._solver = ConstrainedSolver(block.stiffness, block.solver.pc, layers=3 - block.degree)
        self._tolerance = contact_tolerance()
        self._residual = block.stiffness.createVecRight()
        self._history = StepHistory(block.owned_dofs, len(top.dofs))
        modulus, half = block.material.contact_modulus, plane.levers.half
        self._nothing = 1e-17 * modulus * half**2  # N
        self._springs = top.area * modulus * _SOFT / (2.0 * half)

    def solve(self, control: Control) -> Found:
        """Find the contact of a load step, starting from those before.

        Raises:
            NotConverged: When the active set does not settle, nothing can hold the plane, or a
                linear solve fails; earlier solutions stay what they were.
        """
        start = self._history.start(control)
        placed = self._plane.placed(control, start.plane)
        displacement = self._block.stiffness.createVecRight()
        displacement.array[:] = start.displacement
        plane, active = self._started(control, placed, start, displacement)
        sets, spent, tolerance, changed, fewest, waited = 1, 0, _LOOSE, 1, np.inf, 0
        for _ in range(_MOST_SOLVES):
            held = self._held(control, active)
            if held is None:
                plane, active = self._put_on_springs(control, plane, displacement, active)
                sets, changed = sets + 1, 1
                continue
            if changed:
                self._put_on(plane, displacement, active)
            more, missed = self._solve(control, plane, displacement, active, held, tolerance)
            spent += more
            forces, depth = self._forces, self._depth(plane, displacement)
            large = self._largest(forces[active])
            pulled = active & (forces < -self._tolerance * large)
            pressed = ~active & (depth > self._tolerance * self._largest(displacement.array_r))
            moved = pulled | pressed
            changed, total = self._count(moved), self._count(active)
            # the forces that a solve starts from may be far larger than those it finds
            exact = missed <= self._tolerance * max(self._norm(forces[active]), self._nothing)
            if not changed and exact:
                return self._found(control, plane, displacement, active, sets, spent)
            fewest, waited = (changed, 0) if changed < fewest else (fewest, waited + 1)
            sets += changed > 0
            tolerance = self._next(tolerance, changed, total, waited)
            active = active ^ (self._first(moved) if waited > _PATIENCE else moved)
        raise not_found(control, "ACTIVE_SET_CYCLES", sets)

    def _next(self, tolerance: float, changed: int, total: int, waited: int) -> float:
        """Return how well the next set is solved for: a nearly settled one better, then well."""
        if changed > max(1, total // 200) and waited <= _PATIENCE:
            return _LOOSE
        return self._tolerance if tolerance <= _CLOSER else _CLOSER

    def _started(
        self, control: Control, plane: Array, start: Start, displacement: PETSc.Vec
    ) -> tuple[Array, Flags]:
        """Return the first plane and active set: those of before and nodes that penetrate."""
        active = start.contact > 0.0
        if control.free.any() and not self._count(active):
            return self._put_on_springs(control, plane, displacement, active)
        return plane, active | self._beyond(plane, displacement)

    def _put_on_springs(
        self, control: Control, plane: Array, displacement: PETSc.Vec, active: Flags
    ) -> tuple[Array, Flags]:
        """Let a plane that its active nodes cannot hold come to rest on springs."""
        sag = self._sag(displacement)
        plane = self._plane.on_springs(control, plane, sag, self._springs)
        return plane, active | self._beyond(plane, displacement)

    def _held(self, control: Control, active: Flags) -> Array | None:
        """Return the free motions that active nodes resist, see `PlaneOverNodes`.

        None when there is a load along a motion that they do not resist.
        """
        held, wanted = self._plane.supported_motions(control.free, active), _wanted(control)
        borne = held @ np.linalg.lstsq(held, wanted, rcond=None)[0]
        lost = np.abs(wanted - borne).max(initial=0.0)
        return None if lost > self._tolerance * (control.force or 0.0) else held

    def _solve(
        self,
        control: Control,
        plane: Array,
        displacement: PETSc.Vec,
        active: Flags,
        held: Array,
        tolerance: float,
    ) -> tuple[int, float]:
        """Solve with the active nodes on the plane, where they are, and move it.

        Returns:
            Linear iterations, and the norm of the residual that was allowed [N].
        """
        if not self._count(active):
            return 0, 0.0
        free, wanted = control.free, _wanted(control)
        dofs, levers = self._top.dofs[active], self._plane.levers.scaled(free)[active]
        motions = levers @ held
        before = displacement.array_r[dofs].copy()
        residual = self._residual.copy()
        scale = self._norm(residual.array_r[dofs])
        residual.array[dofs] -= motions @ (held.T @ wanted)
        scale = max(scale, float(np.linalg.norm(held.T @ wanted)), self._nothing)
        self._solver.constrain(dofs, motions)
        allowed = 0.5 * tolerance * scale
        spent = self._solver.improve(displacement, residual, allowed)
        if spent:
            self._update_residual(displacement)
        shares = self._sum(motions.T @ (before - displacement.array_r[dofs]))
        plane[free] += self._plane.levers.unit[free] * (held @ shares)
        return spent, allowed

    def _found(
        self,
        control: Control,
        plane: Array,
        displacement: PETSc.Vec,
        active: Flags,
        sets: int,
        spent: int,
    ) -> Found:
        depth = self._depth(plane, displacement)
        displacement.array[self._top.dofs] -= np.where(active, depth, np.maximum(depth, 0.0))
        self._update_residual(displacement)
        nodal_force = np.where(active, np.maximum(self._forces, 0.0), 0.0)
        # vertices of quadratic triangles touch without a force
        touching = active | (depth > -_CLOSED * self._largest(displacement.array_r))
        found = Found(
            plane=plane,
            displacement=displacement.array_r.copy(),
            nodal_force=nodal_force,
            touching=touching,
            active_sets=sets,
            linear_iterations=spent,
            reason="CONVERGED_ACTIVE_SET" if self._count(active) else "CONVERGED_NO_CONTACT",
        )
        force = float(self._plane.levers.loads(found.nodal_force)[0])
        self._history.add(Start(plane, found.displacement, found.nodal_force), force)
        return found

    def _put_on(self, plane: Array, displacement: PETSc.Vec, active: Flags) -> None:
        """Put active nodes on the plane; without any, the block is at rest."""
        if self._count(active):
            depth = self._depth(plane, displacement)
            displacement.array[self._top.dofs[active]] -= depth[active]
        else:
            displacement.set(0.0)
        self._update_residual(displacement)

    def _update_residual(self, displacement: PETSc.Vec) -> None:
        """Move the residual −K u to a displacement; at the top it is the contact forces."""
        self._block.stiffness.mult(displacement, self._residual)
        self._residual.scale(-1.0)

    @property
    def _forces(self) -> Array:
        """Contact forces of this rank's nodes of the top at the residual's displacement [N]."""
        forces: Array = self._residual.array_r[self._top.dofs]
        return forces

    def _sag(self, displacement: PETSc.Vec) -> Array:
        return -displacement.array_r[self._top.dofs]

    def _depth(self, plane: Array, displacement: PETSc.Vec) -> Array:
        return self._plane.penetration(plane, self._sag(displacement))

    def _beyond(self, plane: Array, displacement: PETSc.Vec) -> Flags:
        return self._depth(plane, displacement) > _ROUNDING * self._plane.levers.half

    def _first(self, moved: Flags) -> Flags:
        """Keep the first of the flags, over all ranks (Murty 1974: such changes cannot cycle)."""
        comm = self._block.mesh.comm
        lowest = comm.allreduce(comm.rank if moved.any() else comm.size, op=MPI.MIN)
        alone = np.zeros_like(moved)
        if comm.rank == lowest:
            alone[np.argmax(moved)] = True
        return alone

    def _largest(self, values: Array) -> float:
        comm = self._block.mesh.comm
        return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX))

    def _norm(self, values: Array) -> float:
        return float(np.sqrt(self._block.mesh.comm.allreduce(float(values @ values))))

    def _count(self, which: Flags) -> int:
        return int(self._block.mesh.comm.allreduce(int(np.count_nonzero(which))))

    def _sum(self, values: Array) -> Array:
        return self._block.mesh.comm.allreduce(values, op=MPI.SUM)


def _wanted(control: Control) -> Array:
    """Return the loads along the free motions of the plane, shape (k,) [N]."""
    return control.loads[control.free]
