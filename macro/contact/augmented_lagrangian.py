"""Contact at the quadrature points of a rough top by an augmented Lagrangian, or by a penalty.

With d the depth of a point beyond the plane and k a stiffness, the pressures are

    p = ⟨p₀ + k d⟩,   ⟨·⟩ the positive part.

Without multipliers p₀ that is the penalty method, p = k ⟨d⟩. The augmented Lagrangian takes the
pressures found as the next multipliers until no point in contact is beyond the plane
(Alart & Curnier 1991, doi 10.1016/0045-7825(91)90022-X); for every p₀ the generalised Newton's
method finds the equilibrium, its steps shortened where the energy asks for it.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from macro.block import Block
from macro.contact.augmented_law import AugmentedLaw, facet_sizes
from macro.contact.augmented_newton import LOOSEST, SPARE, FacetNewton
from macro.contact.contact_law import Contact
from macro.contact.equilibrium import Equilibrium
from macro.contact.extrapolated_start import Start, StepHistory
from macro.contact.face_nodes import TopNodes
from macro.contact.law_interface import Interface
from macro.contact.plane_over_nodes import PlaneOverNodes, not_found
from macro.contact.unilateral_state import Found
from macro.linear_solvers.constrained import contact_tolerance

Array = NDArray[np.float64]

PENETRATION = {1: 1e-8, 2: 1e-5}
"""Depth of quadrature points beyond the plane, and gap of those under pressure, relative to the
largest displacement, by the element's degree: on quadratic facets points nearly repeat each
other's conditions, and multipliers that share one load settle slowly."""

_SOFT, _HARD = 30.0, 1000.0  # stiffness at first and at last: E* over the facet
_HARDER, _HARDEST = 10.0, 10.0  # growth of the stiffness between updates, and all in all
_FALL = 0.1  # of the penetration by an update; else springs are too soft
_MOST_UPDATES = 40
_NO_FORCE = 1e-6  # of the largest nodal force: none
_TINY = 1e-300


class AugmentedLagrangian:
    """Presses the facets of a rough top; see the module.

    Args:
        block: The block.
        top: Its top.
        plane: The plane over the nodes of the top.
        penalty: The stiffness k [MPa/mm]; None: 1000 E* over the size of each facet.
        exact: Whether multipliers make up for the penetration.

    Note:
        Everything here is collective.
    """

    def __init__(
        self,
        block: Block,
        top: TopNodes,
        plane: PlaneOverNodes,
        penalty: float | None,
        *,
        exact: bool,
    ) -> None:
        self._block, self._top, self._plane, self._exact = block, top, plane, exact
        whole = PatchGrid(grid=(1, 1), lengths=block.mesh.shape.interface)
        self._interface = interface = Interface(block, whole, degree=2 * block.degree)
        self._sampling = sampling = interface.pointwise
        (rest,) = top.spread(plane.distance)
        points = interface.quadrature
        unit = block.material.contact_modulus / facet_sizes(points.cell, points.weight)
        self._stiff = _HARD * unit if penalty is None else np.full_like(unit, penalty)
        self._soft = np.minimum(_SOFT * unit, self._stiff)
        self._tolerance = contact_tolerance()
        self._penetration = PENETRATION[block.degree]
        self._law = AugmentedLaw(np.sum(points.values * rest[points.nodes], axis=1))
        self._contact = Contact(interface, sampling, [self._law])
        self._equilibrium = Equilibrium(block, sampling, self._contact)
        self._newton = FacetNewton(self._equilibrium, self._law, interface, top, plane)
        self._history = StepHistory(block.owned_dofs, len(points.x))

    def solve(self, control: Control) -> Found:
        """Find the contact of a load step, starting from those before.

        Raises:
            NotConverged: When an iteration fails or nothing can hold the plane; earlier solutions
                stay what they were.
        """
        start = self._history.start(control)
        contact, law = self._contact, self._law
        contact.control, contact.plane = control, self._plane.placed(control, start.plane)
        law.multiplier = np.maximum(start.contact, 0.0) if self._exact else 0.0 * start.contact
        displacement = self._block.stiffness.createVecRight()
        displacement.array[:] = start.displacement
        steps, spent, tolerance, before = 0, 0, LOOSEST, np.inf
        law.slope, hardest = self._soft, self._stiff
        for _ in range(_MOST_UPDATES):
            more, cycles = self._newton.solve(displacement, tolerance, control)
            steps, spent = steps + more, spent + cycles
            closure = self._equilibrium.closure(displacement)
            # depth under no pressure, depth or gap under pressure
            depth = self._largest((law.pressure(closure) - law.multiplier) / law.slope)
            excess = depth / max(self._penetration * self._largest(displacement.array_r), _TINY)
            hard = bool(np.all(law.slope >= self._stiff))
            hard = bool(self._block.mesh.comm.allreduce(hard, op=MPI.LAND))
            if hard and tolerance <= self._tolerance and (excess <= 1.0 or not self._exact):
                return self._found(control, displacement, steps, spent)
            if self._exact:
                law.multiplier = law.pressure(closure)
            if self._exact and hard and excess > _FALL * before:
                hardest = np.minimum(_HARDER * hardest, _HARDEST * self._stiff)
            before = excess
            law.slope = np.minimum(_HARDER * law.slope, hardest)
            near = min(0.1 * tolerance, SPARE * self._penetration * excess) if self._exact else 0.0
            tolerance = max(self._tolerance, near) if hard or not self._exact else tolerance
        raise not_found(control, "MULTIPLIERS", _MOST_UPDATES)

    def _found(self, control: Control, displacement: PETSc.Vec, steps: int, spent: int) -> Found:
        closure, plane = self._equilibrium.closure(displacement), self._contact.plane.copy()
        pressure, load = self._law.pressure(closure), displacement.duplicate()
        samples = self._sampling.operator.createVecRight()
        samples.array[:] = pressure
        self._sampling.operator.mult(samples, load)
        nodal_force = -load.array_r[self._top.dofs]
        gap = -self._plane.penetration(plane, -displacement.array_r[self._top.dofs])
        touching = nodal_force > _NO_FORCE * self._largest(nodal_force)
        if self._exact and self._largest(nodal_force):
            touching |= gap < self._penetration * self._largest(displacement.array_r)
        values = displacement.array_r.copy()
        self._history.add(
            Start(plane, values, pressure), float(self._plane.levers.loads(nodal_force)[0])
        )
        reason = "CONVERGED_MULTIPLIERS" if self._exact else "CONVERGED_PENALTY"
        return Found(
            plane=plane,
            displacement=values,
            nodal_force=nodal_force,
            touching=touching,
            active_sets=steps,
            linear_iterations=spent,
            reason=reason if self._largest(nodal_force) else "CONVERGED_NO_CONTACT",
        )

    def _largest(self, values: Array) -> float:
        largest = float(np.abs(values).max(initial=0.0))
        return float(self._block.mesh.comm.allreduce(largest, op=MPI.MAX))
