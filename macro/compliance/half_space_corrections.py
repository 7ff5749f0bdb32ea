"""Loads of a body that correct what a half-space under pressures or tractions does to it.

The half-space's tractions are taken off the body's outer surface, its displacements off the
supports, and where the body has other elastic constants than under the rectangle, its stresses
count with the difference.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from geometry.materials import Material
from geometry.patches import PatchGrid
from macro import compat
from macro.elastic_body import ElasticBody, stiffness_form
from macro.mesh.block import FLAT
from macro.mesh.contact_face import ContactFacets
from macro.mesh.facets import OuterFacets, outer_facets
from support.arrays import Array

_BATCH = 20_000
"""Points of the surface whose fields are evaluated at once."""


class HalfSpaceFields(Protocol):
    """Fields in a half-space under the modes, in the coordinates of the rectangle."""

    @property
    def count(self) -> int:
        """Modes K along a side."""
        ...

    def __call__(self, points: Array, /) -> tuple[Array, Array]:
        """Return displacements (n, 3, K²) [mm] and stresses (n, 3, 3, K²) [MPa] at points."""
        ...

    def modes(self) -> tuple[Array, Array]:
        """Return displacements (K², K²) [mm/N] and stresses (3, K², K²) [1/mm²] in modes."""
        ...

    def displacement_modes(self) -> Array:
        """Return displacements along x, y and downwards in modes, shape (3, K², K²) [mm/N]."""
        ...


class HalfSpaceCorrections:
    """What a half-space under the modes does wrong on a body's surface, as loads of the body.

    Args:
        body: The body.
        facets: Facets of its contact face, in its frame.
        rectangle: The rectangle that the modes cover, in that frame.
        material: Elastic constants under the rectangle.
        fields: The half-space of that material under the modes.

    Note:
        Construction and ``load`` are collective.
    """

    def __init__(
        self,
        body: ElasticBody,
        facets: ContactFacets,
        rectangle: PatchGrid,
        material: Material,
        fields: HalfSpaceFields,
    ) -> None:
        frame = facets.frame.moved(*rectangle.origin)
        outer = outer_facets(body.space, 2 * body.degree + 4)
        level = np.abs(frame.height(outer.points)).max(axis=1, initial=0.0)
        outer = outer.among(level > FLAT * max(rectangle.lengths))
        self._body, self._nodes = body, np.unique(outer.nodes[outer.on_facet])
        self._frame, self._fields, self._material = frame, fields, material
        self._tractions = self._integrated(outer)
        self._held = fem.Function(body.space)
        self._supported = np.flatnonzero(body.supported)
        self._support_nodes, self._row = np.unique(self._supported // 3, return_inverse=True)
        self._displacements = self._displacement(self._support_nodes)
        self._product = compat.compile_form(ufl.action(body.form, self._held))

    def load(self, mode: int) -> Array:
        """Return the nodal forces of a mode at this rank's owned degrees of freedom [N]."""
        local = np.zeros((len(self._held.x.array) // 3, 3))
        local[self._nodes] = self._tractions[..., mode]
        forces = compat.sum_of_ranks(self._body.space, local.ravel())
        self._held.x.array[:] = self.prescribed(mode)
        forces -= compat.assemble_vector(self._product).array_r
        if self._elsewhere is not None:
            form, function, nodes, displacements = self._elsewhere
            function.x.array.reshape(-1, 3)[nodes] = displacements[..., mode]
            forces -= compat.assemble_vector(form).array_r
        return forces

    def prescribed(self, mode: int) -> Array:
        """Return the displacements that supports prescribe, this rank's with ghosts."""
        values = np.zeros(len(self._held.x.array))
        values[self._supported] = -self._displacements[self._row.ravel(), self._supported % 3, mode]
        return values

    def _integrated(self, outer: OuterFacets) -> Array:
        """Return the forces at the nodes by the half-space's tractions, (nodes, 3, K²) [N]."""
        count, points = outer.weights.shape
        total = np.zeros((len(self._nodes), 3 * self._fields.count**2))
        place = np.searchsorted(self._nodes, outer.nodes)
        for part in np.array_split(np.arange(count), -(-count * points // _BATCH) or 1):
            stress = self._fields(self._local_places(outer.points[part].reshape(-1, 3)))[1]
            normals = outer.normals[part].reshape(-1, 3) @ self._frame.axes.T
            tractions = np.einsum("nijk,nj->nik", stress, normals)
            tractions = np.einsum("ia,nik->nak", self._frame.axes, tractions)
            tractions *= -outer.weights[part].reshape(-1, 1, 1)
            values = outer.values[outer.side[part]] * outer.on_facet[part][:, None]
            rows = np.repeat(place[part], points, axis=0)
            starts = np.arange(len(rows) + 1) * rows.shape[1]
            flat = (values.reshape(rows.shape).ravel(), rows.ravel() % len(self._nodes), starts)
            shape = csr_matrix(flat, shape=(len(rows), len(self._nodes)))
            total += shape.T @ tractions.reshape(len(rows), -1)
        return total.reshape(len(self._nodes), 3, -1)

    def _displacement(self, nodes: NDArray[np.intp]) -> Array:
        """Return the half-space's displacements of nodes, shape (n, 3, K²) [mm]."""
        places = self._body.space.tabulate_dof_coordinates()[nodes]
        displacements = np.empty((len(nodes), 3, self._fields.count**2))
        for part in np.array_split(np.arange(len(nodes)), -(-len(nodes) // _BATCH) or 1):
            local = self._fields(self._local_places(places[part]))[0]
            displacements[part] = np.einsum("ia,nik->nak", self._frame.axes, local)
        return displacements

    def _local_places(self, points: Array) -> Array:
        """Return points in the coordinates of the rectangle."""
        return np.column_stack([self._frame.in_plane(points), self._frame.height(points)])

    @cached_property
    def _elsewhere(self) -> tuple[Any, Any, NDArray[np.intp], Array] | None:
        """Where the body has other elastic constants: the form of the difference.

        It acts on a function, whose nodes there get the displacements of the half-space.
        """
        body = self._body
        differences = [
            np.asarray(values, float) - own
            for values, own in zip(body.cell_lame, self._material.lame, strict=True)
        ]
        size = sum(self._material.lame)
        other = np.abs(differences[0]) + np.abs(differences[1]) > 1e-9 * size
        if not body.comm.allreduce(bool(other.any())):
            return None
        cells = [np.where(other, values, 0.0) for values in differences]
        displacement = fem.Function(body.space)
        form = stiffness_form(body.space, (cells[0], cells[1]), body.quadrature_degree)
        nodes = np.unique(compat.cell_nodes(body.space)[np.flatnonzero(other)])
        action = compat.compile_form(ufl.action(form, displacement))
        return action, displacement, nodes, self._displacement(nodes)
