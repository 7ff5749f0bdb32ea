"""Solves laws at points on a thin layer of elements under the contact face, the rest at rest.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.macro.contact.contact_forces import ContactForces
from patchlaw.macro.contact.newton import ContactEquations
from patchlaw.macro.contact.pressed_plane import Lines, law_lines
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, joined_diagonal, springs_at
from patchlaw.macro.linear_solvers.options import conjugate_gradients, shell
from patchlaw.support import Array, Flags

_OFF = 0.005
"""What a predicted pressure differs by from the law at the predicted closure, relative to the
pressure where most of the force is, from which laws are solved for on the layer. Smaller
differences Newton's method finds itself. They are not judged along the stiffness of the elements: a
point of a facet on a soft law, whose neighbours are held by stiff ones, resists a hundred times
more. Its pressure then grew by a factor of two to five a step, and two laws on quadratic elements
took 11 steps in place of 4."""
_LAYERS = 2
"""Layers of nodes around those of the samples that are off."""
_MOST_LAYER_STEPS = 10
_CLOSE_ON_LAYER = 0.01
"""Change of pressures that ends the steps, relative to the same."""
_MOST_SPRING_STEPS, _SAME = 20, 0.01
"""Steps to the plane on springs, and change of pressures that ends them, over the largest."""
_FELL = 0.1
"""Share of the largest change that the last one is at most where the steps lead somewhere."""
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
        lines = law_lines(forces, closure, pressure, stiffness)
        square, total = forces.comm.allreduce(
            np.array([weight @ lines.pressure**2, weight @ lines.pressure])
        )
        scale = square / total if total > 0.0 else np.inf
        off = np.abs(forces.pressure(closure) - pressure) > _OFF * scale
        if not forces.comm.allreduce(bool(off.any()), op=MPI.LOR):
            return lines
        layer = _Layer(self._equations, self._contact, self._nodes(off))
        along = np.where(layer.sampled, self.stiffness, stiffness)
        lines = law_lines(forces, closure, pressure, along)
        close = _CLOSE_ON_LAYER * scale
        return solved_lines(forces, displaced, pressure, lines, along, layer=layer, close=close)

    def _nodes(self, off: Flags) -> Flags:
        """Return which of this rank's nodes are near samples that are off, shape (nodes,).

        In mixed spaces these are the unknowns that are displacements: others are at rest.
        """
        matrix, values = self._equations.matrix, self._sampling.values
        size, own = self._forces.components, self._forces.own
        rng = np.random.default_rng(1)
        here, spread = matrix.createVecs()
        values.array[:] = np.where(off, rng.uniform(1.0, 2.0, off.shape), 0.0)
        self._sampling.operator.mult(values, here)
        for _ in range(_LAYERS):
            nodes = here.array_r.reshape(-1, size).any(axis=1)
            here.array[:] = np.repeat(nodes, size) * rng.uniform(1.0, 2.0, size * len(nodes))
            matrix.mult(here, spread)
            here, spread = spread, here
        nodes = np.asarray(here.array_r.reshape(-1, size).any(axis=1))
        return nodes if own is None else nodes & np.isin(np.arange(len(nodes)), own)


def solved_lines(
    forces: ContactForces,
    displaced: Array,
    pressure: Array,
    lines: Lines,
    along: Array | float,
    *,
    layer: _Layer | None = None,
    close: float | None = None,
) -> Lines:
    """Linearise the laws where samples reach their curves, and a free plane moves along.

    The body resists like springs but on a layer, whose elements are solved. A plane that is free
    gives way to a sample more than the body does. Where the steps lead nowhere, the laws stay as
    they were at first.

    Args:
        forces: The laws.
        displaced: Predicted displacements of this rank's samples into the body, where springs and
            layer are at rest, shape (n,) [mm].
        pressure: Pressures there, shape (n,) [MPa].
        lines: The laws at first, under the plane where it is.
        along: Stiffness of the body at the samples, of shape (n,) or one for all [MPa/mm].
        layer: The layer, if any.
        close: Change of pressures that ends the steps [MPa]; otherwise a share of the largest.
    """
    sampled = np.zeros(len(pressure), bool) if layer is None else layer.sampled
    at_rest, before, first, largest = displaced, pressure, lines, 0.0
    for _ in range(_MOST_SPRING_STEPS if layer is None else _MOST_LAYER_STEPS):
        softer = softened(lines, pressure, np.where(sampled, np.inf, along))
        at = forces.closure_on_lines(displaced, softer)
        if layer is not None:
            moved = layer.step(softer.at(at) - pressure, softer.stiffness)
            displaced = at_rest + moved / forces.weight
            at = forces.closure_on_lines(displaced, softer)
        now = softer.at(at)
        at = np.where(sampled, at, at - (now - pressure) / along)
        lines = law_lines(forces, at, now, along)
        sizes = [np.abs(one).max(initial=0.0) for one in (now - before, now)]
        change, most = np.max(forces.comm.allgather(sizes), axis=0)
        if change <= (_SAME * most if close is None else close):
            return lines
        largest, before = max(largest, change), now
    return lines if change < _FELL * largest else first


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
        points, kept = self._forces.points, equations.kept_springs(contact)
        comm, size = points.comm, self._forces.components
        self._parts, first = list[PETSc.Mat](), 0
        for stiffness in equations.parts:
            last = first + stiffness.getLocalSize()[0] // size
            own = _dofs(nodes[first:last], stiffness, size)
            self._parts.append(stiffness.createSubMatrix(own, own))
            first = last

        def rows(step: int) -> PETSc.Mat:
            """Return the first of every so many rows, for the unknowns of the nodes."""
            first, last = points.getOwnershipRange()
            chosen = PETSc.IS().createStride((last - first) // step, first, step, comm=comm)
            return points.createSubMatrix(chosen, _dofs(nodes, points, size))

        self._points = rows(self._forces.directions)  # of pressures alone
        if kept is not None:  # the matrix holds springs for its laws
            springs = springs_at(rows(1), -kept)
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
        self._stiff, blocks = stiffened.product, stiffened.block_diagonal(forces.components)
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


def softened(lines: Lines, pressure: Array, stiffness: Array) -> Lines:
    """Return lines in closures of a body at rest, where in truth it resists like springs.

    Args:
        lines: The laws as lines.
        pressure: Pressures under which the springs are at rest, shape (n,) [MPa].
        stiffness: Stiffness of the springs; infinite where there are none, shape (n,) [MPa/mm].
    """
    closure = lines.closure + (lines.pressure - pressure) / stiffness
    return Lines(closure, lines.pressure, lines.stiffness / (1.0 + lines.stiffness / stiffness))


def _dofs(nodes: Flags, matrix: PETSc.Mat, size: int) -> PETSc.IS:
    """Return the unknowns of some of this rank's nodes, which are columns of a matrix."""
    numbers = np.flatnonzero(nodes) + matrix.getOwnershipRangeColumn()[0] // size
    return PETSc.IS().createBlock(size, numbers.astype(PETSc.IntType), comm=matrix.comm)
