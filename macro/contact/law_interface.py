"""The contact interface: patches on the block's top, each with a law p = f(closure).

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, get_args

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from geometry.errors import InputError
from geometry.meshes.block import require_inside
from geometry.patches import PatchGrid
from macro import compat
from macro.block import Block
from macro.linear_solvers.node_matrices import distributed
from macro.linear_solvers.options import solve_linear
from macro.mesh.contact_face import FacetQuadrature, facet_quadrature

Array = NDArray[np.float64]
Mode = Literal["patchwise", "pointwise"]


class ContactLaw(Protocol):
    """Contact pressure p of a patch as a function of its closure c.

    Closure is the approach of the plane minus the downward displacement of the block's surface
    [mm]. Pressures are positive in compression [MPa], and the stiffness is dp/dc ≥ 0 [MPa/mm]. Both
    must be defined for every closure, because Newton's iterates may leave the range of a tabulated
    law: whoever tabulates laws extends them and checks the converged closures.
    """

    def pressure(self, closure: Array, /) -> Array:
        """Return the pressures at closures of shape (n,)."""
        ...

    def stiffness(self, closure: Array, /) -> Array:
        """Return the exact derivative of the pressures at closures of shape (n,)."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampling:
    """The samples that laws are evaluated at, and the loads by their pressures.

    A sample is a whole patch or a quadrature point. With the nodal displacements u, the pressures p
    and the weights w of the samples, the nodal load is ``B p`` and the downward displacement of the
    samples is ``(Bᵀ u) / w``. The same operator in both makes every tangent symmetric.

    Args:
        operator: B, rows like the displacements, columns like the samples [mm²].
        weight: Area of each of this rank's samples, shape (n,) [mm²].
        x: Abscissae of this rank's samples, shape (n,) [mm].
        y: Ordinates of this rank's samples, shape (n,) [mm].
        patch: Flat patch index of this rank's samples, ascending, shape (n,).
        count: Number of patches N.
    """

    operator: PETSc.Mat
    weight: Array
    x: Array
    y: Array
    patch: NDArray[np.intp]
    count: int

    def patch_sums(self, values: Array) -> Array:
        """Return the integrals of sampled values over every patch, shape (N,); collective."""
        local = np.bincount(self.patch, weights=self.weight * values, minlength=self.count)
        return self.operator.comm.tompi4py().allreduce(local, op=MPI.SUM)

    def by_patch(self, functions: Sequence[Callable[[Array], Array]], closure: Array) -> Array:
        """Return functions of closure, one per patch, at this rank's samples, shape (n,).

        Args:
            functions: One function per patch.
            closure: Closures of the samples, shape (n,) [mm].
        """
        values = np.empty_like(closure)
        ends = np.searchsorted(self.patch, np.arange(self.count + 1))
        for i in np.unique(self.patch):
            part = slice(ends[i], ends[i + 1])
            values[part] = functions[i](closure[part])
        return values


@dataclass(frozen=True, eq=False)
class Interface:
    """Patches on a block's top; the rest of the top is free of traction.

    Args:
        block: The elastic block.
        patches: Patches inside the block's interface.
        degree: Polynomial degree that the quadrature is exact for; None: that of products of two
            basis functions.

    Raises:
        InputError: When a patch reaches beyond the top.

    Note:
        Everything here is collective. A rank may own no facet, or no part of a patch.
    """

    block: Block
    patches: PatchGrid
    degree: int | None = None

    def __post_init__(self) -> None:
        require_inside(self.block.mesh.shape.interface, self.patches)

    @cached_property
    def quadrature(self) -> FacetQuadrature:
        """Quadrature points of this rank."""
        shape = self.block.mesh.shape
        degree = self.degree or (4 if shape.hexahedral else 2) * shape.degree
        return facet_quadrature(self.block.mesh, self.block.space, self.patches, degree=degree)

    @cached_property
    def areas(self) -> Array:
        """Areas of the patches by quadrature, shape (N,) [mm²]."""
        points = self.quadrature
        local = np.bincount(points.patch, weights=points.weight, minlength=self.patches.count)
        return self.block.mesh.comm.allreduce(local, op=MPI.SUM)

    def sampling(self, mode: Mode) -> Sampling:
        """Return the samples of a mode: ``"patchwise"`` or ``"pointwise"``.

        Raises:
            InputError: When there is no such mode.
        """
        if mode not in get_args(Mode):
            raise InputError("unknown interface", value=mode, allowed=", ".join(get_args(Mode)))
        return self.patchwise if mode == "patchwise" else self.pointwise

    @cached_property
    def pointwise(self) -> Sampling:
        """Laws at quadrature points."""
        points = self.quadrature
        operator = PETSc.Mat()
        self.points_by_dofs.transpose(operator)
        return Sampling(
            operator=operator,
            weight=points.weight,
            x=points.x,
            y=points.y,
            patch=points.patch,
            count=self.patches.count,
        )

    @cached_property
    def patchwise(self) -> Sampling:
        """Laws at the mean closures of the patches, which are distributed over the ranks."""
        points, comm = self.quadrature, self.block.mesh.comm
        count = self.patches.count
        member = csr_matrix(
            (np.ones(len(points.x)), points.patch, np.arange(len(points.x) + 1)),
            shape=(len(points.x), count),
        )
        columns = count // comm.size + (comm.rank < count % comm.size)
        operator = self.points_by_dofs.transposeMatMult(distributed(member, columns, comm))
        own = np.arange(*operator.getOwnershipRangeColumn())
        centres = self.patches.centres[own]
        return Sampling(
            operator=operator,
            weight=self.areas[own],
            x=centres[:, 0],
            y=centres[:, 1],
            patch=own,
            count=self.patches.count,
        )

    def load(self, pressures: Array) -> PETSc.Vec:
        """Return the nodal load of pressures that are uniform on every patch.

        Args:
            pressures: Pressures of all patches, on every rank, shape (N,) [MPa].
        """
        sampling = self.patchwise
        values = sampling.operator.createVecRight()
        values.array[:] = np.asarray(pressures, dtype=np.float64)[sampling.patch]
        load = sampling.operator.createVecLeft()
        sampling.operator.mult(values, load)
        return load

    def patch_displacements(self, displacement: PETSc.Vec) -> Array:
        """Return the mean downward displacements of the patches, on every rank, shape (N,) [mm]."""
        sampling = self.patchwise
        values = sampling.operator.createVecRight()
        sampling.operator.multTranspose(displacement, values)
        return sampling.patch_sums(values.array_r / sampling.weight) / self.areas

    @cached_property
    def points_by_dofs(self) -> PETSc.Mat:
        """−w φ of the vertical displacements at every point, shape (points, dofs) [mm²]."""
        points, nodes = self.quadrature, self.block.space.dofmap.index_map
        used = np.abs(points.values) > 1e-12  # excludes nodes that are not on the facet
        columns = 3 * nodes.local_to_global(points.nodes[used]).astype(np.int64) + 2
        starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
        entries = -(points.weight[:, None] * points.values)[used]
        shape = (len(points.x), 3 * nodes.size_global)
        rows = csr_matrix((entries, columns, starts), shape=shape)
        return distributed(rows, self.block.owned_dofs, self.block.mesh.comm)


def patch_compliance_matrix(interface: Interface) -> Array:
    """Return the mean downward displacement of patch i by unit pressure on patch j.

    By reciprocity the matrix is symmetric for patches of equal area. Errors of the linear solver
    are averaged between the two triangles.

    Args:
        interface: Patches on the block's top.

    Returns:
        The compliance, the same on every rank, shape (N, N) [mm/MPa].

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective.
    """
    compliance = displacements_under(interface, np.eye(interface.patches.count))
    return np.asarray(0.5 * (compliance + compliance.T))


def displacements_under(interface: Interface, pressures: Array) -> Array:
    """Return the mean displacements of patches under pressures on them, shape (m, N) [mm].

    Args:
        interface: Patches on the block's top.
        pressures: Pressures of all patches, the same on every rank, shape (m, N) [MPa].

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective.
    """
    block, rows = interface.block, []
    work = block.stiffness.createVecRight()
    for row in pressures:
        solve_linear(block.solver, interface.load(row), work)
        rows.append(interface.patch_displacements(work))
        compat.collect_garbage(work.comm)
    return np.array(rows)
