"""First steps of Newton's method, where laws are steep and the solution is far.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from macro.contact.equations import Equilibrium
from macro.contact.face_layer import FaceLayer
from macro.contact.initial_guess import DisplacementBasis
from macro.contact.lines import Lines, law_lines
from macro.contact.sampling import Sampling
from support.arrays import Array
from support.errors import NotConverged

NEAR = 3e-3
"""Residual over the contact forces from which Newton's method goes on alone. With 0.01 three rings
pressed to an approach by two laws took four steps along a path, in place of three."""
_MOST_STEPS = 8
_TOLERANCE, _ROUGHLY = 1e-4, 1e-3
"""Relative tolerance of linear solves, and that by a prescribed force in a first load or with
friction, which took 5 to 10 % more iterations with 1e-4. Under a prescribed approach an error of
the mean displacement is one of all closures, which with 0.01 were off by a stiff law's roughness. A
prescribed force corrects it. Along a path one such step leads near the solution: with 1e-3 two laws
on pads took four steps, in place of three with as many iterations."""


class FirstSteps:
    """Brings displacements near the equilibrium.

    Args:
        equilibrium: The equations.
        sampling: The samples that laws are evaluated at.
        follow: Lets the preconditioner follow the tangent.
        layer: The body near its face, for laws at points; None: laws of whole patches.

    Note:
        Everything is collective.
    """

    def __init__(
        self,
        equilibrium: Equilibrium,
        sampling: Sampling,
        follow: Callable[[], None],
        layer: FaceLayer | None = None,
    ) -> None:
        self._equilibrium, self._sampling, self._follow = equilibrium, sampling, follow
        self._forces, self._layer = equilibrium.forces, layer
        self._residual, self._load = equilibrium.matrix.createVecs()

    def take(
        self, solver: PETSc.KSP, displacement: PETSc.Vec, basis: DisplacementBasis
    ) -> tuple[list[float], int]:
        """Take steps from the guess of a basis until Newton's method converges fast.

        Args:
            solver: The linear solver of Newton's method.
            displacement: Receives the displacements with the least residual.
            basis: Earlier solutions.

        Returns:
            The residuals before every step, relative to the contact forces, and the number of
            linear iterations.
        """
        closure, pressure, shear = basis.write_guess(displacement)
        expected: Array | None = shear
        residuals = [self._relative_residual(displacement)]
        if residuals[0] <= NEAR or self._forces.control.force == 0.0:
            return [], 0
        best, step, spent = displacement.copy(), displacement.duplicate(), 0
        along_path, rubs = len(basis) > 1, shear.shape[1] > 0
        by_force = self._forces.control.force is not None
        tolerance = _ROUGHLY if by_force and (rubs or not along_path) else _TOLERANCE
        own, layer = solver.getTolerances()[0], self._layer if along_path else None
        solver.setOperators(self._equilibrium.tangent, self._equilibrium.matrix)
        while residuals[-1] > NEAR and len(residuals) <= _MOST_STEPS:
            lines = self._lines(displacement, closure, pressure, basis.stiffness, layer)
            self._linearise(displacement, lines, basis.stiffness, expected)
            self._follow()
            solver.setTolerances(rtol=tolerance)
            solver.solve(self._residual, step)
            if solver.reason < 0:
                break
            spent += int(solver.its)
            displacement.axpy(-1.0, step)
            closure, layer, expected = self._closure_on(lines, displacement), self._layer, None
            pressure = lines.at(closure)
            residuals.append(self._relative_residual(displacement))
            if residuals[-1] <= min(residuals):
                displacement.copy(best)
        best.copy(displacement)
        solver.setTolerances(rtol=own)
        return residuals[:-1], spent

    def _lines(
        self,
        displacement: PETSc.Vec,
        closure: Array,
        pressure: Array,
        stiffness: float,
        layer: FaceLayer | None,
    ) -> Lines:
        """Linearise the laws from predicted closures and pressures."""
        if layer is None:
            return law_lines(self._forces, closure, pressure, stiffness)
        displaced = self._sampling.displacements(displacement)
        return layer.lines(displaced, closure, pressure, stiffness)

    def _relative_residual(self, displacement: PETSc.Vec) -> float:
        try:
            self._equilibrium.residual(displacement, self._residual)
        except NotConverged:  # the plane, on closures that are out of all proportion
            return np.inf
        return float(self._residual.norm() / (self._equilibrium.scale or 1.0))

    def _closure_on(self, lines: Lines, displacement: PETSc.Vec) -> Array:
        """Bring the plane into equilibrium on linearised laws, and return the closures."""
        displaced = self._sampling.displacements(displacement)
        return self._forces.closure_on_lines(displaced, lines.at, lines.stiffness)

    def _linearise(
        self, displacement: PETSc.Vec, lines: Lines, body: float, shear: Array | None
    ) -> None:
        """Write the residual K u − B p with pressures p of linearised laws, and its derivative.

        Args:
            displacement: u [mm].
            lines: The laws as lines.
            body: Stiffness of the body [MPa/mm].
            shear: Predicted shear stresses; None: those on the lines before [MPa].
        """
        matrix, forces = self._equilibrium.matrix, self._forces
        closure = self._closure_on(lines, displacement)
        pressure, stiffness = lines.at(closure), lines.stiffness
        at = displacement, closure, pressure, stiffness
        forces.write_lines(*at, self._load, body=body, shear=shear)
        matrix.mult(displacement, self._residual)
        self._residual.axpy(-1.0, self._load)
