"""Small vibrations of bodies under laws on their contact face.

Theory: section 17 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import ufl
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from patchlaw.geometry import Material
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import face_springs
from patchlaw.macro.contact.loaded_face import ContactFace, Mode
from patchlaw.macro.eigenmodes import NEARLY, NaturalModes, modes_of
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.linear_solvers.many_vectors import Corrections, corrections, products
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, distributed, joined_diagonal
from patchlaw.support import Array

FACTORISED = 20_000
"""Unknowns up to which the stiffness is factorised; beyond, the bodies' multigrid takes less time
and memory (``benchmarks/vibration_size.py``)."""


_FIRST, _LAST = np.array([1.0, 0.6, 0.3]), 0.1
"""Weights of the motions along x, y and z, and of the contact's share, by which modes of one
frequency are told apart."""


class FaceVibration:
    """Natural modes of bodies, and of the mass of a plane that moves along the normal.

    Args:
        face: The contact face of the bodies, whose materials have densities.
        mode: Where laws are evaluated.
        plane: Mass of the plane [t]; None: it is held.
        factorised: Unknowns up to which the stiffness is factorised.

    Attributes:
        mode: Where laws are evaluated.

    Note:
        Everything is collective.
    """

    def __init__(
        self,
        face: ContactFace,
        mode: Mode,
        plane: float | None = None,
        factorised: int = FACTORISED,
    ) -> None:
        self._face, self.mode = face, mode
        self._plane, self._factorised = plane, factorised
        self._bodies: list[ElasticBody] = [one.body for one in face.sides]
        self._latest: Array | None = None  # modes at the load before, where the next ones start

    @cached_property
    def mass(self) -> PETSc.Mat:
        """Mass matrix of the bodies, and of the plane where it moves [t]."""
        parts = [mass_matrix(body) for body in self._bodies]
        return self._with_plane(joined_diagonal(parts), self._plane)

    @cached_property
    def _stiffness(self) -> PETSc.Mat:
        return self._with_plane(joined_diagonal([body.stiffness for body in self._bodies]), 0.0)

    @cached_property
    def _free(self) -> PETSc.Vec:
        free = self.mass.createVecRight()
        own = [~body.supported[: body.owned_dofs] for body in self._bodies]
        plane = [True] * (free.local_size - sum(map(len, own)))
        free.array[:] = np.concatenate([*own, plane])
        return free

    @cached_property
    def _rigid(self) -> tuple[Array, Array]:
        """Unit motions of the bodies along x, y and z, shape (m, 3), and the masses they move."""
        moved = np.tile(np.eye(3), (self.mass.getLocalSize()[0] // 3 + 1, 1))
        moved = moved[: self.mass.getLocalSize()[0]]
        moved[sum(body.owned_dofs for body in self._bodies) :] = 0.0  # the plane
        return moved, self._face.comm.allreduce((moved * products(self.mass, moved)).sum(axis=0))

    @property
    def unknowns(self) -> int:
        """Number of unknowns that are free, of all ranks, and so of modes; collective."""
        return round(self._free.sum())

    def _with_plane(self, bodies: PETSc.Mat, value: float | None) -> PETSc.Mat:
        if self._plane is None:
            return bodies
        here = int(bodies.comm.rank == 0)
        entry = distributed(csr_matrix(np.full((here, 1), value)), here, bodies.comm)
        return joined_diagonal([bodies, entry])

    def modes(self, tangents: Array, count: int) -> tuple[NaturalModes, Array, Array]:
        """Return the lowest modes, and what they do.

        Modes of nearly one frequency are turned to axes of their own, so that they are the same
        from any start: the first one moves most along x, the next ones along y and z, and the rest
        differ most in the share of the contact.

        Args:
            tangents: Stiffnesses at the samples, see `ContactForces.vibration_tangents`.
            count: Number of modes.

        Returns:
            The modes; the share of the contact in their squared frequencies, shape (n,); the mass
            that moves along x, y and z in them, over that of the bodies, shape (n, 3).

        Raises:
            NotConverged: When the iteration fails.
        """
        even, moves = tangents.copy(), self._plane is not None
        even[:, 1:, 0] = 0.0  # what follows the pressures of a face that slides
        springs = face_springs(self._face, self.mode, even, moves)
        matrix = self._stiffness.copy()
        whole = face_springs(self._face, self.mode, tangents, moves)
        matrix.axpy(1.0, whole, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        correct = None
        if matrix.getSize()[0] > self._factorised:
            correct = self._multigrid(even, matrix.getDiagonal())
        found = modes_of(matrix, self.mass, self._free, count, correct, self._latest)
        add, (rigid, masses) = self._face.comm.allreduce, self._rigid
        parts = found.shapes.real, found.shapes.imag
        forces = products(springs, parts[0]) + 1j * products(springs, parts[1])
        rates = np.where(found.eigenvalues, abs(found.eigenvalues), np.inf)
        work = add(found.shapes.conj().T @ forces) / np.outer(rates, rates)
        along = add(found.momenta.T @ rigid) / np.sqrt(masses)
        form = (along.conj() * _FIRST) @ along.T + _LAST * work
        turn = _axes(found.eigenvalues, add(found.shapes.conj().T @ found.momenta), form)
        found = replace(found, shapes=found.shapes @ turn, momenta=found.momenta @ turn)
        turning = add(abs(parts[1]).sum(axis=0)) > 0.0
        self._latest = np.hstack([parts[0], parts[1][:, turning]])
        shares = np.einsum("ik,ij,jk->k", turn.conj(), work, turn).real
        return found, shares, abs(turn.T @ along) ** 2

    def _multigrid(self, even: Array, diagonal: PETSc.Vec) -> Corrections:
        """Return the bodies' multigrid, which knows laws at points as load steps' does.

        Of the plane it is as of the stiffest node: on soft springs motions of the bodies would move
        it far too much by a stiffness of its own.
        """
        body, stiffened = self._face.body, None
        if self.mode == "pointwise" and body.lattice is None:
            springs = face_springs(self._face, self.mode, even)
            stiffened = Stiffened(body.stiffness, body.stiffnesses, springs)
        solver = body.solver if stiffened is None else body.solver_of(stiffened)
        cycles, stiffest = corrections(solver), diagonal.array_r.max(initial=0.0)
        bodies = solver.getOperators()[0].getLocalSize()[0]

        def result(columns: Array) -> Array:
            _ = stiffened  # which PETSc does not keep
            return np.vstack([cycles(columns[:bodies]), columns[bodies:] / stiffest])

        return result

    def by_body(self, shapes: Array) -> list[tuple[ElasticBody, Array]]:
        """Return every body with its rows of shapes (m, n)."""
        ends = np.cumsum([body.owned_dofs for body in self._bodies])
        return list(zip(self._bodies, np.split(shapes[: ends[-1]], ends[:-1]), strict=True))


def _axes(eigenvalues: Array, gram: Array, form: Array) -> Array:
    """Return axes of a Hermitian form of modes among those of nearly one eigenvalue, (n, n).

    Args:
        eigenvalues: Those of the modes by rising frequency, shape (n,).
        gram: Products of the modes by their mass, shape (n, n).
        form: The form, shape (n, n).
    """
    turn = np.zeros_like(form, dtype=complex)
    apart = abs(np.diff(eigenvalues)) > 0.5 * NEARLY * abs(eigenvalues[1:])
    label = np.append(0, np.cumsum(apart))
    for one in range(label[-1] + 1):
        group = np.ix_(label == one, label == one)
        scale = np.linalg.inv(np.linalg.cholesky(np.real_if_close(gram[group]))).conj().T
        along = np.real_if_close(scale.conj().T @ form[group] @ scale)
        turn[group] = scale @ np.linalg.eigh(-along)[1]
    return turn


def mass_matrix(body: ElasticBody) -> PETSc.Mat:
    """Return the consistent mass matrix ∫ ρ u·v dV of a body whose materials have densities [t].

    Args:
        body: The body.
    """
    mesh, space = body.mesh.mesh, body.space
    cells = mesh.topology.index_map(3)
    density = np.zeros(cells.size_local + cells.num_ghosts)
    if isinstance(body.materials, Material):
        density[:] = body.materials.density
    else:
        for tag, material in body.materials.items():
            density[body.mesh.cell_tags.find(tag)] = material.density
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 * body.degree})
    form = compat.cell_constant(mesh, density) * ufl.inner(trial, test) * dx
    whole = compat.assemble_matrix(compat.compile_form(form), [])
    starts, columns, entries = whole.getValuesCSR()
    rows = csr_matrix((entries, columns, starts), shape=(whole.getLocalSize()[0], whole.size[1]))
    rows.eliminate_zeros()  # between components: two of three
    whole.destroy()
    return distributed(rows, rows.shape[0], body.comm)
