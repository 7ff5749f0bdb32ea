"""A body whose rough face is meshed, under a rigid plane: one load step at a time.

Contact at its nodes is found by a primal-dual active set. The nodal displacements u minimise the
elastic energy under d ≤ 0 at the nodes of the top, where d is the interference of a node and the
plane. With the nodal contact forces λ = −(K u)_z the conditions are

    d ≤ 0,   λ ≥ 0,   λ d = 0:    no interference, no tension, force in contact alone.

The active set is the set of nodes in contact. Each iteration solves for the block with d = 0 on the
active set, removes the nodes in tension and adds those behind the plane (Hintermüller, Ito &
Kunisch 2002, doi 10.1137/S1052623401383558). Solves are inexact while the set changes, and accurate
at the end. Free motions of the plane are unknowns of the same linear solves, in which the active
nodes move with the plane. Conjugate gradients are preconditioned by the multigrid of the block
without contact, corrected near the active nodes.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from petsc4py import PETSc

from patchlaw.geometry import Control, PatchGrid, RigidPlane
from patchlaw.geometry.meshes.block import require_inside
from patchlaw.macro import compat
from patchlaw.macro.bodies import Block
from patchlaw.macro.contact.augmented_lagrangian import AugmentedLagrangian
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium, NodalContact, checked_reaction
from patchlaw.macro.contact.face_nodes import TopNodes
from patchlaw.macro.contact.rough_face import (
    ContactSolution,
    Guess,
    PlaneOverNodes,
    RoughFace,
    largest,
    not_found,
)
from patchlaw.macro.linear_solvers.constrained import ConstrainedSolver, contact_tolerance
from patchlaw.support import Array, Flags, InputError, NotBalanced

_LOOSE, _CLOSER = 0.1, 1e-2
"""Relative residuals of solves while the active set changes much, and while it changes little."""

_PATIENCE = 10
"""Solves without progress before nodes change one by one."""


@dataclass(slots=True, eq=False)
class _Iterate:
    """State of the iteration of one load step.

    Attributes:
        control: What the load step prescribes.
        plane: Approach [mm] and slopes, shape (3,).
        displacement: Nodal displacements [mm].
        active: Which of this rank's nodes of the top are active, shape (n,).
    """

    control: Control
    plane: Array
    displacement: PETSc.Vec
    active: Flags


class PrimalDualActiveSet:
    """Finds contact at the nodes of a rough top; see the module.

    Nodes that a support holds cannot give way to a plane and take no part.

    Args:
        face: The rough face.
        top: Its nodes.
        plane: The plane over them.

    Attributes:
        most_solves: Linear solves of a load step before it fails.
        points: Number of forces in a guess: this rank's nodes.

    Note:
        Everything here is collective.
    """

    most_solves = 100

    def __init__(self, face: RoughFace, top: TopNodes, plane: PlaneOverNodes) -> None:
        self._body, self._top, self._plane = face.body, top, plane
        body, self._comm = face.body, face.body.comm
        # one layer of quadratic elements reaches as far as two of linear ones
        self._solver = ConstrainedSolver(body.stiffness, body.solver.pc, layers=3 - body.degree)
        self._tolerance = contact_tolerance()
        self._residual = body.stiffness.createVecRight()
        self.points = len(top.dofs)
        modulus, half = face.modulus, plane.levers.half
        # what counts as no force, and as no interference
        self._zero_force, self._rounding = 1e-17 * modulus * half**2, 1e-15 * half
        # under a plane without support: E* eight times over the block's width
        self._springs = np.where(top.held, 0.0, top.area * modulus * 8.0 / (2.0 * half))

    def solve(self, control: Control, guess: Guess) -> ContactSolution:
        """Find the contact of a load step.

        Args:
            control: What the load step prescribes.
            guess: Where to start: the plane with its prescribed motions, and nodal forces.

        Raises:
            NotConverged: When the active set does not converge, nothing can hold the plane, or a
                linear solve fails.
        """
        displacement = self._body.stiffness.createVecRight()
        displacement.array[:] = guess.displacement
        now = _Iterate(control, guess.plane, displacement, guess.contact > 0.0)
        if control.free.any() and not self._count(now.active):
            self._put_on_springs(now)
        now.active = now.active | (self._depth(now) > self._rounding)
        sets, spent, tolerance, changed, fewest, waited = 1, 0, _LOOSE, 1, np.inf, 0
        for _ in range(self.most_solves):
            motions = self._supported_motions(now)
            if motions is None:
                self._put_on_springs(now)
                now.active = now.active | (self._depth(now) > self._rounding)
                sets, changed = sets + 1, 1
                continue
            if changed:
                self._put_on_plane(now)
            iterations, allowed = self._solve_active(now, motions, tolerance)
            spent += iterations
            forces, depth = self._residual.array_r[self._top.dofs], self._depth(now)
            tension = -self._tolerance * largest(forces[now.active], self._comm)
            depths = self._tolerance * largest(displacement.array_r, self._comm)
            moved = np.where(now.active, forces < tension, depth > depths)
            changed, total = self._count(moved), self._count(now.active)
            # the forces before a solve may be far larger than those after it
            norm = max(self._norm(forces[now.active]), self._zero_force)
            if not changed and allowed <= self._tolerance * norm:
                return self._converged(now, sets, spent)
            fewest, waited = (changed, 0) if changed < fewest else (fewest, waited + 1)
            sets += changed > 0
            # more than one active node in 200
            if changed > max(1, total // 200) and waited <= _PATIENCE:
                tolerance = _LOOSE
            else:
                tolerance = self._tolerance if tolerance <= _CLOSER else _CLOSER
            now.active = now.active ^ (self._first(moved) if waited > _PATIENCE else moved)
        raise not_found(control, "ACTIVE_SET_CYCLES", sets)

    def _put_on_springs(self, now: _Iterate) -> None:
        """Bring a plane that the active nodes cannot hold into equilibrium on springs."""
        downward = -now.displacement.array_r[self._top.dofs]
        now.plane = self._plane.on_springs(now.control, now.plane, downward, self._springs)

    def _supported_motions(self, now: _Iterate) -> Array | None:
        """Return the free motions of the plane that active nodes resist, see `PlaneOverNodes`.

        None when a load acts along a motion that they do not resist.
        """
        motions = self._plane.supported_motions(now.control.free, now.active)
        loads = (now.control.loads * self._plane.levers.unit)[now.control.free]
        borne = motions @ np.linalg.lstsq(motions, loads, rcond=None)[0]
        lost = np.abs(loads - borne).max(initial=0.0)
        return None if lost > self._tolerance * (now.control.force or 0.0) else motions

    def _put_on_plane(self, now: _Iterate) -> None:
        """Move active nodes onto the plane; without any, the block is at rest."""
        if not self._count(now.active):
            now.displacement.set(0.0)
        depth = self._depth(now)[now.active]
        now.displacement.array[self._top.dofs[now.active]] -= depth
        self._update_residual(now.displacement)

    def _solve_active(self, now: _Iterate, supported: Array, tolerance: float) -> tuple[int, float]:
        """Solve with the active nodes fixed to the plane, and move the plane with them.

        Returns:
            Linear iterations, and the norm of the residual that was allowed [N].
        """
        if not self._count(now.active):
            return 0, 0.0
        free, levers = now.control.free, self._plane.levers
        loads = supported.T @ (now.control.loads * levers.unit)[free]
        dofs = self._top.dofs[now.active]
        motions = levers.scaled(free)[now.active] @ supported
        before = now.displacement.array_r[dofs].copy()
        residual = self._residual.copy()
        scale = self._norm(residual.array_r[dofs])
        residual.array[dofs] -= motions @ loads
        scale = max(scale, float(np.linalg.norm(loads)), self._zero_force)
        self._solver.constrain(dofs, motions)
        allowed = 0.5 * tolerance * scale
        spent = self._solver.improve(now.displacement, residual, allowed)
        if spent:
            self._update_residual(now.displacement)
        moved = levers.summed(motions.T @ (before - now.displacement.array_r[dofs]))
        now.plane[free] += levers.unit[free] * (supported @ moved)
        return spent, allowed

    def _converged(self, now: _Iterate, sets: int, spent: int) -> ContactSolution:
        """Remove the last interferences."""
        depth = self._depth(now)
        removed = np.where(now.active, depth, np.maximum(depth, 0.0))
        now.displacement.array[self._top.dofs] -= removed
        self._update_residual(now.displacement)
        forces = np.maximum(self._residual.array_r[self._top.dofs], 0.0)
        slack = 1e-8 * largest(now.displacement.array_r, self._comm)
        forces = np.where(now.active, forces, 0.0)
        return ContactSolution(
            end=Guess(now.plane, now.displacement.array_r.copy(), forces),
            nodal_force=forces,
            # vertices of quadratic triangles touch without a force
            touching=now.active | (depth > -slack),
            iterations=sets,
            linear_iterations=spent,
            reason="CONVERGED_ACTIVE_SET" if self._count(now.active) else "CONVERGED_NO_CONTACT",
        )

    def _update_residual(self, displacement: PETSc.Vec) -> None:
        """Set the residual −K u of a displacement; on the top it is the contact forces."""
        self._body.stiffness.mult(displacement, self._residual)
        self._residual.scale(-1.0)

    def _depth(self, now: _Iterate) -> Array:
        """Return how far the plane is below the nodes that can give way, shape (n,) [mm]."""
        downward = -now.displacement.array_r[self._top.dofs]
        return np.where(self._top.held, -np.inf, self._plane.interference(now.plane, downward))

    def _first(self, moved: Flags) -> Flags:
        """Keep the first of the flags, over all ranks (Murty 1974: such changes cannot cycle)."""
        comm = self._comm
        lowest = comm.allreduce(comm.rank if moved.any() else comm.size, min)
        alone = np.zeros_like(moved)
        if comm.rank == lowest:
            alone[np.argmax(moved)] = True
        return alone

    def _norm(self, values: Array) -> float:
        return float(np.sqrt(self._comm.allreduce(float(values @ values))))

    def _count(self, flags: Flags) -> int:
        return int(self._comm.allreduce(int(np.count_nonzero(flags))))


Method = Literal["active-set", "augmented-lagrangian"]

_PASSED = 1e-5
"""Interference at nodes that a support holds relative to the largest displacement: that of points
which the augmented Lagrangian allows on quadratic elements."""


class UnilateralContactProblem:
    """A body with a rough face, its top, pressed by a rigid plane.

    Args:
        body: A block whose top is rough, or the rough face of any body.
        reference_height: Height z of the highest point, from which the approach counts [mm].
        method: ``"active-set"``: no node of the top lies behind the plane;
            ``"augmented-lagrangian"``: no quadrature point of its facets does.
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
        self._face, self.body, self.top = face, face.body, TopNodes(face, patches)
        x, y, distance = self.top.x, self.top.y, reference_height - self.top.height
        self._preload = self.body.preload()
        if self._preload is not None:  # moved by its supports or other loads before contact
            distance = distance - self._preload[self.top.dofs]
        self._plane = PlaneOverNodes(x, y, distance, face.lengths, self.body.comm)
        kind = PrimalDualActiveSet if method == "active-set" else AugmentedLagrangian
        self.method: PrimalDualActiveSet | AugmentedLagrangian = kind(face, self.top, self._plane)
        self._at_rest = Guess(*map(np.zeros, (3, self.body.owned_dofs, self.method.points)))
        self._last: list[tuple[Guess, float]] = []

    def solve(self, control: Control) -> FaceEquilibrium:
        """Find the contact of one load step, with an initial guess from the steps before.

        A force and a moment of zero are met to `macro.linear_solvers.constrained.TOLERANCE` of the
        force, or to what ``-patchlaw_ksp_rtol`` asks for. Without any force the plane just touches
        the highest node, tilted as is prescribed or as it was last.

        Args:
            control: What is prescribed of the plane.

        Raises:
            NotConverged: When an iteration fails, or nothing can hold the plane; the earlier
                solutions stay what they were, so that a smaller step can be tried.
            NotBalanced: When the plane has passed nodes that a support holds, or the supports do
                not bear what the contact exerts.
        """
        guess = self._extrapolated(control)
        guess = guess._replace(plane=self._plane.placed(control, guess.plane))
        solution = self.method.solve(control, guess)
        self._check_supports(control, solution)
        state = self._state(control, solution)
        self._last = [*self._last[-1:], (solution.end, state.force)]
        compat.collect_garbage(self.body.stiffness.comm)
        return state

    def _extrapolated(self, control: Control) -> Guess:
        """Return the line through the last two solutions at the prescribed approach or force.

        It goes at most as far, forwards or backwards, as they are apart.
        """
        if not self._last:
            return self._at_rest
        (before, force_before), (last, force) = self._last[0], self._last[-1]
        if control.approach is not None:
            run, ahead = last.plane[0] - before.plane[0], control.approach - last.plane[0]
        else:
            run, ahead = force - force_before, (control.force or 0.0) - force
        share = float(np.clip(ahead / run, -1.0, 1.0)) if run else 0.0
        pairs = zip(last, before, strict=True)
        return Guess(*(new + share * (new - old) for new, old in pairs))

    def _check_supports(self, control: Control, solution: ContactSolution) -> None:
        """Refuse a plane that has passed nodes that supports hold: nothing there can give way.

        The finer the mesh, the larger the force would be, without limit.
        """
        top, (plane, moved, _) = self.top, solution.end
        passed = self._plane.interference(plane, -moved[top.dofs])
        passed = np.where(top.held, passed, 0.0)
        allowed = _PASSED * largest(moved, self.body.comm)
        count = self.body.comm.allreduce(int(np.count_nonzero(passed > allowed)))
        if count:
            farthest = largest(np.maximum(passed, 0.0), self.body.comm)
            raise NotBalanced(
                f"the contact of the rough body at {control}",
                reason=f"SUPPORT_IN_CONTACT: the plane is up to {1e3 * farthest:.4g} µm below "
                f"{count} nodes of the contact face that a support holds",
                iterations=solution.iterations,
                remedy="hold the body apart from its contact, or press less far",
            )

    def _reaction(self, control: Control, solution: ContactSolution, force: float) -> float:
        """Return what the supports bear, see `macro.contact.face_equilibrium`."""
        displacement, load = self.body.stiffness.createVecs()
        displacement.array[:] = solution.end.displacement
        load.array[self.top.dofs] = -solution.nodal_force
        return checked_reaction(
            self._face.loaded,
            displacement,
            load,
            force=force,
            tolerance=contact_tolerance(),
            what=f"the rough body at {control}",
            iterations=solution.iterations,
        )

    def _state(self, control: Control, solution: ContactSolution) -> FaceEquilibrium:
        """Return the state of a solution; collective."""
        body, top, (plane, moved, _) = self.body, self.top, solution.end
        downward = -moved[top.dofs]
        gap = -self._plane.interference(plane, downward)
        loads = self._plane.levers.loads(solution.nodal_force)
        tilted = (top.patches.centres - self._plane.centre) @ plane[1:]
        nodal_force, touching = np.maximum(solution.nodal_force, 0.0), solution.touching
        area = np.where(touching, top.area, 0.0)
        weight = np.stack([top.area, top.area * gap, area, touching], axis=1)
        region, contacts = top.regions(touching)
        pressure, patch_force = top.pressure(nodal_force), top.patch_sums(solution.nodal_force)
        whole, volume, contact, nodes = body.comm.allreduce(weight.sum(axis=0))
        (approach, tx, ty), (xc, yc) = map(float, plane), map(float, self._plane.centre)
        return FaceEquilibrium(
            plane=RigidPlane(approach=approach, tilt=(tx, ty), centre=(xc, yc)),
            force=float(loads[0]),
            moment=loads[1:],
            patch_force=patch_force,
            patch_pressure=patch_force / top.patches.area,
            patch_closure=plane[0] + tilted - top.patch_means(downward),
            contact_area=top.covered_area(touching, nodal_force, np.maximum(gap, 0.0)),
            displacement=moved + (0.0 if self._preload is None else self._preload),
            reaction=self._reaction(control, solution, float(loads[0])),
            iterations=solution.iterations,
            linear_iterations=solution.linear_iterations,
            reason=solution.reason,
            patch_area=top.patch_sums(area),
            nodal_area=float(contact),
            nodes=round(nodes),
            contacts=contacts,
            mean_separation=float(volume / whole),
            peak_pressure=body.comm.allreduce(float(pressure.max(initial=0.0)), max),
            nodal=NodalContact(top.x, top.y, solution.nodal_force, top.area, pressure, gap, region),
        )


def nodal_contact(problem: UnilateralContactProblem, state: FaceEquilibrium) -> NodalContact:
    """Gather the contact of all nodes of the top, in the order of their places.

    Args:
        problem: The contact problem.
        state: One of its states.

    Returns:
        The contact, the same on every rank; forces that hold a node count as none.

    Note:
        Collective.
    """
    assert state.nodal is not None
    own = state.nodal._replace(force=np.maximum(state.nodal.force, 0.0))
    parts = problem.body.comm.allgather(own)
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    order = np.lexsort((columns[1], columns[0]))
    return NodalContact(*(column[order] for column in columns))
