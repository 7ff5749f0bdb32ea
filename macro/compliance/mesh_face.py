"""Compliance of a rectangle on the contact face of a meshed body, in Legendre modes.

The displacement by a mode of pressure is that of a half-space, in closed form, and a correction u:
`HalfSpaceCorrections` load the body for it. The correction is smooth, so that the user's mesh
resolves it. Where the body rises above the plane of its face the half-space ends there; then the
modes load the mesh itself, and their displacements are as good as the mesh under them.

The loads that correct a half-space take its tractions off the body's outer surface, and its
displacements off the supports; where the body has other elastic constants than under the rectangle,
its stresses count with the difference.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple, Protocol

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from patchlaw.geometry import Material
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import compat
from patchlaw.macro.bodies import MeshedBody
from patchlaw.macro.compliance.face_compliance import FaceCompliance, reciprocal, stresses_in_face
from patchlaw.macro.compliance.surroundings import FaceMoments
from patchlaw.macro.contact.other_elements import refined_body
from patchlaw.macro.elastic_body import stiffness_form
from patchlaw.macro.linear_solvers.options import PREFIX
from patchlaw.macro.linear_solvers.selection import FACTORISED
from patchlaw.macro.linear_solvers.solvers import Factors, solve_linear
from patchlaw.macro.mesh.block import FLAT
from patchlaw.macro.mesh.contact_face import ContactFacets
from patchlaw.macro.mesh.facets import OuterFacets, outer_facets
from patchlaw.support import Array, Indices

_BATCH = 20_000
"""Points of the surface whose fields are evaluated at once."""

MOST_DOFS = 500_000
"""Degrees of freedom up to which linear elements are raised to quadratic ones."""

_MOST_CUT_DOFS = 60_000
"""Degrees of freedom of quadratic elements up to which cells are cut into eight. They are
factorised: 144 modes on 40,000 take 6 s on a slow core."""

_OF_CUT, _OF_RAISED = 0.5, 0.5
"""Errors of quadratic elements over what quadratic ones on cells twice as long, and linear ones on
the same cells, change."""


class HalfSpaceFields(Protocol):
    """Fields in a half-space under the modes, in the coordinates of the rectangle."""

    @property
    def count(self) -> int:
        """Modes K along a side."""
        ...

    @property
    def material(self) -> Material:
        """Elastic constants."""
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
        moments: The modes on the body's face.
        fields: The half-space of the material under the rectangle under them.

    Note:
        Construction and ``load`` are collective.
    """

    def __init__(self, moments: FaceMoments, fields: HalfSpaceFields) -> None:
        body, rectangle = moments.body, moments.rectangle
        frame = moments.facets.frame.moved(*rectangle.origin)
        outer = outer_facets(body.space, 2 * body.degree + 4)
        level = np.abs(frame.height(outer.points)).max(axis=1, initial=0.0)
        outer = outer.among(level > FLAT * max(rectangle.lengths))
        self._body, self._nodes = body, np.unique(outer.nodes[outer.on_facet])
        self._frame, self._fields = frame, fields
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
        modes = self._fields.count**2
        total = np.zeros((len(self._nodes), 3 * modes))  # of ranks without nodes too
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
            total += shape.T @ tractions.reshape(len(rows), 3 * modes)
        return total.reshape(len(self._nodes), 3, modes)

    def _displacement(self, nodes: Indices) -> Array:
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
    def _elsewhere(self) -> tuple[Any, Any, Indices, Array] | None:
        """Where the body has other elastic constants: the form of the difference.

        It acts on a function, whose nodes there get the displacements of the half-space.
        """
        body, lame = self._body, self._fields.material.lame
        differences = [
            np.asarray(values, float) - own
            for values, own in zip(body.cell_lame, lame, strict=True)
        ]
        size = sum(lame)
        other = np.abs(differences[0]) + np.abs(differences[1]) > 1e-9 * size
        if not body.comm.allreduce(bool(other.any())):
            return None
        cells = [np.where(other, values, 0.0) for values in differences]
        displacement = fem.Function(body.space)
        form = stiffness_form(body.space, (cells[0], cells[1]), body.quadrature_degree)
        nodes = np.unique(compat.cell_nodes(body.space)[np.flatnonzero(other)])
        action = compat.compile_form(ufl.action(form, displacement))
        return action, displacement, nodes, self._displacement(nodes)


def from_outside(facets: ContactFacets, length: float) -> ContactFacets:
    """Return a counter-body's facets in a frame of its own, turned about the y axis.

    Args:
        facets: In the frame of the face of the body that it is pressed on.
        length: Length Lx of the rectangle, from the origin of that frame: x becomes Lx − x [mm].
    """
    e1, e2, normal = facets.frame.axes
    origin = facets.frame.in_space([length, 0.0])
    x, y = np.moveaxis(facets.corners, -1, 0)
    return replace(
        facets,
        frame=FaceFrame(origin=origin, axes=np.stack([-e1, e2, -normal])),
        corners=np.stack([length - x, y], axis=-1),
    )


def turned(face: FaceCompliance) -> FaceCompliance:
    """Return the compliance of a face as seen with its x axis turned round.

    Args:
        face: With x counted from the other end of the rectangle.
    """
    odd = np.kron((-1.0) ** np.arange(face.count), np.ones(face.count))
    signs = np.multiply.outer(odd, odd)
    shear = np.array([1.0, 1.0, -1.0])[:, None, None]
    return FaceCompliance(
        normal=signs * face.normal,
        growth=signs * face.growth,
        stresses=shear * signs * face.stresses,
        rough=None if face.rough is None else signs * face.rough,
    )


class Discretised(NamedTuple):
    """A body on the finest elements that it is solved with, and what shows their error.

    Attributes:
        body: The body.
        facets: Facets of its contact face.
        coarser: The same on coarser elements; None where there are none.
        share: Errors over what the coarser elements change.
    """

    body: MeshedBody
    facets: ContactFacets
    coarser: tuple[MeshedBody, ContactFacets] | None
    share: float

    @classmethod
    def of(cls, body: MeshedBody, facets: ContactFacets) -> Discretised:
        """Return a body on quadratic elements of its cells, of few ones cut into eight.

        A body that is too large for quadratic elements stays as it is, and its error is not known.

        Args:
            body: The body.
            facets: Facets of its contact face.

        Note:
            Collective.
        """
        if body.degree == 1:
            if 8 * body.dofs > MOST_DOFS:
                return cls(body, facets, None, math.inf)
            body = replace(body, order=2)
        if 8 * body.dofs <= _MOST_CUT_DOFS and (cut := refined_body(body, facets)) is not None:
            return cls(*cut, (body, facets), _OF_CUT)
        return cls(body, facets, (body.linear, facets), _OF_RAISED)

    def off_by_error(
        self, found: Array, solve: Callable[[MeshedBody, ContactFacets], Array]
    ) -> Array:
        """Return a compliance that is larger by its error, NaN where that is not known.

        What other elements change has either sign. All of it counts as compliance, so that parts of
        it do not cancel by chance.

        Args:
            found: The compliance, symmetric, shape (…, n, n).
            solve: Returns that on other elements.
        """
        if self.coarser is None:
            return np.full_like(found, np.nan)
        *ways, size, _ = found.shape
        count = size * math.prod(ways[:1])
        change = solve(*self.coarser) - found
        if ways:  # of tractions and displacements in several directions
            change = change.swapaxes(1, 2)
        values, vectors = np.linalg.eigh(change.reshape(count, count))
        larger = (vectors * (self.share * np.abs(values))) @ vectors.T
        if ways:
            larger = larger.reshape(ways[0], size, ways[1], size).swapaxes(1, 2)
        return found + larger


def mesh_face_compliance(
    moments: FaceMoments, material: Material, fields: HalfSpaceFields | None
) -> FaceCompliance:
    """Solve for the response of a rectangle on a body's face to every mode of pressure.

    Args:
        moments: The K² modes on the rectangle.
        material: Elastic constants under the rectangle.
        fields: The half-space of that material under the modes, where the body lies on one side of
            the plane of its face; None to load the mesh by the modes themselves.

    Returns:
        The compliance, the same on every rank.

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective. One solve for each of the K² modes.
    """
    count, area = moments.count, moments.area
    load = _Tractions(moments, 2) if fields is None else HalfSpaceCorrections(moments, fields)
    responses = np.zeros((4, count**2, count**2))
    for _, mode, displacement in _displacements(moments, [load]):
        responses[:, :, mode] = moments.of(displacement)
    # per unit moment: a mode has the moment A, and its own displacements' moments are over A
    return _gathered(responses / area, area, material, fields)


def mesh_face_tractions(moments: FaceMoments, fields: Sequence[HalfSpaceFields] | None) -> Array:
    """Solve for the displacements of a rectangle on a body's face by every mode of traction.

    Args:
        moments: The K² modes on the rectangle.
        fields: The half-space of the material there under modes along x and along y; None to load
            the mesh by the modes themselves, see `mesh_face_compliance`.

    Returns:
        Displacements along x, along y and downwards by tractions likewise, in modes, as
        `face_tractions` returns them: symmetric, shape (3, 3, K², K²) [mm/N]; the same on every
        rank.

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective. One solve for each of the 2 K² modes.
    """
    loads: Sequence[_Load] = [_Tractions(moments, axis) for axis in range(2)]
    if fields is not None:
        loads = [HalfSpaceCorrections(moments, field) for field in fields]
    total = np.zeros((3, 3, moments.count**2, moments.count**2))
    for axis, mode, displacement in _displacements(moments, loads):
        total[:, axis, :, mode] = moments.displacements(displacement)
    total /= moments.area
    if fields is not None:
        total[:, :2] += np.stack([field.displacement_modes() for field in fields], axis=1)
    return reciprocal(total)


def seen_from_behind(tractions: Array) -> Array:
    """Return displacements by tractions of a counter-body's face as the first body has them.

    Tractions on both bodies are opposite, and displacements are those of one against the other. In
    the counter-body's own frame, which is turned about the y axis, those along x and into the body
    are alike, and those along y opposite.

    Args:
        tractions: What `mesh_face_tractions` returned in that frame, with x counted from the other
            end of the rectangle.
    """
    count = round(tractions.shape[-1] ** 0.5)
    odd = np.kron((-1.0) ** np.arange(count), np.ones(count))
    ways = np.array([1.0, -1.0, 1.0])
    return np.asarray(np.einsum("a,b,m,n->abmn", ways, ways, odd, odd) * tractions)


def _gathered(
    responses: Array, area: float, material: Material, fields: HalfSpaceFields | None
) -> FaceCompliance:
    """Return the whole response from the moments of displacements and strains."""
    normal, *strains = responses
    stresses = stresses_in_face(material, strains, area if fields is None else None)
    if fields is not None:
        below, beside = fields.modes()
        normal, stresses = normal + below, stresses + beside
    (xx, yy, xy), nu, modulus = stresses, material.poisson_ratio, material.young_modulus
    work = xx.T @ (xx - nu * yy) + yy.T @ (yy - nu * xx) + 2.0 * (1.0 + nu) * xy.T @ xy
    growth = np.eye(len(normal)) / area / modulus - area * (work / modulus)
    return FaceCompliance.of(normal, growth, stresses)


class _Tractions:
    """Modes of traction along an axis, as loads of the mesh."""

    def __init__(self, moments: FaceMoments, axis: int) -> None:
        self._moments, self._axis = moments, axis

    def load(self, mode: int) -> Array:
        """Return the nodal forces of a mode at this rank's owned degrees of freedom [N]."""
        return self._moments.load(mode, self._axis)

    def prescribed(self, _mode: int) -> float:
        """Return the displacements that supports prescribe: none."""
        return 0.0


_Load = _Tractions | HalfSpaceCorrections


def _displacements(moments: FaceMoments, loads: Sequence[_Load]) -> Iterator[tuple[int, int, Any]]:
    """Yield the number of a load, that of a mode, and the displacements by it as a function.

    Args:
        moments: The modes.
        loads: The loads, each of all modes.
    """
    body = moments.body
    free, (load, solution) = body.free.array_r.copy(), body.stiffness.createVecs()
    places = list(product(range(len(loads)), range(moments.count**2)))
    at_once = body.dofs <= FACTORISED and not PETSc.Options(PREFIX).hasName("pc_type")
    if at_once:
        forces = np.stack([free * loads[which].load(mode) for which, mode in places], axis=1)
        factors = Factors(body.stiffness)
        solved = factors(forces)
        factors.destroy()
    for number, (which, mode) in enumerate(places):
        if not at_once:
            load.array[:] = free * loads[which].load(mode)
            solve_linear(body.solver, load, solution)
            compat.collect_garbage(solution.comm)
        displacement = body.function(solved[:, number] if at_once else solution.array_r)
        displacement.x.array[:] += loads[which].prescribed(mode)
        yield which, mode, displacement
