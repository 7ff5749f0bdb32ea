"""Two elastic bodies that are pressed on each other: one set of unknowns, and one contact face.

Meshes need not match. Laws at points are evaluated at the quadrature points of the first body's
face; the basis functions of the counter-body are evaluated where these points lie on its face.
What lies on one face alone carries no pressure.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from patchlaw.macro import compat
from patchlaw.macro.contact.face_laws import Sampling
from patchlaw.macro.contact.loaded_face import ContactFace, LoadedFace, directed_rows
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, distributed, joined
from patchlaw.macro.linear_solvers.options import (
    KRYLOV_DEFAULTS,
    PREFIX,
    WeakContext,
    default_options,
    set_own_preconditioner,
)
from patchlaw.macro.linear_solvers.selection import body_solver
from patchlaw.macro.linear_solvers.solvers import LinearSolver
from patchlaw.macro.mesh.contact_face import ContactFacets, FacetQuadrature, Opposite
from patchlaw.macro.mesh.facet_parts import straight_parts
from patchlaw.macro.mesh.tagged import FLAT_IN_FILES
from patchlaw.support import Array, Counts, Flags, Indices, InputError


@dataclass(frozen=True, eq=False)
class BodyPair:
    """A body and the counter-body that is pressed on it.

    On every rank the unknowns are those of the body, then those of the counter-body. The stiffness
    is block diagonal, and so is the preconditioner until laws between them are known.

    Args:
        body: The body.
        counter: The counter-body, on the same communicator. The approach is that of its supports.

    Note:
        Everything is collective.
    """

    body: ElasticBody
    counter: ElasticBody

    @property
    def comm(self) -> Any:
        """Communicator of both meshes."""
        return self.body.comm

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom of both, all ranks together."""
        return self.body.dofs + self.counter.dofs

    @property
    def owned_dofs(self) -> int:
        """Number of degrees of freedom of both that this rank owns."""
        return self.body.owned_dofs + self.counter.owned_dofs

    def split(self, values: Array) -> tuple[Array, Array]:
        """Return the parts of both bodies in this rank's owned values.

        Args:
            values: Values of the body, then of the counter-body, shape (owned_dofs,).
        """
        return values[: self.body.owned_dofs], values[self.body.owned_dofs :]

    @cached_property
    def stiffness(self) -> PETSc.Mat:
        """Block diagonal stiffness [N/mm], a PETSc matrix without entries."""
        sizes = (self.owned_dofs, None)
        matrix = PETSc.Mat().createPython((sizes, sizes), WeakContext(self._product), self.comm)
        matrix.setUp()
        return matrix

    @property
    def stiffnesses(self) -> list[PETSc.Mat]:
        """The stiffness of each, the diagonal blocks."""
        return [self.body.stiffness, self.counter.stiffness]

    @property
    def lattice(self) -> None:
        """No lattice goes through both."""
        return None

    @cached_property
    def solver(self) -> LinearSolver:
        """Linear solver of both; its preconditioner also serves the contact solves."""
        solver = LinearSolver().create(self.comm)
        solver.setOptionsPrefix(PREFIX)
        solver.setOperators(self.stiffness)
        set_own_preconditioner(solver, self._preconditioner)
        with default_options(PREFIX, KRYLOV_DEFAULTS):
            solver.setFromOptions()
        solver.setUp()
        return solver

    def release_solver(self) -> None:
        """Drop the solvers of both; see `ElasticBody.release_solver`."""
        for name in ("solver", "_preconditioner"):
            self.__dict__.pop(name, None)
        self.body.release_solver()
        self.counter.release_solver()

    def solver_of(self, stiffened: Stiffened) -> PETSc.KSP:
        """Return a linear solver whose preconditioner knows what joins the bodies.

        Args:
            stiffened: The stiffness with springs; keep it as long as the solver.
        """
        return body_solver((self.body, self.counter), self.stiffness, stiffened)

    def preload(self, state: float = 0.0) -> Array | None:
        """Return the displacements without contact; see `ElasticBody.preload`."""
        parts = [each.preload(state) for each in (self.body, self.counter)]
        if all(part is None for part in parts):
            return None
        both = np.zeros(self.owned_dofs)
        for part, own in zip(parts, self.split(both), strict=True):
            own[:] = 0.0 if part is None else part
        return both

    @cached_property
    def _product(self) -> _Halves:
        return _Halves(self, self.body.stiffness.mult, self.counter.stiffness.mult)

    @cached_property
    def _preconditioner(self) -> _Halves:
        return _Halves(self, self.body.solver.pc.apply, self.counter.solver.pc.apply)


class _Halves:
    """Applies an operator of each body to its part of a vector; PETSc calls `mult` or `apply`.

    Args:
        pair: The bodies.
        first: Writes y for x of the body.
        second: Writes y for x of the counter-body.
    """

    def __init__(self, pair: BodyPair, first: Any, second: Any) -> None:
        self._count, self._operators = pair.body.owned_dofs, (first, second)
        self._vectors = [each.stiffness.createVecs() for each in (pair.body, pair.counter)]

    def apply(self, _owner: Any, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x."""
        parts = slice(None, self._count), slice(self._count, None)
        for operate, part, (given, result) in zip(
            self._operators, parts, self._vectors, strict=True
        ):
            given.array[:] = x.array_r[part]
            operate(given, result)
            y.array[part] = result.array_r

    mult = multTranspose = apply


class FacePair(ContactFace):
    """Patches on the contact faces of a body and its counter-body.

    Args:
        first: The face of the body with its patches.
        second: The face of the counter-body with the same patches, its facets in the frame of the
            first (``opposed``), on the same communicator.

    Note:
        Everything here is collective.
    """

    def __init__(self, first: LoadedFace, second: LoadedFace) -> None:
        self.first, self.second = _opposite(first, second), second
        self._whole = first, second
        self.body = BodyPair(first.body, second.body)
        self.comm, self.patches = first.comm, first.patches

    @property
    def sides(self) -> tuple[LoadedFace, ...]:
        """The faces of both bodies."""
        return self.first, self.second

    @cached_property
    def areas(self) -> Array:
        """Areas of the patches on the first face, shape (N,) [mm²]."""
        return self._whole[0].areas

    def check_common(self) -> None:
        """Refuse faces of which no part lies on the other.

        Raises:
            InputError: When no quadrature point of the first face lies on the second one.
        """
        if not self.comm.allreduce(int(self.on_both.sum())):
            raise InputError(
                "the contact faces of the two bodies have no part in common",
                allowed="faces that lie opposite to each other, in the coordinates of both meshes",
            )

    @cached_property
    def patchwise(self) -> Sampling:
        """Laws at the mean closures of the patches."""
        one, other = self._whole
        own = one.areas
        others = np.stack([other.areas, self.areas])
        if np.any(np.abs(own - others) > FLAT_IN_FILES * own):
            raise InputError(
                "the two faces do not cover the patches alike",
                value=float(np.abs(others / own - 1.0).max()),
                allowed="patches that lie on both faces, or laws at points",
            )
        known, its = one.patchwise, other.patchwise
        operator = self._stacked([known.operator, its.operator])
        return replace(known, operator=operator, depth=known.depth + its.depth)

    @cached_property
    def pointwise(self) -> Sampling:
        """Laws at the quadrature points of the first face that lie on the second."""
        one = self.first.pointwise
        depth, kept = self._counter_points.depth, self.on_both
        names = ("weight", "x", "y", "depth", "patch")
        own = replace(one, **{name: getattr(one, name)[kept] for name in names})
        operator = PETSc.Mat().createTranspose(self.points_by_dofs)
        return replace(own, operator=operator, depth=own.depth + depth[kept])

    def _of_patches(self, *, held: bool) -> PETSc.Mat:
        return self._stacked([face._of_patches(held=held) for face in self._whole])

    def _rows(self, count: int, *, held: bool = False) -> PETSc.Mat:
        """Return the rows of common points for the displacements of both, as of one face."""
        first, second = self.sides
        kept, found = self.on_both, self._counter_points
        own = first.points_by_dofs if count == 1 else first._rows(count, held=held)
        rows = directed_rows(
            found.values[kept],
            found.columns[kept],
            (found.values[kept] != 0.0)[..., None] & (found.supported[kept] == held),
            second.facets.directions[:count],
            second.displacements.total,
        )
        return self._beside(_local_rows(own)[np.repeat(kept, count)], rows)

    def _beside(self, first: csr_matrix, second: csr_matrix) -> PETSc.Mat:
        """Return rows for the displacements of both from those for each."""
        parts = [
            distributed(part, face.body.owned_dofs, self.comm)
            for part, face in ((first, self.first), (second, self.second))
        ]
        return joined([parts])

    def _stacked(self, parts: Sequence[PETSc.Mat]) -> PETSc.Mat:
        """Return an operator that loads both from those that load each."""
        return joined([[part] for part in parts])

    @property
    def on_both(self) -> Flags:
        """Which of this rank's quadrature points of the first face lie on the second one, too."""
        return self._counter_points.on_both

    def pull_moments(self, state: float) -> tuple[float, float]:
        """Return the moments of what pulls the first body; see `LoadedFace.pull_moments`."""
        return self.first.pull_moments(state)

    @cached_property
    def _counter_points(self) -> _CounterPoints:
        """Where this rank's points of the first face lie on the second."""
        points, space = self.first.quadrature, self.second.space
        own, cells = self.second.facets, compat.cell_nodes(space)[self.second.facets.cell]
        columns = np.concatenate(self.comm.allgather(self.second.displacements.columns(cells)))
        supported = np.concatenate(self.comm.allgather(self.second.supported(cells)))
        first, *others = self.comm.allgather(own)
        whole = first.joined(others)
        if not len(columns):
            raise InputError("the counter-body has no contact face")
        facet, local = _located(whole, np.column_stack([points.x, points.y]))
        on_both = facet >= 0
        facet, local = np.where(on_both, facet, 0), np.where(on_both[:, None], local, 0.0)
        values = compat.lagrange_values(
            space.mesh.topology.cell_name(),
            compat.lagrange_degree(space),
            whole.pull_back(facet, local),
        )
        depth = whole.depths(facet, local)
        weighted = points.weight[:, None] * values
        return _CounterPoints(weighted, columns[facet], supported[facet], depth, on_both)


def _opposite(first: LoadedFace, second: LoadedFace) -> LoadedFace:
    """Return the first face with quadrature on what it has in common with facets of the second."""
    nodes = np.concatenate(first.comm.allgather(second.facets.corners))  # all are divided alike
    opposite = Opposite(straight_parts(nodes), -(-second.quadrature_degree // 2))
    return replace(first, counter=opposite)


class FacesOfOneMesh(FacePair):
    """Patches on two faces of one mesh that are pressed together, as those of two volumes of it.

    Args:
        first: The first face with its patches, in a space of displacements.
        second: The other one in the same space, its facets in the frame of the first.
    """

    def __init__(self, first: LoadedFace, second: LoadedFace) -> None:
        self.first, self.second, self.body = _opposite(first, second), second, first.body
        self._whole = first, second
        self.comm, self.patches = first.comm, first.patches
        self.facets, self.quadrature_degree = first.facets, first.quadrature_degree

    @cached_property
    def areas(self) -> Array:
        """Areas of the patches that lie on both faces, 0 of those that do not, (N,) [mm²]."""
        points, count = self.quadrature, self.patches.count
        own = np.bincount(points.patch, points.weight, count)
        return np.asarray(self.comm.allreduce(own))

    @cached_property
    def quadrature(self) -> FacetQuadrature:
        """Quadrature points of this rank on the first face that lie on the second."""
        points, kept = self.first.quadrature, self.on_both
        return replace(
            points, **{one.name: getattr(points, one.name)[kept] for one in fields(points)}
        )

    def _beside(self, first: csr_matrix, second: csr_matrix) -> PETSc.Mat:
        return distributed(first + second, self.first.displacements.owned, self.comm)

    def _stacked(self, parts: Sequence[PETSc.Mat]) -> PETSc.Mat:
        one, other = (part.convert("aij", PETSc.Mat()) for part in parts)
        one.axpy(1.0, other, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        return one


class _CounterPoints(NamedTuple):
    """This rank's n points of the first face on the second one.

    Attributes:
        values: w φ of the m nodes of the cell there, shape (n, m) [mm²].
        columns: Unknowns of their displacements, shape (n, m, 3).
        supported: Which of their displacements supports hold, shape (n, m, 3).
        depth: Depths of the second face, shape (n,) [mm].
        on_both: Which points lie on it.
    """

    values: Array
    columns: Counts
    supported: Flags
    depth: Array
    on_both: Flags


def _located(facets: ContactFacets, points: Array) -> tuple[Indices, Array]:
    """Return the facet that each point lies on, −1 for none, and its coordinates there.

    Args:
        facets: Facets in the plane.
        points: Points in the plane, shape (n, 2) [mm].
    """
    count, corners = len(facets.vertices), facets.vertices
    facet, local = np.full(len(points), -1), np.zeros_like(points)
    if not count or not len(points):
        return facet, local

    def look(wanted: Indices, candidates: Indices) -> None:
        """Note which points, by their indices, lie on the facet that is tried for each."""
        at = facets.local(candidates, points[wanted])
        beyond = at.sum(axis=1) if corners.shape[1] == 3 else at.max(axis=1, initial=0.0)
        inside = (at.min(axis=1, initial=0.0) >= -1e-8) & (beyond <= 1.0 + 1e-8)
        facet[wanted[inside]], local[wanted[inside]] = candidates[inside], at[inside]

    middles = corners.mean(axis=1)
    tree = cKDTree(middles)
    reach = float(np.linalg.norm(corners - middles[:, None], axis=2).max())
    nearest = min(12, count)
    for candidates in tree.query(points, k=nearest)[1].reshape(len(points), nearest).T:
        left = np.flatnonzero(facet < 0)
        look(left, candidates[left])
    for point in np.flatnonzero(facet < 0):  # near large facets, or beside the face
        for candidate in tree.query_ball_point(points[point], reach):
            if facet[point] < 0:
                look(np.array([point]), np.array([candidate]))
    return facet, local


def _local_rows(matrix: PETSc.Mat) -> csr_matrix:
    """Return this rank's rows of a distributed matrix, columns numbered through all ranks."""
    starts, columns, entries = matrix.getValuesCSR()
    shape = (len(starts) - 1, matrix.getSize()[1])
    return csr_matrix((entries, columns, starts), shape=shape)
