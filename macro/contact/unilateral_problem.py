"""A body whose rough face is meshed, under a rigid plane: one load step at a time.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from patchlaw.geometry.meshes.block import require_inside
from patchlaw.geometry.patches import PatchGrid
from patchlaw.geometry.rigid_plane import Control, RigidPlane
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
)
from patchlaw.macro.contact.unilateral_problem import PrimalDualActiveSet
from patchlaw.macro.linear_solvers.constrained import contact_tolerance
from patchlaw.support.errors import InputError, NotBalanced

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
            nodal=NodalContact(
                x=top.x,
                y=top.y,
                force=solution.nodal_force,
                area=top.area,
                pressure=pressure,
                gap=gap,
                region=region,
            ),
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
