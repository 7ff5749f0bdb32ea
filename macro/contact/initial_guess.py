"""Where Newton's method starts in a load step: a guess from the solutions before, and first steps.

With laws, guesses minimise the energy in the space of earlier solutions. Extrapolation took 1.8 to
3.2 times as many linear iterations over eight load steps with 4 patches and one closure for each,
and 3 to 24 % more with 16 and 64 patches or laws at points. First steps follow where laws are steep
and the solution is far.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.macro.contact.contact_forces import SMOOTH, ContactForces
from patchlaw.macro.contact.newton import ContactEquations, Equilibrium, Prediction
from patchlaw.macro.contact.pressed_plane import Lines, law_lines
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, joined_diagonal, springs_at
from patchlaw.macro.linear_solvers.options import conjugate_gradients, shell
from patchlaw.support.arrays import Array, Flags
from patchlaw.support.errors import NotConverged

_OFF = 0.005
"""Change of a pressure, relative to that where most of the force is, from which laws are solved for
on the layer. Smaller changes Newton's method finds itself. With 0.02 two laws on a nearly
incompressible pad took 6 steps in place of 5, in the same CPU time."""
_LAYERS = 2
"""Layers of nodes around those of the samples that are off."""
_MOST_LAYER_STEPS = 10
_CLOSE_ON_LAYER = 0.01
"""Change of pressures that ends the steps, relative to the same."""
_ROUGHLY_ON_LAYER = 0.1
"""Relative tolerance of linear solves on the layer. With 0.01 pads took as many steps."""


class FaceLayer:
    """Linearises laws at points, where pressures change over few elements by a layer of the body.

    Beside a step between two laws, an edge or a border of contact, pressures change over a few
    elements, and the body is stiffer against that than against pressures everywhere. One stiffness
    of the body (`law_lines`) then sends Newton's method from there to the solution in small steps:
    pressures that the last lines made negative, for one, grow by a factor of two to five a step. So
    the laws are solved there before the next solve of the whole body: on the layer of elements
    beneath, with the rest of the body at rest, under the plane in its equilibrium. Only the lines
    are taken from that solution. This is nonlinear elimination (Lanzkron, Rose & Wilkes 1996, doi
    10.1137/S1064827594262576; Cai & Li 2011, doi 10.1137/080736272). Without it two laws that
    border on each other, one 16 times as stiff, took 4 to 11 Newton steps, in place of 4 and 5.

    Args:
        equations: The equations.
        contact: Which of their contacts.

    Note:
        Every method is collective.
    """

    def __init__(self, equations: ContactEquations, contact: int = 0) -> None:
        self._equations, self._contact = equations, contact
        self._forces = equations.contacts[contact]
        self._sampling = self._forces.sampling

    @property
    def stiffness(self) -> float:
        """Stiffness of the elements against pressures that change between them [MPa/mm]."""
        return self._equations.elements(self._contact)

    def lines(self, displaced: Array, closure: Array, pressure: Array, stiffness: float) -> Lines:
        """Linearise the laws where samples reach their curves along the body's stiffness.

        Args:
            displaced: Predicted displacements of this rank's samples into the body, (n,) [mm].
            closure: Predicted closures of this rank's samples, shape (n,) [mm].
            pressure: Predicted pressures [MPa].
            stiffness: That of the whole body [MPa/mm].
        """
        forces, weight = self._forces, self._sampling.weight
        lines = law_lines(forces, closure, pressure, self.stiffness)
        square, total = forces.comm.allreduce(
            np.array([weight @ lines.pressure**2, weight @ lines.pressure])
        )
        scale = square / total if total > 0.0 else np.inf
        off = np.abs(lines.pressure - pressure) > _OFF * scale
        if not forces.comm.allreduce(bool(off.any()), op=MPI.LOR):
            return law_lines(forces, closure, pressure, stiffness)
        layer = _Layer(self._equations, self._contact, self._nodes(off))
        along = np.where(layer.sampled, self.stiffness, stiffness)
        lines = law_lines(forces, closure, pressure, along)
        return self._solved(layer, displaced, pressure, lines, along, _CLOSE_ON_LAYER * scale)

    def _solved(
        self,
        layer: _Layer,
        start: Array,
        pressure: Array,
        lines: Lines,
        along: Array,
        close: float,
    ) -> Lines:
        """Solve the laws on a layer; elsewhere the body resists like springs.

        Where the steps do not end, as no law limits them, the laws stay as they were at first.

        Args:
            layer: The layer.
            start: Predicted displacements of this rank's samples into the body, shape (n,) [mm].
            pressure: Predicted pressures [MPa].
            lines: The laws at first.
            along: Stiffness of the body at the samples, shape (n,) [MPa/mm].
            close: Change of pressures that ends the steps [MPa].
        """
        forces, sampled = self._forces, layer.sampled
        moved, before, first = np.zeros_like(start), pressure, lines
        for _ in range(_MOST_LAYER_STEPS):
            softer = _softened(lines, pressure, np.where(sampled, np.inf, along))
            at = forces.closure_on_lines(start + moved, softer)
            moved = layer.step(softer.at(at) - pressure, softer.stiffness) / self._sampling.weight
            at = forces.closure_on_lines(start + moved, softer)
            now = softer.at(at)
            at = np.where(sampled, at, at - (now - pressure) / along)
            lines = law_lines(forces, at, now, along)
            change = forces.comm.allreduce(float(np.abs(now - before).max(initial=0.0)), op=MPI.MAX)
            if change <= close:
                return lines
            before = now
        return first

    def _nodes(self, off: Flags) -> Flags:
        """Return which of this rank's nodes are near samples that are off, shape (nodes,)."""
        matrix, values = self._equations.matrix, self._sampling.values
        rng = np.random.default_rng(1)
        here, spread = matrix.createVecs()
        values.array[:] = np.where(off, rng.uniform(1.0, 2.0, off.shape), 0.0)
        self._sampling.operator.mult(values, here)
        for _ in range(_LAYERS):
            nodes = here.array_r.reshape(-1, 3).any(axis=1)
            here.array[:] = np.repeat(nodes, 3) * rng.uniform(1.0, 2.0, 3 * len(nodes))
            matrix.mult(here, spread)
            here, spread = spread, here
        return np.asarray(here.array_r.reshape(-1, 3).any(axis=1))


class _Layer:
    """Nodes of a body near its face, all others at rest.

    Args:
        equations: The equations.
        contact: Which of their contacts has the laws.
        nodes: Which of this rank's nodes it has, shape (nodes,).

    Attributes:
        sampled: Which of this rank's samples move with its nodes, shape (n,).

    Note:
        Everything is collective.
    """

    def __init__(self, equations: ContactEquations, contact: int, nodes: Flags) -> None:
        self._forces = equations.contacts[contact]
        points, kept = self._forces.normal_points, equations.kept_springs(contact)
        comm = points.comm
        self._parts, first = list[PETSc.Mat](), 0
        for stiffness in equations.parts:
            last = first + stiffness.getLocalSize()[0] // 3
            own = _dofs(nodes[first:last], stiffness)
            self._parts.append(stiffness.createSubMatrix(own, own))
            first = last
        rows = PETSc.IS().createStride(
            points.getLocalSize()[0], points.getOwnershipRange()[0], step=1, comm=comm
        )
        self._points = points.createSubMatrix(rows, _dofs(nodes, points))
        if kept is not None:  # the matrix holds springs for its laws
            every = self._forces.points
            rows = PETSc.IS().createStride(
                every.getLocalSize()[0], every.getOwnershipRange()[0], step=1, comm=comm
            )
            springs = springs_at(every.createSubMatrix(rows, _dofs(nodes, every)), -kept)
            self._parts[0].axpy(1.0, springs, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        one = len(self._parts) == 1
        self._alone = self._parts[0] if one else joined_diagonal(self._parts)
        self._values, self._moved = self._points.createVecLeft(), self._points.createVecRight()
        self._moved.array[:] = np.random.default_rng(1).uniform(1.0, 2.0, self._moved.local_size)
        self._points.mult(self._moved, self._values)
        self.sampled = self._values.array_r != 0.0
        self._moved.set(0.0)
        self._stiff, self._border = self._alone, np.zeros((0, 0))

    def step(self, change: Array, stiffness: Array) -> Array:
        """Move the nodes to equilibrium with laws that are lines, and return how samples move.

        Args:
            change: Pressures on these lines where the nodes are, less those under which they are at
                rest, shape (n,) [MPa].
            stiffness: Stiffnesses of the lines, shape (n,) [MPa/mm].

        Returns:
            Displacements of this rank's samples into the body, times their weights, shape (n,).
        """
        forces = self._forces
        self._border = forces.border(stiffness)
        springs = springs_at(self._points, stiffness / forces.weight)
        stiffened = Stiffened(self._alone, self._parts, springs)
        self._stiff, blocks = stiffened.product, stiffened.block_diagonal()
        load, move = self._moved.duplicate(), self._moved.duplicate()
        self._values.array[:] = change
        self._points.multTranspose(self._values, load)
        self._alone.mult(self._moved, move)
        load.axpy(-1.0, move)
        operator = shell(self._alone, self)
        solver = conjugate_gradients(operator, blocks, None)
        solver.setTolerances(rtol=_ROUGHLY_ON_LAYER)
        solver.solve(load, move)
        self._moved.axpy(1.0, move)
        for part in (springs, blocks, self._stiff, solver, operator, load, move):
            part.destroy()
        self._points.mult(self._moved, self._values)
        return self._values.array_r.copy()

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product of the derivative with x to y; PETSc calls this."""
        self._stiff.mult(x, y)
        if self._border.shape[1]:
            values, border = self._values, self._border
            self._points.mult(x, values)
            values.array[:] = -border @ self._forces.levers.summed(border.T @ values.array_r)
            self._points.multTransposeAdd(values, y, y)


def _softened(lines: Lines, pressure: Array, stiffness: Array) -> Lines:
    """Return lines in closures of a body at rest, where in truth it resists like springs.

    Args:
        lines: The laws as lines.
        pressure: Pressures under which the springs are at rest, shape (n,) [MPa].
        stiffness: Stiffness of the springs; infinite where there are none, shape (n,) [MPa/mm].
    """
    closure = lines.closure + (lines.pressure - pressure) / stiffness
    return Lines(closure, lines.pressure, lines.stiffness / (1.0 + lines.stiffness / stiffness))


def _dofs(nodes: Flags, matrix: PETSc.Mat) -> PETSc.IS:
    """Return the unknowns of some of this rank's nodes, which are columns of a matrix."""
    numbers = np.flatnonzero(nodes) + matrix.getOwnershipRangeColumn()[0] // 3
    return PETSc.IS().createBlock(3, numbers.astype(PETSc.IntType), comm=matrix.comm)


_ROUNDING = 1e-7
"""Smallest part of a displacement that must be new to the basis; less only adds rounding."""

_STEPS = 10
"""Steps in the basis."""

_CLOSE = 1e-3
"""Last step in the basis, relative to the guess."""

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
        self._sampled: Array = np.empty((0, len(sampling.weight)))  # Wᵀ B of this rank's samples
        self._pressures: Array = np.empty((0, len(sampling.weight)))  # that W follow from
        self._shears: list[Array] = []  # with these shear stresses, (n, 2 or 0) each
        self._along: list[Array] = []  # displacements of samples along the axes, (n, 2) each
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
        work, force = displacement.copy(), displacement.duplicate()
        vector, before, last = work.array, 0.0, np.zeros(len(self))
        for _ in range(2):  # a second pass removes what rounding left
            stiffness.mult(work, force)
            before = before or self._sum(vector @ force.array_r)
            shares = self._sum(np.array([each @ force.array_r for each in self.vectors]))
            for share, each in zip(shares, self.vectors, strict=True):
                vector -= share * each
            pressure, last = pressure - shares @ self._pressures, last + shares
            for share, each in zip(shares, self._shears, strict=True):
                shear = shear - share * each
        stiffness.mult(work, force)
        square = self._sum(vector @ force.array_r)
        is_new = square > _ROUNDING**2 * before
        last = np.append(last, square**0.5) if is_new else last
        self._last = last if solved else np.zeros_like(last)
        if not is_new:
            return
        vector /= square**0.5
        sampled = self._sampling.operator.createVecRight()
        self._sampling.operator.multTranspose(work, sampled)
        first = max(0, len(self) + 1 - self._size)
        self.vectors = [*self.vectors, vector.copy()][first:]
        self._sampled = np.vstack([self._sampled, sampled.array_r])[first:]
        self._along = [*self._along, self._equilibrium.forces.along(work)][first:]
        self._pressures = np.vstack([self._pressures, pressure / square**0.5])[first:]
        self._shears = [*self._shears, shear / square**0.5][first:]
        self._last = self._last[first:]

    @property
    def stiffness(self) -> float:
        """Stiffness of the body under the latest pressures, or any of the basis [MPa/mm]."""
        y = self._last if self._last.any() else np.eye(1, len(self))[0]
        pressure = y @ self._pressures
        square = self._sum((self._sampling.weight * pressure) @ pressure)
        return float(square / self._sum(pressure @ (y @ self._sampled)))

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
        pressure = y @ self._pressures
        sampled = self._sampled / self._sampling.weight
        closure = forces.closure_of(y @ sampled)
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
        return closure, y @ self._pressures, np.einsum("k,kni->ni", y, np.array(self._shears))

    def _step(self, y: Array, lines: Lines) -> Array:
        """Return the step to the solution in the basis with linearised laws."""
        forces, weight, columns = self._equilibrium.forces, self._sampling.weight, self._sampled
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

    @property
    def _stretches(self) -> Array:
        """What samples move by in each vector, times their weights, (k, n, 1 or 3) [mm³]."""
        along = np.array(self._along) * self._sampling.weight[:, None]
        return np.concatenate([self._sampled[:, :, None], along], axis=2)

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)


class Start(NamedTuple):
    """What is predicted of a contact before the first step.

    Attributes:
        closure: Closures of this rank's samples, shape (n,) [mm].
        pressure: Pressures that displacements follow from, shape (n,) [MPa].
        shear: Shear stresses likewise, shape (n, 2 or 0) [MPa].
        stiffness: That of the body under such pressures [MPa/mm].
        rest: Where the stiffness is to be found: pressures and displacements of the samples into
            the body that changes count from, shape (2, n); None: it is known.
    """

    closure: Array
    pressure: Array
    shear: Array
    stiffness: float
    rest: Array | None = None


class Guess(Protocol):
    """Where first steps start."""

    def begin(self, displacement: PETSc.Vec) -> list[Start]:
        """Write the displacements to start from, and return what is predicted of each contact."""
        ...

    @property
    def along_path(self) -> bool:
        """Whether it starts from more than one solution."""
        ...


_SPRING_STEPS, _SAME = 20, 0.01
"""Steps to the plane on springs, and change of pressures that ends them, over the largest."""


def sprung_lines(
    forces: ContactForces, displaced: Array, pressure: Array, closure: Array, stiffness: float
) -> tuple[Lines, Array, Array]:
    """Linearise the laws where samples reach their curves along springs, and the plane moves along.

    A plane that is free gives way to a sample more than the body does.

    Args:
        forces: The laws.
        displaced: Displacements of this rank's samples into the body, where the springs are at
            rest, shape (n,) [mm].
        pressure: Pressures there, shape (n,) [MPa].
        closure: Closures there, shape (n,) [mm].
        stiffness: Stiffness of the springs [MPa/mm].

    Returns:
        The laws as lines, and the closures and pressures that they are taken for, shape (n,) each;
        those under the plane where it is, if it finds no equilibrium.
    """
    lines, now = law_lines(forces, closure, pressure, stiffness), pressure
    usual = lines, closure, pressure
    for _ in range(_SPRING_STEPS):
        softer = _softened(lines, pressure, np.full_like(pressure, stiffness))
        at = forces.closure_on_lines(displaced, softer)
        last, now = now, softer.at(at)
        closure = at - (now - pressure) / stiffness
        lines = law_lines(forces, closure, now, stiffness)
        sizes = [np.abs(one).max(initial=0.0) for one in (now - last, now)]
        change, most = np.max(forces.comm.allgather(sizes), axis=0)
        if change <= _SAME * most:
            return lines, closure, now
    return usual


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
        closure = forces.closure_of(displaced)
        _, closure, now = sprung_lines(forces, displaced, before, closure, stiffness)
        rest = np.array([before, displaced])
        return Start(closure, now, forces.last_shear, stiffness, rest)


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
        guess: Guess,
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
        if residuals[0] <= NEAR or any(control.force == 0.0 for control in controls):
            return np.empty(0), 0
        best, step, spent = displacement.copy(), displacement.duplicate(), 0
        along_path = self._guess.along_path
        rubs = any(forces.sliders for forces in contacts)
        by_force = all(control.force is not None for control in controls)
        tolerance = _ROUGHLY if by_force and (rubs or not along_path) else _TOLERANCE
        own, layered = solver.getTolerances()[0], along_path
        expected: list[Array | None] = [state.shear for state in states]
        while residuals[-1] > NEAR and len(residuals) <= min(_MOST_STEPS, most):
            lines = [
                self._lines(k, displacement, state, layered=layered)
                for k, state in enumerate(states)
            ]
            given = [
                Prediction(each, state.stiffness, shear)
                for each, state, shear in zip(lines, states, expected, strict=True)
            ]
            self._equations.linearise(displacement, given, self._residual)
            self._follow()
            solver.setTolerances(rtol=min(tolerance, self._finest(given)))
            solver.solve(self._residual, step)
            if solver.reason < 0:
                break
            spent += int(solver.its)
            displacement.axpy(-1.0, step)
            layered, expected = True, [None] * len(contacts)
            states = [
                self._after(forces, displacement, each, state)
                for forces, each, state in zip(contacts, lines, states, strict=True)
            ]
            residuals.append(self._relative_residual(displacement))
            if residuals[-1] <= min(residuals):
                displacement.copy(best)
        best.copy(displacement)
        solver.setTolerances(rtol=own)
        return np.array(residuals[:-1]), spent

    def _finest(self, given: Sequence[Prediction]) -> float:
        """Return the tolerance of a linear solve whose error laws do not make one of pressures."""
        shares = [_CLOSE_TO_STEEP]
        for forces, (lines, body, _) in zip(self._contacts, given, strict=True):
            weight = forces.weight * lines.pressure
            steep, total = forces.comm.allreduce(np.array([weight @ lines.stiffness, weight.sum()]))
            shares.append(_CLOSE_TO_STEEP * body * total / steep if steep > 0.0 else np.inf)
        return max(min(shares), _FINEST)

    def _lines(
        self, contact: int, displacement: PETSc.Vec, state: Start, *, layered: bool
    ) -> Lines:
        """Return the laws of a contact as lines."""
        forces, layer = self._contacts[contact], self._layers[contact]
        displaced = forces.sampling.displacements(displacement)
        if layer is None or not layered:
            at = state.pressure, state.closure, state.stiffness
            return sprung_lines(forces, displaced, *at)[0]
        return layer.lines(displaced, state.closure, state.pressure, state.stiffness)

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
        return before._replace(closure=closure, pressure=pressure, stiffness=stiffness)

    def _relative_residual(self, displacement: PETSc.Vec) -> float:
        try:
            self._equations.residual(displacement, self._residual)
        except NotConverged:  # the plane, on closures that are out of all proportion
            return np.inf
        return float(self._residual.norm() / (self._equations.scale or 1.0))
