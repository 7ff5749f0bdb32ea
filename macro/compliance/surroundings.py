"""A rectangle on the contact face of a body: what is around it, and Legendre modes on it.

Around it are free sides, a thickness and the plane of the face. The modes are loads, and moments of
displacements.

Theory: sections 5 and 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from patchlaw.geometry import Material, PatchGrid
from patchlaw.geometry.face_frame import FaceFrame, mode_values
from patchlaw.macro import compat
from patchlaw.macro.contact.loaded_face import LoadedFace
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.mesh.contact_face import ContactFacets, contact_facets
from patchlaw.macro.mesh.facets import OuterFacets, outer_facets
from patchlaw.macro.mesh.tagged import FLAT_IN_FILES
from patchlaw.support import Array, Flags, Indices, InputError

Sides = tuple[bool, bool, bool, bool]
"""Low x, high x, low y and high y side of a rectangle."""
Span = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What is around a rectangle on the contact face of a body.

    Args:
        free_sides: Whether a free plane across the face bounds the rectangle, by side.
        thickness: Least distance under the rectangle to the other side of the body [mm].
        above: Largest height of the body above the plane of the face, at least 0 [mm].
        material: Elastic constants under the rectangle.
        held: The part of each side along which supports hold the face in its normal direction, from
            and to [mm]; None where it can give way.
    """

    free_sides: Sides
    thickness: float
    above: float
    material: Material
    held: tuple[Span | None, ...] = (None,) * 4

    @property
    def below(self) -> bool:
        """Whether the body lies on one side of the plane of its face."""
        return self.above == 0.0


def surroundings(body: ElasticBody, facets: ContactFacets, rectangle: PatchGrid) -> Surroundings:
    """Look at the body around a rectangle on its contact face.

    Args:
        body: The body.
        facets: Facets of the face, in its frame.
        rectangle: The rectangle as one patch, in that frame.

    Raises:
        InputError: When the rectangle reaches beyond the face, or lies on several materials.

    Note:
        Collective.
    """
    comm, area = body.comm, float(np.prod(rectangle.lengths))
    under = LoadedFace(body, facets, rectangle, degree=1).quadrature
    covered = comm.allreduce(float(under.weight.sum()))
    if covered < (1.0 - FLAT_IN_FILES) * area:
        raise InputError(
            "the surface's rectangle reaches beyond the contact face",
            value=f"{covered:.6g} of {area:.6g} mm² on the face",
            allowed="a rectangle on the face",
        )
    materials = body.materials_of(under.cell)
    if len(materials) != 1:
        raise InputError(
            "the surface's rectangle lies on several materials",
            value=len(materials),
            allowed="one material under the rectangle",
        )
    outer, frame = outer_facets(body.space, 2), facets.frame
    height = frame.height(outer.points)
    above = comm.allreduce(float(height.max(initial=0.0)), max)
    thickness = _thickness(comm, outer, frame, rectangle)
    strip = 0.25 * min(*rectangle.lengths, thickness)  # as deep as quarter-spaces count
    free, slack = outer.among(~_held(body, outer)), FLAT_IN_FILES * min(rectangle.lengths)
    sides = [_is_free(body, free, _side(frame, rectangle, k), strip, slack) for k in range(4)]
    return Surroundings(
        free_sides=(sides[0], sides[1], sides[2], sides[3]),
        thickness=thickness,
        above=above if above > slack else 0.0,
        material=materials.pop(),
        held=_held_spans(body, frame, rectangle, slack),
    )


def _held_spans(
    body: ElasticBody, frame: FaceFrame, rectangle: PatchGrid, slack: float
) -> tuple[Span | None, ...]:
    """Return the part of each side of a rectangle that is held across the face; collective."""
    points = body.space.tabulate_dof_coordinates()
    across = np.abs(frame.normal) > FLAT_IN_FILES
    held = body.supported.reshape(-1, 3)[:, across].all(axis=1)
    held &= np.abs(frame.height(points)) <= slack
    places, sides = frame.in_plane(points[held]) - rectangle.origin, np.array(rectangle.lengths)
    places = places[np.all((places >= -slack) & (places <= sides + slack), axis=1)]
    spans: list[Span | None] = []
    for axis, end in ((0, 0.0), (0, sides[0]), (1, 0.0), (1, sides[1])):
        along = places[np.abs(places[:, axis] - end) <= slack, 1 - axis]
        low = body.comm.allreduce(float(along.min(initial=np.inf)), min)
        high = body.comm.allreduce(float(along.max(initial=-np.inf)), max)
        spans.append((low, high) if high - low > slack else None)
    return tuple(spans)


def _thickness(comm: Any, outer: OuterFacets, frame: FaceFrame, rectangle: PatchGrid) -> float:
    """Return the least depth of the underside under the rectangle, else the body's depth [mm]."""
    depth, places = -frame.height(outer.points), frame.in_plane(outer.points) - rectangle.origin
    inside = np.all((places > 0.0) & (places < rectangle.lengths), axis=-1)
    under = inside & (outer.normals @ frame.normal < -0.5)
    least = comm.allreduce(float(depth[under].min(initial=np.inf)), min)
    deepest = comm.allreduce(float(depth.max(initial=0.0)), max)
    return float(min(least, deepest))


def _held(body: ElasticBody, outer: OuterFacets) -> Flags:
    """Return which facets are supported: all their nodes are, in one component at least."""
    nodes = body.supported.reshape(-1, 3)[outer.nodes] | ~outer.on_facet[..., None]
    return np.asarray(nodes.all(axis=1).any(axis=1))


def _side(frame: FaceFrame, rectangle: PatchGrid, side: int) -> tuple[FaceFrame, float]:
    """Return the plane across the face at a side of the rectangle, and the length of the side.

    The side runs along the first axis of the plane, from its origin; the second points into depth.
    """
    axis, high = divmod(side, 2)
    outward = (1.0 if high else -1.0) * frame.axes[axis]
    along = np.cross(-frame.normal, outward)
    corner = np.array(rectangle.origin) + high * np.eye(2)[axis] * rectangle.lengths
    if along @ frame.axes[1 - axis] < 0.0:
        corner = corner + np.eye(2)[1 - axis] * rectangle.lengths
    axes = np.stack([along, -frame.normal, outward])
    return FaceFrame(origin=frame.in_space(corner), axes=axes), rectangle.lengths[1 - axis]


def _is_free(
    body: ElasticBody, free: OuterFacets, side: tuple[FaceFrame, float], strip: float, slack: float
) -> bool:
    """Tell whether free facets in the plane of a side cover it, strip deep."""
    plane, length = side
    level = np.abs(plane.height(free.points)).max(axis=1, initial=0.0)
    upright = np.all(free.normals @ plane.normal > 1.0 - FLAT_IN_FILES, axis=1)
    flat = free.among((level < slack) & upright)
    chosen = contact_facets(body.space.mesh, flat.facet, plane)
    whole = PatchGrid(grid=(1, 1), lengths=(length, strip))
    weight = LoadedFace(body, chosen, whole, degree=1).quadrature.weight
    area = body.comm.allreduce(float(weight.sum()))
    return bool(area > (1.0 - FLAT_IN_FILES) * length * strip)


class FaceMoments:
    """Modes on a rectangle of the contact face of a body.

    Args:
        body: The body.
        facets: Facets of its contact face, in its frame.
        rectangle: The rectangle as one patch, in that frame.
        count: Modes K along a side.

    Attributes:
        area: Area of the rectangle [mm²].

    Raises:
        InputError: When there is no mode.

    Note:
        Construction and every method are collective.
    """

    def __init__(
        self, body: ElasticBody, facets: ContactFacets, rectangle: PatchGrid, count: int
    ) -> None:
        if count < 1:
            raise InputError("a face has one mode at least", value=count, allowed="K ≥ 1")
        self.body, self.facets, self.rectangle, self.count = body, facets, rectangle, count
        self.area = float(np.prod(rectangle.lengths))
        degree = (4 if body.hexahedral else 2) * body.degree + 4
        number = max(body.comm.allreduce(len(facets.cell)), 1)
        degree += 2 * round(2.0 * count / np.sqrt(number))  # on few facets modes vary much
        self.points = LoadedFace(body, facets, rectangle, degree=degree).quadrature
        (x, y), (lx, ly) = rectangle.origin, rectangle.lengths
        along_x = mode_values(self.points.x - x, lx, count)
        along_y = mode_values(self.points.y - y, ly, count)
        self._modes = (along_x[:, None] * along_y).reshape(count**2, -1) * self.points.weight
        nodes, place = np.unique(self.points.nodes, return_inverse=True)
        self._dofs = _components_of(nodes).ravel()  # of the cells at the face, ghosts included
        self._places = _components_of(place.reshape(self.points.nodes.shape))

    def of(self, displacement: Any) -> Array:
        """Return integrals over the rectangle of modes times fields, divided by the area, (4, K²).

        The fields are the displacements into the body [mm], and the strains along x, along y and
        in shear, ε_xy: half the change of the angle.

        Args:
            displacement: dolfinx Function, ghosts up to date [mm].
        """
        values = displacement.x.array[self._dofs]
        local = np.concatenate([self._displacements[2:] @ values, self._strains @ values])
        return np.asarray(self.body.comm.allreduce(local) / self.area)

    def displacements(self, displacement: Any) -> Array:
        """Return the same of the displacements along x, along y and into the body, (3, K²) [mm].

        Args:
            displacement: dolfinx Function, ghosts up to date [mm].
        """
        local = self._displacements @ displacement.x.array[self._dofs]
        return np.asarray(self.body.comm.allreduce(local) / self.area)

    def load(self, mode: int, axis: int = 2) -> Array:
        """Return the nodal forces of a mode of traction at this rank's owned dofs [N].

        Args:
            mode: The mode.
            axis: 0 along x, 1 along y, 2 into the body, as pressures are.
        """
        forces = np.zeros(3 * len(self.body.space.tabulate_dof_coordinates()))
        forces[self._dofs] = self._displacements[axis, mode]
        return compat.sum_of_ranks(self.body.space, forces)

    @cached_property
    def _displacements(self) -> Array:
        """From nodal values to integrals of displacements along x, along y and into the body."""
        axes, values = self.facets.frame.axes, self.points.values[..., None]
        return self._integrated([values * axes[0], values * axes[1], -values * axes[2]])

    @cached_property
    def _strains(self) -> Array:
        """From nodal values to integrals of strains along x, along y and in shear."""
        axes, slopes = self.facets.frame.axes, self._slopes()
        parts = [
            *(slopes[..., a : a + 1] * axes[a] for a in (0, 1)),
            0.5 * (slopes[..., :1] * axes[1] + slopes[..., 1:] * axes[0]),
        ]
        return self._integrated(parts)

    def _integrated(self, parts: list[Array]) -> Array:
        """Return integrals of modes times sums of nodal values, (parts, K², values).

        Args:
            parts: Weights of the values in the sums, at the n points (n, m, 3) each.
        """
        count, *nodal = self._places.shape
        starts = np.prod(nodal) * np.arange(count + 1)
        found = np.empty((len(parts), len(self._modes), len(self._dofs)))
        for integrals, part in zip(found, parts, strict=True):
            values = part.ravel(), self._places.ravel(), starts
            sums = csr_matrix(values, shape=(count, len(self._dofs)))
            integrals[:] = (sums.T @ self._modes.T).T
        return found

    def _slopes(self) -> Array:
        """Return the slopes of the basis functions along both axes of the face, (n, m, 2)."""
        points, mesh = self.points, self.body.space.mesh
        name, degree = mesh.topology.cell_name(), compat.lagrange_degree(self.body.space)
        if not len(points.x):
            return np.empty((*points.values.shape, 2))
        rows = compat.cell_vertices(mesh)[points.cell]
        shape = compat.lagrange_gradients(name, compat.geometry_degree(mesh), points.reference)
        maps = np.einsum("nak,naj->nkj", shape, mesh.geometry.x[rows])  # ∂x_j/∂X_k
        basis = compat.lagrange_gradients(name, degree, points.reference)
        gradients = np.linalg.solve(maps, basis.transpose(0, 2, 1))
        return np.asarray(np.einsum("aj,njm->nma", self.facets.frame.axes[:2], gradients))


def _components_of(nodes: Indices) -> Indices:
    """Return the places of the three components of values at nodes, shape (..., 3)."""
    return 3 * nodes[..., None] + np.arange(3)
