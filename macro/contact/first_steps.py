"""First steps of Newton's method, where laws are steep and the solution is far.

Newton's method linearises a law at the closures that its last step led to. Pressures of rough
surfaces grow almost exponentially with closure: closures too large by a roughness give pressures
and stiffnesses too large by orders of magnitude, and the next steps return from there little by
little. The pressure that the linearised law predicted is a better place to go on from where the law
is stiffer than the body, and the closure where it is softer. Between the two lies the point of the
law's curve that the sample reaches from there along the stiffness k of the body,

    p(c') + k c' = p + k c,

with the closure c and the pressure p predicted for it, and the law is linearised there: a proximal
step (Parikh & Boyd 2014, doi 10.1561/2400000003). Circuit simulators limit the voltages of diodes
for the same reason (Nagel 1975, SPICE2, section 4.4). Nothing but the place of linearisation
differs from Newton's method, and near the solution both are the same.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.contact.equations import Equilibrium
from macro.contact.sampling import Sampling

Array = NDArray[np.float64]

NEAR = 0.03
"""Residual over the contact forces from which Newton's method goes on alone."""
_MOST_STEPS = 8
_TOLERANCE = 0.01
"""Relative tolerance of linear solves. With 0.03 another step was needed."""
_BISECTIONS = 50


class Lines(NamedTuple):
    """Laws linearised at points of their curves.

    Attributes:
        closure: Closures of this rank's samples, shape (n,) [mm].
        pressure: Their pressures [MPa].
        stiffness: Their stiffnesses [MPa/mm].
    """

    closure: Array
    pressure: Array
    stiffness: Array

    def at(self, closure: Array) -> Array:
        """Return the pressures on the lines, shape (n,) [MPa]."""
        return self.pressure + self.stiffness * (closure - self.closure)


class FirstSteps:
    """Brings displacements near the equilibrium.

    Args:
        equilibrium: The equations.
        sampling: The samples that laws are evaluated at.
        follow: Lets the preconditioner follow the tangent.

    Note:
        Everything is collective.
    """

    def __init__(
        self, equilibrium: Equilibrium, sampling: Sampling, follow: Callable[[], None]
    ) -> None:
        self._equilibrium, self._sampling, self._follow = equilibrium, sampling, follow
        self._forces = equilibrium.forces
        self._residual, self._load = equilibrium.matrix.createVecs()

    def take(
        self, solver: PETSc.KSP, displacement: PETSc.Vec, pressure: Array
    ) -> tuple[list[float], int]:
        """Take steps until Newton's method converges fast.

        Args:
            solver: The linear solver of Newton's method.
            displacement: The initial guess; receives the displacements with the least residual.
            pressure: Pressures of this rank's samples that it follows from, shape (n,) [MPa].

        Returns:
            The residuals before every step, relative to the contact forces, and the number of
            linear iterations.
        """
        residuals = [self._relative_residual(displacement)]
        if residuals[0] <= NEAR or self._forces.control.force == 0.0:
            return [], 0
        best, step, spent = displacement.copy(), displacement.duplicate(), 0
        closure, stiffness = self._forces.closure(displacement), self._stiffness(displacement, pressure)
        lines = self._lines(closure, pressure, stiffness)
        solver.setOperators(self._equilibrium.tangent, self._equilibrium.matrix)
        while residuals[-1] > NEAR and len(residuals) <= _MOST_STEPS:
            self._forces.linearise(lines.stiffness)
            self._follow()
            self._write_linear_residual(displacement, lines)
            solver.setTolerances(rtol=_TOLERANCE)
            solver.solve(self._residual, step)
            if solver.reason < 0:
                break
            spent += int(solver.its)
            displacement.axpy(-1.0, step)
            closure = self._closure_on(lines, displacement)
            lines = self._lines(closure, lines.at(closure), stiffness)
            residuals.append(self._relative_residual(displacement))
            if residuals[-1] <= min(residuals):
                displacement.copy(best)
        best.copy(displacement)
        return residuals[:-1], spent

    def _relative_residual(self, displacement: PETSc.Vec) -> float:
        self._equilibrium.residual(displacement, self._residual)
        return float(self._residual.norm() / (self._equilibrium.scale or 1.0))

    def _stiffness(self, displacement: PETSc.Vec, pressure: Array) -> float:
        """Return the body's stiffness k under pressures that displace it, as a mean [MPa/mm]."""
        weighted = self._sampling.weight * pressure
        displaced = self._sampling.displacements(displacement)
        square, work = self._sum(np.array([weighted @ pressure, weighted @ displaced]))
        return float(square / work)

    def _closure_on(self, lines: Lines, displacement: PETSc.Vec) -> Array:
        """Bring the plane into equilibrium on linearised laws, and return the closures."""
        displaced = self._sampling.displacements(displacement)
        return self._forces.closure_on_lines(displaced, lines.at, lines.stiffness)

    def _write_linear_residual(self, displacement: PETSc.Vec, lines: Lines) -> None:
        """Write the residual K u − B p with pressures p of linearised laws."""
        samples, matrix = self._sampling.values, self._equilibrium.matrix
        pressure = lines.at(self._closure_on(lines, displacement))
        samples.array[:] = pressure
        self._sampling.operator.mult(samples, self._load)
        matrix.mult(displacement, self._residual)
        self._residual.axpy(-1.0, self._load)

    def _lines(self, closure: Array, pressure: Array, stiffness: float) -> Lines:
        """Linearise the laws where samples reach their curves along the body's stiffness.

        Args:
            closure: Predicted closures of this rank's samples, shape (n,) [mm].
            pressure: Predicted pressures [MPa].
            stiffness: k [MPa/mm].
        """
        forces = self._forces
        beyond = (forces.pressure(closure) - pressure) / stiffness
        low, high = closure - np.maximum(beyond, 0.0), closure - np.minimum(beyond, 0.0)
        wanted = pressure + stiffness * closure
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            above = forces.pressure(middle) + stiffness * middle > wanted
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return Lines(low, forces.pressure(low), forces.stiffness(low))

    def _sum(self, values: Array) -> Any:
        return self._forces.comm.allreduce(values, op=MPI.SUM)
