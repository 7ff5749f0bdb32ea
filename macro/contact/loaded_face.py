"""Patches on the contact face of a body, and the samples of it that laws are evaluated at.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, identity, kron

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.meshes.block import require_inside
from patchlaw.macro import compat
from patchlaw.macro.bodies import Block
from patchlaw.macro.contact.face_laws import Sampling
from patchlaw.macro.linear_solvers.node_matrices import Displacements, distributed
from patchlaw.macro.linear_solvers.solvers import solve_linear
from patchlaw.macro.mesh.contact_face import (
    ContactFacets,
    FacetQuadrature,
    Opposite,
    facet_quadrature,
    top_facets,
)
from patchlaw.support import Array, Counts, Flags, Indices, InputError, Locals

Mode = Literal["patchwise", "pointwise"]


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """What stands for patches on a face that is covered as a whole, in regions.

    Attributes:
        region: Region of every facet of this rank, shape (facets,). Its facets may lie anywhere in
            the plane.
        count: Number of regions.
        lengths: Sides of the bounding rectangle [mm].
        origin: Its lower corner [mm].
    """

    region: Indices
    count: int
    lengths: tuple[float, float]
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def middle(self) -> Array:
        """Middle of the bounding rectangle, which the plane turns about, shape (2,) [mm]."""
        return np.asarray(self.origin) + 0.5 * np.asarray(self.lengths)


class ContactFace:
    """The contact face of a body, or of two bodies that are pressed together.

    Attributes:
        body: The body, or both.
        patches: Patches on the face, in its frame; or the outline of a face in regions.
        comm: MPI communicator.
        areas: Areas of the patches, shape (N,) [mm²].
        patchwise: Laws at the mean closures of the patches, which are distributed over the ranks.
        pointwise: Laws at quadrature points.
        pull_moments: Moments of what pulls the body, by the state of its loads.

    Note:
        Everything is collective.
    """

    body: Any
    patches: PatchGrid | Outline
    comm: Any
    areas: Any
    patchwise: Any
    pointwise: Any
    pull_moments: Any
    on_both: Any = None
    """Which of this rank's quadrature points on the first of two faces lie on the other one, too,
    shape (n,); None of one face."""
    _rows: Any
    """Returns w φ of displacements along the first of the directions at points, of those that
    supports hold or of all others, shape (k points, dofs) [mm²]."""
    _of_patches: Any
    """Returns what `in_all_directions` does, of patches, of the same displacements."""

    @cached_property
    def points_by_dofs(self) -> PETSc.Mat:
        """−w φ n of the displacements at every point, shape (points, dofs) [mm²]."""
        return self._rows(1)

    @cached_property
    def points_in_all_directions(self) -> PETSc.Mat:
        """Displacements times w φ along −n, e1, e2 at every point, (3 points, dofs) [mm²]."""
        return self._rows(3)

    def in_all_directions(self, mode: Mode) -> PETSc.Mat:
        """Return the operator of stresses (p, τx, τy) at the samples of a mode, (dofs, 3 n) [mm²].

        It writes the nodal load by pressures and by shear stresses along the axes of the face;
        three columns for every sample, the first of which is that of `Sampling.operator`.
        """
        if mode == "pointwise":
            return PETSc.Mat().createTranspose(self.points_in_all_directions)
        return self._of_patches(held=False)

    def on_supports(self, mode: Mode) -> PETSc.Mat:
        """Return the operator of what stresses press on supports; see `in_all_directions`.

        It is that of the displacements that supports hold: nodes that the face shares with them.
        """
        if mode == "pointwise":
            return PETSc.Mat().createTranspose(self._rows(3, held=True))
        return self._of_patches(held=True)

    @property
    def sides(self) -> tuple[Any, ...]:
        """The `LoadedFace` of the body, or of both, that of the counter-body last."""
        return (self,)

    def on_first(self, values: Array) -> Array:
        """Return values at all quadrature points of the first face; 0 where no other face lies.

        Args:
            values: Values at the points that laws hold at, shape (n, …).
        """
        if self.on_both is None:
            return values
        whole = np.zeros((len(self.on_both), *values.shape[1:]))
        whole[self.on_both] = values
        return whole

    def facet_means(self, values: Array) -> tuple[Array, Array]:
        """Return the vertices around the facets of the first face, and means over them.

        Args:
            values: Values at its quadrature points of this rank, shape (n, k).

        Returns:
            Those of all ranks, shapes (m, 3 or 4, 2) [mm] and (m, k).
        """
        first = self.sides[0]
        facets, points = first.facets, first.quadrature
        facet, count = facets.at_cells(points.cell), len(facets.cell)
        areas = np.bincount(facet, points.weight, count)
        sums = [np.bincount(facet, points.weight * one, count) for one in values.T]
        means = np.transpose(sums) / np.where(areas > 0.0, areas, 1.0)[:, None]
        around = [0, 1, 3, 2] if facets.vertices.shape[1] == 4 else [0, 1, 2]
        found = self.comm.allgather((facets.vertices[:, around], means))
        corners, every = zip(*found, strict=True)
        return np.concatenate(corners), np.concatenate(every)

    def load(self, stresses: Array) -> PETSc.Vec:
        """Return the nodal load of stresses that are uniform on every patch.

        What they press on supports is no part of it.

        Args:
            stresses: Pressures of all patches, on every rank, shape (N,); or with the shear
                stresses along both axes of the face, shape (3, N) [MPa].
        """
        rows = np.atleast_2d(np.asarray(stresses, dtype=np.float64))
        operator = self.patchwise.operator
        if len(rows) > 1:
            operator = self.in_all_directions("patchwise")
        values, load = operator.createVecRight(), operator.createVecLeft()
        values.array[:] = rows[:, self.patchwise.patch].T.ravel()
        operator.mult(values, load)
        return load

    def sampling(self, mode: Mode) -> Sampling:
        """Return the samples of a mode: ``"patchwise"`` or ``"pointwise"``.

        Raises:
            InputError: When there is no such mode, or two faces do not cover the patches alike.
        """
        if mode not in get_args(Mode):
            raise InputError("unknown interface", value=mode, allowed=", ".join(get_args(Mode)))
        return self.patchwise if mode == "patchwise" else self.pointwise

    def patch_displacements(self, displacement: PETSc.Vec) -> Array:
        """Return the mean displacements of the patches into the body, on every rank, (N,) [mm].

        Of two bodies they are the sums of both.
        """
        sampling = self.patchwise
        return sampling.patch_sums(sampling.displacements(displacement)) / self.areas


@dataclass(frozen=True, eq=False)
class LoadedFace(ContactFace):
    """Patches on the contact face of a body; the rest of the face is free of traction.

    Args:
        body: The body, or a user's own `Displacements` or their space. Displacements that supports
            of a body hold do not move the samples, and are not loaded.
        facets: Facets of the face, in its frame.
        patches: Patches on the face, in its frame. Parts of a patch beyond the face do not count.
            Or the regions of the whole face, which have a law each at their points.
        degree: Polynomial degree that the quadrature is exact for; None: that of products of two
            basis functions.
        counter: Facets that lie opposite, see `facet_quadrature`.

    Note:
        Everything here is collective. A rank may own no facet, or no part of a patch.
    """

    body: Any
    facets: ContactFacets
    patches: PatchGrid | Outline
    degree: int | None = None
    counter: Opposite | None = None

    @classmethod
    def of_block(cls, block: Block, patches: PatchGrid, degree: int | None = None) -> LoadedFace:
        """Return patches on a block's top.

        Args:
            block: The block.
            patches: Patches inside the block's interface.
            degree: As for any face.

        Raises:
            InputError: When a patch reaches beyond the top.
        """
        require_inside(block.mesh.shape.interface, patches)
        return cls(block, top_facets(block.mesh), patches, degree)

    @classmethod
    def of_regions(
        cls,
        body: Any,
        parts: Sequence[ContactFacets],
        lengths: tuple[float, float],
        origin: tuple[float, float] = (0.0, 0.0),
    ) -> LoadedFace:
        """Return a whole face of any outline whose regions are given by their facets.

        Args:
            body: The body.
            parts: Facets of each region, all in one frame.
            lengths: Sides of the rectangle around all of them [mm].
            origin: Its lower corner [mm].
        """
        region = np.repeat(np.arange(len(parts)), [len(part.cell) for part in parts])
        return cls(body, parts[0].joined(parts[1:]), Outline(region, len(parts), lengths, origin))

    @property
    def space(self) -> Any:
        """Vector space of the displacements."""
        return self.body if hasattr(self.body, "dofmap") else self.body.space

    @cached_property
    def displacements(self) -> Displacements:
        """The displacements among the unknowns."""
        return self.body if isinstance(self.body, Displacements) else Displacements.of(self.space)

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.space.mesh.comm

    @cached_property
    def quadrature(self) -> FacetQuadrature:
        """Quadrature points of this rank."""
        parts = self.patches.region if isinstance(self.patches, Outline) else self.patches
        return facet_quadrature(
            self.facets, self.space, parts, degree=self.quadrature_degree, counter=self.counter
        )

    @property
    def quadrature_degree(self) -> int:
        """Polynomial degree that the quadrature is exact for."""
        hexahedral, turned = compat.is_hexahedral(self.space.mesh), self.facets.axisymmetric
        return self.degree or (4 if hexahedral else 2) * compat.lagrange_degree(self.space) + turned

    @cached_property
    def areas(self) -> Array:
        """Areas of the patches by quadrature, shape (N,) [mm²].

        Raises:
            InputError: When a patch has no part of the face.
        """
        (areas,) = self._integrals(1.0)
        if not np.all(areas > 0.0):
            raise InputError(
                "patches that have no part of the contact face",
                value=int(np.sum(areas == 0.0)),
                allowed="patches that each cover a part of it",
            )
        return areas

    def _integrals(self, *fields: Array | float) -> Array:
        """Return the integrals of fields at this rank's points over the patches, (fields, N)."""
        points, count = self.quadrature, self.patches.count
        local = [np.bincount(points.patch, points.weight * field, count) for field in fields]
        return np.asarray(self.comm.allreduce(np.array(local)))

    def pull_moments(self, state: float) -> tuple[float, float]:
        """Return the moments about the middle of the patches by what pulls the body, as bolts do.

        Args:
            state: Position among the states of the body's loads, see `ElasticBody.preload`.

        Returns:
            First moments of the pull along the axes of the face [N mm].
        """
        known = self._pull_moments
        x, y = (float(np.interp(state, np.arange(len(known)), axis)) for axis in known.T)
        return x, y

    @cached_property
    def _pull_moments(self) -> Array:
        """Moments of what pulls the body in every state of its loads, shape (states, 2) [N mm]."""
        frame, loads = self.facets.frame, self.body.loads
        origin = frame.in_space([self.patches.middle])[0]
        found = {
            one: self.body.pull_moments(one, origin, frame.axes[:2]) if one.pulls else np.zeros(2)
            for one in dict.fromkeys(loads)
        }
        return np.array([found[one] for one in loads])

    @cached_property
    def pointwise(self) -> Sampling:
        """Laws at quadrature points."""
        at, operator = self.quadrature, PETSc.Mat().createTranspose(self.points_by_dofs)
        return Sampling(operator, at.weight, at.x, at.y, at.depth, at.patch, self.patches.count)

    @cached_property
    def patchwise(self) -> Sampling:
        """Laws at the mean closures of the patches, which are distributed over the ranks."""
        member = distributed(self._members, self._own_patches, self.comm)
        operator = self.points_by_dofs.transposeMatMult(member)
        own = np.arange(*operator.getOwnershipRangeColumn())
        x, y, depth = (mean[own] for mean in self._means)
        return Sampling(operator, self.areas[own], x, y, depth, own, self.patches.count)

    @property
    def _members(self) -> csr_matrix:
        """Which patch every point of this rank is on, a row with a 1 for each."""
        points = self.quadrature
        count = len(points.x)
        return csr_matrix(
            (np.ones(count), points.patch, np.arange(count + 1)), shape=(count, self.patches.count)
        )

    @property
    def _own_patches(self) -> int:
        """Number of patches whose mean closures this rank has."""
        count, comm = self.patches.count, self.comm
        return count // comm.size + (comm.rank < count % comm.size)

    def _of_patches(self, *, held: bool) -> PETSc.Mat:
        points = self._rows(3, held=True) if held else self.points_in_all_directions
        each = kron(self._members, identity(3), format="csr")
        return points.transposeMatMult(distributed(each, 3 * self._own_patches, self.comm))

    def supported(self, nodes: Locals) -> Flags:
        """Return which displacements of this rank's nodes supports hold, shape (..., 3)."""
        held = getattr(self.body, "supported", None)
        if held is None:
            return np.zeros((*nodes.shape, 3), dtype=bool)
        return np.asarray(held.reshape(-1, 3)[nodes])

    def _rows(self, count: int, *, held: bool = False) -> PETSc.Mat:
        points, unknowns = self.quadrature, self.displacements
        on_facet = points.values != 0.0
        used = on_facet[..., None] & (self.supported(points.nodes) == held)
        columns = np.full((*on_facet.shape, 3), -1, dtype=np.int64)
        columns[on_facet] = unknowns.columns(points.nodes[on_facet])
        directions = self.facets.directions[:count]
        rows = directed_rows(
            points.weight[:, None] * points.values, columns, used, directions, unknowns.total
        )
        return distributed(rows, unknowns.owned, self.comm)

    @cached_property
    def _means(self) -> tuple[Array, Array, Array]:
        """Mean place of the patches on the face, and its depth there, shape (N,) each [mm]."""
        points, patches = self.quadrature, self.patches
        means = self._integrals(points.x, points.y, points.depth) / self.areas
        if isinstance(patches, Outline):
            return means[0], means[1], means[2]
        whole = np.abs(self.areas - patches.areas) <= 1e-9 * patches.areas
        x, y = np.where(whole, patches.centres.T, means[:2])
        return x, y, means[2]


def directed_rows(
    weights: Array, columns: Counts, used: Flags, directions: Array, unknowns: int
) -> csr_matrix:
    """Return w φ d for the displacements of every node, shape (k points, unknowns) [mm²].

    Args:
        weights: w φ at every point for the nodes of its cell, shape (points, m) [mm²].
        columns: Unknowns of their displacements along x, y, z, −1: none, shape (points, m, 3).
        used: Which displacements of theirs take part, shape (points, m, 3).
        directions: k unit vectors d, each of which has a row at every point, shape (k, 3).
        unknowns: Number of all unknowns.
    """
    count = len(directions)
    axes = np.abs(directions) > 1e-14
    row, column, entry = [], [], []
    for k, axis in np.argwhere(axes):
        here = used[..., axis] & (columns[..., axis] >= 0)
        row.append(count * np.nonzero(here)[0] + k)
        column.append(columns[here, axis])
        entry.append(weights[here] * directions[k, axis])
    shape = (count * len(weights), unknowns)
    return csr_matrix((np.concatenate(entry), (np.concatenate(row), np.concatenate(column))), shape)


def moved_by_supports(on_supports: PETSc.Mat, displacement: PETSc.Vec, weight: Array) -> Array:
    """Return what samples move by with the nodes that supports hold, shape (n, 3) [mm].

    Args:
        on_supports: The operator, see `ContactFace.on_supports`.
        displacement: Displacements of the body [mm].
        weight: Areas of this rank's samples, shape (n,) [mm²].
    """
    values = on_supports.createVecRight()
    on_supports.multTranspose(displacement, values)
    return np.asarray(values.array_r.reshape(-1, 3) / weight[:, None])


def largest_rise(face: LoadedFace, state: float) -> float:
    """Return how far loads besides the contact raise any point of a face at most, ≥ 0 [mm].

    Args:
        face: The contact face of a body.
        state: Position among the states of its loads, see `ElasticBody.preload`.

    Note:
        Collective.
    """
    body = face.body
    moved, preload = body.stiffness.createVecRight(), body.preload(state)
    if preload is None:
        return 0.0
    moved.array[:] = preload
    sampling, on_supports = face.pointwise, face.on_supports("pointwise")
    rise = -sampling.displacements(moved)
    rise -= moved_by_supports(on_supports, moved, sampling.weight)[:, 0]
    return float(face.comm.allreduce(float(rise.max(initial=0.0)), op=MPI.MAX))


def displacements_under(face: ContactFace, pressures: Array) -> Array:
    """Return the mean displacements of patches under pressures on them, shape (m, N) [mm].

    Args:
        face: Patches on the contact face of a body.
        pressures: Pressures of all patches, the same on every rank, shape (m, N) [MPa].

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective.
    """
    body, rows = face.body, []
    work = body.stiffness.createVecRight()
    for row in pressures:
        solve_linear(body.solver, face.load(row), work)
        rows.append(face.patch_displacements(work))
        compat.collect_garbage(work.comm)
    return np.array(rows)
