"""Where Newton's method starts in a load step: a guess from the solutions before, and first steps.

With laws, guesses minimise the energy in the space of earlier solutions. Extrapolation took 1.8 to
3.2 times as many linear iterations over eight load steps with 4 patches and one closure for each,
and 3 to 24 % more with 16 and 64 patches or laws at points. Bodies of any material start from their
displacements, with samples on springs. First steps follow where laws are steep and the solution is
far.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.macro.contact.contact_forces import SMOOTH, ContactForces
from patchlaw.macro.contact.face_layer import FaceLayer, solved_lines
from patchlaw.macro.contact.newton import ContactEquations, Equilibrium
from patchlaw.macro.contact.pressed_plane import Lines, Prediction, law_lines
from patchlaw.support import Array, NotConverged

_ROUNDING = 1e-7
"""Smallest part of a displacement that must be new to the basis; less only adds rounding."""

_STEPS = 10
"""Steps in the basis."""

_CLOSE = 1e-3
"""Last step in the basis, relative to the guess."""

NEAR = 3e-3
"""Residual over the contact forces from which Newton's method goes on alone. With 0.01 three rings
pressed to an approach by two laws took four steps along a path, in place of three."""
_NEAR_SLIDING = 1e-3
"""The same with friction, where line searches cut steps to a tenth while samples turn from sticking
to slipping: with 0.05 a load of steep laws took 38 steps, 14 along the lines."""
_MOST_STEPS, _MOST_SLIDING = 8, 20
"""Most steps, and with friction, unless the first eight have not lessened the residual."""
_TOLERANCE, _ROUGHLY = 1e-4, 1e-3
"""Relative tolerance of linear solves, and that by a prescribed force in a first load or with
friction, which took 5 to 10 % more iterations with 1e-4. Under a prescribed approach an error of
the mean displacement is one of all closures, which with 0.01 were off by a stiff law's roughness. A
prescribed force corrects it. Along a path one such step leads near the solution: with 1e-3 two laws
on pads took four steps, in place of three with as many iterations."""


class DisplacementBasis:
    """Earlier displacements, orthonormal in the block's energy, as a basis for initial guesses.

    The block is linear, so every solution lies in the space K⁻¹ range(B), which has as many
    dimensions as there are samples. Galerkin's method in the span of the earlier solutions needs no
    linear solve and gives the initial guess of least error in the energy norm, which includes
    extrapolation. Once the basis has as many dimensions as there are patches, the guess is the
    solution.

    Args:
        equilibrium: The equations that are being solved.
        size: Largest number of vectors; the oldest are dropped first.

    Attributes:
        vectors: W, this rank's degrees of freedom of the k vectors, shape (n,) each [mm]. They are
            all that is kept; three products with K for every solution replace their forces.

    Note:
        Collective.
    """

    def __init__(self, equilibrium: Equilibrium, *, size: int = 32) -> None:
        sampling = equilibrium.forces.sampling
        self._equilibrium, self._sampling, self._size = equilibrium, sampling, size
        self._comm = equilibrium.body.comm
        self.vectors: list[Array] = []
        count, ways = len(sampling.weight), equilibrium.forces.directions
        # what samples move by in each against their directions, times their weights [mm³]
        self._stretches: Array = np.empty((0, count, ways))
        self._stresses: Array = np.empty((0, count, ways))  # that displacements follow from [MPa]
        self._last: Array = np.empty(0)  # the latest solution in the basis

    def __len__(self) -> int:
        return len(self.vectors)

    def add(
        self, displacement: PETSc.Vec, pressure: Array, shear: Array, *, solved: bool = True
    ) -> None:
        """Add the part of a displacement that is new to the basis.

        Args:
            displacement: The displacement [mm].
            pressure: Pressures of this rank's samples that it follows from, shape (n,) [MPa].
            shear: Shear stresses likewise, shape (n, 2); (n, 0) without friction [MPa].
            solved: Whether it is a solution, from which the next guess is looked for.

        Note:
            Collective.
        """
        stiffness = self._equilibrium.body.stiffness
        stresses = np.column_stack([pressure, shear])
        work, force = displacement.copy(), displacement.duplicate()
        vector, before, last = work.array, 0.0, np.zeros(len(self))
        for _ in range(2):  # a second pass removes what rounding left
            stiffness.mult(work, force)
            before = before or self._sum(vector @ force.array_r)
            shares = self._sum(np.array([each @ force.array_r for each in self.vectors]))
            for share, each in zip(shares, self.vectors, strict=True):
                vector -= share * each
            stresses, last = stresses - np.tensordot(shares, self._stresses, 1), last + shares
        stiffness.mult(work, force)
        square = self._sum(vector @ force.array_r)
        is_new = square > _ROUNDING**2 * before
        last = np.append(last, square**0.5) if is_new else last
        self._last = last if solved else np.zeros_like(last)
        if not is_new:
            return
        vector /= square**0.5
        first = max(0, len(self) + 1 - self._size)
        self.vectors = [*self.vectors, vector.copy()][first:]
        stretch = self._equilibrium.forces.stretched(work)[None]
        self._stretches = np.concatenate([self._stretches, stretch])[first:]
        self._stresses = np.concatenate([self._stresses, stresses[None] / square**0.5])[first:]
        self._last = self._last[first:]

    @property
    def stiffness(self) -> float:
        """Stiffness of the body under the latest pressures, or any of the basis [MPa/mm]."""
        y = self._last if self._last.any() else np.eye(1, len(self))[0]
        pressure, stretch = y @ self._stresses[..., 0], y @ self._stretches[..., 0]
        square = self._sum((self._sampling.weight * pressure) @ pressure)
        return float(square / self._sum(pressure @ stretch))

    @property
    def along_path(self) -> bool:
        """Whether it holds more than one solution."""
        return len(self) > 1

    def begin(self, displacement: PETSc.Vec) -> list[Start]:
        """Write the state of least energy; see `write_guess`."""
        return [Start(*self.write_guess(displacement), self.stiffness)]

    def write_guess(self, into: PETSc.Vec) -> tuple[Array, Array, Array]:
        """Write the state of least energy in the basis under what is prescribed of the plane.

        It solves y = Wᵀ B p(closure(W y)), with the laws as lines, from the latest solution; shear
        stresses are those of sliders.

        Returns:
            Closures of this rank's samples there [mm], and the pressures that the displacements
            follow from [MPa], shape (n,) each; the shear stresses likewise, shape (n, 2 or 0).
        """
        forces, stiffness = self._equilibrium.forces, self.stiffness
        y = self._last if forces.control.force != 0.0 else np.zeros(len(self))
        pressure = y @ self._stresses[..., 0]
        sampled = self._stretches[..., 0] / self._sampling.weight
        closure = forces.guessed_closure(y @ sampled)
        lines = law_lines(forces, closure, pressure, stiffness)
        for _ in range(_STEPS):
            change = self._step(y, lines)
            y = y - change
            closure = forces.closure_on_lines(y @ sampled, lines)
            lines = law_lines(forces, closure, lines.at(closure), stiffness)
            if np.linalg.norm(change) <= _CLOSE * np.linalg.norm(y):
                break
        into.set(0.0)
        for share, vector in zip(y, self.vectors, strict=True):
            into.array[:] += share * vector
        stresses = np.tensordot(y, self._stresses, 1)
        return closure, stresses[:, 0], stresses[:, 1:]

    def _step(self, y: Array, lines: Lines) -> Array:
        """Return the step to the solution in the basis with linearised laws."""
        forces, weight, columns = (
            self._equilibrium.forces,
            self._sampling.weight,
            self._stretches[..., 0],
        )
        closure = forces.closure_on_lines(y @ columns / weight, lines)
        pressure = lines.at(closure)
        parts = np.vstack([
            -columns @ pressure,
            (columns * (lines.stiffness / weight)) @ columns.T,
            (columns @ forces.border(lines.stiffness)).T,
        ])  # fmt: skip
        forces.write_shear_in(parts, y, self._stretches, closure, lines)
        parts = self._sum(parts)
        stiff, border = parts[1 : len(y) + 1], parts[len(y) + 1 :]
        return np.linalg.solve(np.eye(len(y)) + stiff - border.T @ border, y + parts[0])

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)


class Start(NamedTuple):
    """What is predicted of a contact before the first step.

    Attributes:
        closure: Closures of this rank's samples, shape (n,) [mm].
        pressure: Pressures that displacements follow from, shape (n,) [MPa].
        shear: Shear stresses likewise, shape (n, 2 or 0) [MPa]; None without friction.
        stiffness: That of the body under such pressures [MPa/mm].
        rest: Where the stiffness is to be found: pressures and displacements of the samples into
            the body that changes count from, shape (2, n); None: it is known.
    """

    closure: Array
    pressure: Array
    shear: Array | None
    stiffness: float
    rest: Array | None = None


class SpringGuess:
    """Guesses the contact of a body of any material, whose samples resist like springs.

    Displacements stay what they are. Under the new plane samples close in further, or pressures
    must grow with the force: closures and pressures are those in series with springs of the
    body's stiffness, which were at rest under the latest pressures.

    Args:
        equations: The equations.

    Attributes:
        pressures: Pressures of this rank's samples that displacements follow from, of each contact.

    Note:
        Every method is collective.
    """

    along_path = False

    def __init__(self, equations: ContactEquations) -> None:
        self._equations = equations
        self.pressures = [np.zeros(len(forces.weight)) for forces in equations.contacts]
        self._displaced = [np.zeros_like(pressure) for pressure in self.pressures]
        self._stiffness: dict[int, float] = {}

    def learn(self, displacement: PETSc.Vec, pressures: Sequence[Array]) -> None:
        """Take a solution, whose change from the one before tells how stiff the body is."""
        for k, (forces, pressure) in enumerate(
            zip(self._equations.contacts, pressures, strict=True)
        ):
            displaced = forces.sampling.displacements(displacement)
            change = pressure - self.pressures[k], displaced - self._displaced[k]
            self._stiffness[k] = forces.secant(*change, self._stiffness_of(k))
            self.pressures[k], self._displaced[k] = pressure, displaced

    def _stiffness_of(self, contact: int) -> float:
        if contact not in self._stiffness:
            self._stiffness[contact] = SMOOTH * self._equations.elements(contact)
        return self._stiffness[contact]

    def begin(self, displacement: PETSc.Vec) -> list[Start]:
        """Return closures and pressures in series with springs."""
        moved = displacement.norm() > 0.0
        return [self._start(k, displacement, moved=moved) for k in range(len(self.pressures))]

    def _start(self, contact: int, displacement: PETSc.Vec, *, moved: bool) -> Start:
        forces = self._equations.contacts[contact]
        stiffness = self._stiffness_of(contact)
        before = self.pressures[contact] * moved
        displaced = forces.sampling.displacements(displacement)
        closure = forces.guessed_closure(displaced)
        rest = np.array([before, displaced])
        return Start(closure, before, forces.last_shear, stiffness, rest)


_CLOSE_TO_STEEP, _FINEST = 0.1, 1e-9
"""Tolerance of linear solves times the stiffness of laws over that of the body, and the least one:
laws make pressures of displacements that are wrong, the more the steeper they are."""


class FirstSteps:
    """Brings displacements near the equilibrium.

    Args:
        equations: The equations.
        guess: Where they start.
        follow: Lets the preconditioner follow the tangent.

    Note:
        Everything is collective.
    """

    def __init__(
        self,
        equations: ContactEquations,
        guess: DisplacementBasis | SpringGuess,
        follow: Callable[[], None] = lambda: None,
    ) -> None:
        self._equations, self._guess, self._follow = equations, guess, follow
        self._contacts = equations.contacts
        # the body near its face, for laws at points
        self._layers = [
            FaceLayer(equations, k) if forces.mode == "pointwise" else None
            for k, forces in enumerate(self._contacts)
        ]
        self._residual = equations.matrix.createVecLeft()
        self._best, self._step = equations.matrix.createVecs()

    def take(self, solver: PETSc.KSP, displacement: PETSc.Vec, most: int) -> tuple[Array, int]:
        """Take steps from the guess until Newton's method converges fast.

        Args:
            solver: The linear solver of Newton's method.
            displacement: Receives the displacements with the least residual.
            most: Largest number of steps.

        Returns:
            The residuals before every step, relative to the contact forces, and the number of
            linear iterations.
        """
        contacts, states = self._contacts, self._guess.begin(displacement)
        residuals = [self._relative_residual(displacement)]
        controls = [forces.control for forces in contacts]
        rubs = any(forces.sliders for forces in contacts)
        near, steps = (_NEAR_SLIDING, _MOST_SLIDING) if rubs else (NEAR, _MOST_STEPS)
        if residuals[0] <= near or any(control.force == 0.0 for control in controls):
            return np.empty(0), 0
        best, step, spent = self._best, self._step, 0
        displacement.copy(best)
        along_path = self._guess.along_path
        by_force = all(control.force is not None for control in controls)
        tolerance = _ROUGHLY if by_force and (rubs or not along_path) else _TOLERANCE
        own, layered = solver.getTolerances()[0], along_path
        try:
            while residuals[-1] > near and len(residuals) <= min(steps, most):
                if len(residuals) > _MOST_STEPS and np.nanmin(residuals) >= residuals[0]:
                    break
                given = [
                    self._predicted(k, displacement, state, layered=layered)
                    for k, state in enumerate(states)
                ]
                self._equations.linearise(displacement, given, self._residual)
                self._follow()
                solver.setTolerances(rtol=min(tolerance, self._finest(given)))
                solver.solve(self._residual, step)
                if solver.reason < 0:
                    break
                spent += int(solver.its)
                displacement.axpy(-1.0, step)
                layered = True
                states = [
                    self._after(forces, displacement, each.lines, state)
                    for forces, each, state in zip(contacts, given, states, strict=True)
                ]
                residuals.append(self._relative_residual(displacement))
                if np.isfinite(residuals[-1]) and residuals[-1] <= np.nanmin(residuals):
                    displacement.copy(best)
        finally:
            solver.setTolerances(rtol=own)
        best.copy(displacement)
        return np.array(residuals[:-1]), spent

    def _finest(self, given: Sequence[Prediction]) -> float:
        """Return the tolerance of a linear solve whose error laws do not make one of pressures."""
        shares = [_CLOSE_TO_STEEP]
        for forces, (lines, body, _) in zip(self._contacts, given, strict=True):
            weight = forces.weight * lines.pressure
            steep, total = forces.comm.allreduce(np.array([weight @ lines.stiffness, weight.sum()]))
            shares.append(_CLOSE_TO_STEEP * body * total / steep if steep > 0.0 else np.inf)
        return max(min(shares), _FINEST)

    def _predicted(
        self, contact: int, displacement: PETSc.Vec, state: Start, *, layered: bool
    ) -> Prediction:
        """Return the laws of a contact as lines."""
        forces, layer = self._contacts[contact], self._layers[contact]
        displaced = forces.sampling.displacements(displacement)
        closure, pressure, stiffness = state.closure, state.pressure, state.stiffness
        if layer is None or not layered:
            lines = law_lines(forces, closure, pressure, stiffness)
            lines = solved_lines(forces, displaced, pressure, lines, stiffness)
        else:
            lines = layer.lines(displaced, closure, pressure, stiffness)
        return Prediction(lines, stiffness, state.shear)

    def _after(
        self, forces: ContactForces, displacement: PETSc.Vec, lines: Lines, before: Start
    ) -> Start:
        """Return what a step predicts of a contact."""
        displaced = forces.sampling.displacements(displacement)
        closure = forces.closure_on_lines(displaced, lines)
        pressure, stiffness = lines.at(closure), before.stiffness
        if before.rest is not None:
            at_rest, moved = before.rest
            stiffness = forces.secant(pressure - at_rest, displaced - moved, stiffness)
        shear = forces.shear_on_lines(displacement, closure)
        return Start(closure, pressure, shear, stiffness, before.rest)

    def _relative_residual(self, displacement: PETSc.Vec) -> float:
        try:
            self._equations.residual(displacement, self._residual)
        except NotConverged:  # the plane, on closures that are out of all proportion
            return np.inf
        return float(self._residual.norm() / (self._equations.scale or 1.0))
