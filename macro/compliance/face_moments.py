"""Legendre modes on a rectangle of a meshed contact face: loads, and moments of displacements.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from geometry.legendre_modes import mode_values
from geometry.patches import PatchGrid
from macro import compat
from macro.contact.loaded_face import LoadedFace
from macro.elastic_body import ElasticBody
from macro.mesh.contact_face import ContactFacets

Array = NDArray[np.float64]

_MORE = 4
"""Degree of the quadrature beyond that of products of two basis functions."""


class Moments(NamedTuple):
    """Integrals over the rectangle of modes times fields, divided by the area, shape (K²,) each.

    Attributes:
        normal: Displacements into the body [mm].
        xx: Strains along x.
        yy: Strains along y.
        xy: Shear strains ε_xy, half the change of the angle.
    """

    normal: Array
    xx: Array
    yy: Array
    xy: Array


class FaceMoments:
    """Modes on a rectangle of the contact face of a body.

    Args:
        body: The body.
        facets: Facets of its contact face, in its frame.
        rectangle: The rectangle as one patch, in that frame.
        count: Modes K along a side.

    Note:
        Construction and every method are collective.
    """

    def __init__(
        self, body: ElasticBody, facets: ContactFacets, rectangle: PatchGrid, count: int
    ) -> None:
        self._body, self._frame = body, facets.frame
        self._area = float(np.prod(rectangle.lengths))
        degree = (4 if body.hexahedral else 2) * body.degree + _MORE
        number = max(body.comm.allreduce(len(facets.cell)), 1)
        degree += 2 * round(2.0 * count / np.sqrt(number))  # on few facets modes vary much
        self.points = LoadedFace(body, facets, rectangle, degree=degree).quadrature
        x, y = (
            mode_values(at - start, length, count)
            for at, start, length in zip(
                (self.points.x, self.points.y), rectangle.origin, rectangle.lengths, strict=True
            )
        )
        self._modes = (x[:, None] * y).reshape(count**2, -1) * self.points.weight

    def of(self, displacement: Any) -> Moments:
        """Return the moments of a displacement.

        Args:
            displacement: dolfinx Function, ghosts up to date [mm].
        """
        values = displacement.x.array
        local = np.stack([self._modes @ (part @ values) for part in self._operators])
        total = self._body.comm.allreduce(local, op=MPI.SUM) / self._area
        return Moments(*total)

    def load(self, mode: int) -> Array:
        """Return the nodal forces of a mode of pressure at this rank's owned dofs [N]."""
        return compat.sum_of_ranks(self._body.space, self._operators[0].T @ self._modes[mode])

    @cached_property
    def _operators(self) -> tuple[csr_matrix, ...]:
        """From nodal values to displacements into the body and strains at the points."""
        points, axes = self.points, self._frame.axes
        slopes = self._slopes()
        parts = [
            -points.values[..., None] * axes[2],
            *(slopes[..., a : a + 1] * axes[a] for a in (0, 1)),
            0.5 * (slopes[..., :1] * axes[1] + slopes[..., 1:] * axes[0]),
        ]
        columns = (3 * points.nodes[..., None] + np.arange(3)).reshape(
            len(points.x), 3 * points.nodes.shape[1]
        )
        starts = columns.shape[1] * np.arange(len(points.x) + 1)
        size = len(points.x), 3 * len(self._body.space.tabulate_dof_coordinates())
        return tuple(
            csr_matrix((part.ravel(), columns.ravel(), starts), shape=size) for part in parts
        )

    def _slopes(self) -> Array:
        """Return the slopes of the basis functions along both axes of the face, (n, m, 2)."""
        points, mesh = self.points, self._body.space.mesh
        name, degree = mesh.topology.cell_name(), compat.lagrange_degree(self._body.space)
        if not len(points.x):
            return np.empty((*points.values.shape, 2))
        rows = compat.cell_vertices(mesh)[points.cell]
        shape = compat.lagrange_gradients(name, compat.geometry_degree(mesh), points.reference)
        maps = np.einsum("nak,naj->nkj", shape, mesh.geometry.x[rows])  # ∂x_j/∂X_k
        basis = compat.lagrange_gradients(name, degree, points.reference)
        gradients = np.linalg.solve(maps, basis.transpose(0, 2, 1))
        return np.asarray(np.einsum("aj,njm->nma", self._frame.axes[:2], gradients))
