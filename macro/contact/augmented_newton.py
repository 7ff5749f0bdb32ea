"""Equilibrium of a block whose top stands on unilateral springs, by generalised Newton's method."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from geometry.rigid_plane import Control
from macro import compat
from macro.contact.augmented_law import AugmentedLaw
from macro.contact.equilibrium import Equilibrium
from macro.contact.face_nodes import TopNodes
from macro.contact.law_interface import Interface
from macro.contact.plane_over_nodes import PlaneOverNodes, not_found
from macro.linear_solvers.options import reason_name
from macro.linear_solvers.stiff_preconditioner import StiffPreconditioner

LOOSEST, SPARE = 0.03, 0.3
"""Relative residual of linear solves, at first, and in tolerances that are asked for."""

_MOST_STEPS, _HALVINGS = 60, 30
_ON = 1e-12  # of a basis function: its node is not on the facet
_ENOUGH = 0.9  # share of the energy's slope that a step may leave


class FacetNewton:
    """Newton's method under fixed multipliers, its steps shortened where the energy asks for it.

    Args:
        equilibrium: The equations.
        law: Law of the quadrature points; multipliers and stiffnesses may change between solves.
        interface: Whose quadrature points they are.
        top: Nodes of the top.
        plane: The plane over the nodes.

    Note:
        Everything here is collective.
    """

    def __init__(
        self,
        equilibrium: Equilibrium,
        law: AugmentedLaw,
        interface: Interface,
        top: TopNodes,
        plane: PlaneOverNodes,
    ) -> None:
        self._equilibrium, self._law, self._interface = equilibrium, law, interface
        self._top, self._plane, block = top, plane, equilibrium.block
        self._preconditioner = StiffPreconditioner(
            block.stiffness, block.solver.pc, interface.points_by_dofs, layers=3 - block.degree
        )
        self._ksp = PETSc.KSP().create(block.stiffness.comm)
        self._ksp.setPC(self._preconditioner.pc)
        self._ksp.setOperators(equilibrium.tangent, block.stiffness)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)

    def solve(self, displacement: PETSc.Vec, tolerance: float, control: Control) -> tuple[int, int]:
        """Find the equilibrium.

        Args:
            displacement: Start; receives the solution [mm].
            tolerance: Norm of the residual relative to that of the contact forces.
            control: What is prescribed, for an error.

        Returns:
            Newton's steps and the linear iterations.

        Raises:
            NotConverged: When Newton's method, its line search or a linear solve fails.
        """
        equilibrium, spent = self._equilibrium, 0
        residual, step = displacement.duplicate(), displacement.duplicate()
        for steps in range(_MOST_STEPS):
            equilibrium.residual(displacement, residual)
            norm, scale = residual.norm(), equilibrium.scale
            if norm <= tolerance * scale:
                return steps, spent
            if not scale:  # nothing presses
                displacement.set(0.0)
                continue
            self._linearise(displacement)
            rtol = max(min(LOOSEST, norm / scale), SPARE * tolerance * scale / norm)
            self._ksp.setTolerances(rtol=rtol, max_it=1000)
            self._ksp.solve(residual, step)
            spent += int(self._ksp.its)
            if self._ksp.reason < 0:
                name = reason_name(PETSc.KSP.ConvergedReason, self._ksp.reason)
                raise not_found(control, name, spent)
            self._advance(displacement, residual, step, control)
            compat.collect_garbage(displacement.comm)  # a field of every step
        raise not_found(control, "NEWTON", _MOST_STEPS)

    def _linearise(self, displacement: PETSc.Vec) -> None:
        """Move the tangent and its preconditioner to a displacement."""
        self._equilibrium.update_tangent(displacement)
        slope = self._law.stiffness(self._equilibrium.closure(displacement))
        points = self._interface.quadrature
        rows, columns = np.nonzero((np.abs(points.values) > _ON) & (slope > 0.0)[:, None])
        marks = self._top.collect(points.nodes[rows, columns], np.ones(len(rows)))
        sprung = marks > 0.0
        free = self._equilibrium.contact.control.free
        motions = self._plane.levers.scaled(free)[sprung]
        motions = motions @ self._plane.supported_motions(free, sprung)
        self._preconditioner.update(slope / points.weight, self._top.dofs[sprung], motions)

    def _advance(
        self, displacement: PETSc.Vec, residual: PETSc.Vec, step: PETSc.Vec, control: Control
    ) -> None:
        """Go back along a step until the slope of the energy along it has fallen."""
        slope, low, high, share = residual.dot(step), 0.0, np.inf, 1.0
        start = displacement.copy()
        for _ in range(_HALVINGS):
            displacement.waxpy(-share, step, start)
            self._equilibrium.residual(displacement, residual)
            left = residual.dot(step)
            if abs(left) <= _ENOUGH * abs(slope):
                return
            low, high = (share, high) if left > 0.0 else (low, share)
            share = 3.0 * share if high == np.inf else 0.5 * (low + high)
        raise not_found(control, "LINE_SEARCH", _HALVINGS)
