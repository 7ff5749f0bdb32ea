"""What is around a rectangle on the contact face of a body: free sides, thickness, the plane.

Theory: sections 5 and 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.face_frame import FaceFrame
from geometry.materials import Material
from geometry.patches import PatchGrid
from macro.contact.loaded_face import LoadedFace
from macro.elastic_body import ElasticBody
from macro.mesh.contact_face import ContactFacets, contact_facets
from macro.mesh.facets import OuterFacets, outer_facets
from macro.mesh.tagged import FLAT_IN_FILES
from support.errors import InputError

Array = NDArray[np.float64]
Sides = tuple[bool, bool, bool, bool]
"""Low x, high x, low y and high y side of a rectangle."""

_STRIP = 0.25
"""Height of the strip of a free side that must be whole, relative to the rectangle's shorter side
or the thickness: the distance that sides count up to as quarter-spaces."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """What is around a rectangle on the contact face of a body.

    Args:
        free_sides: Whether a free plane across the face bounds the rectangle, by side.
        thickness: Least distance under the rectangle to the other side of the body [mm].
        above: Largest height of the body above the plane of the face, at least 0 [mm].
        material: Elastic constants under the rectangle.
    """

    free_sides: Sides
    thickness: float
    above: float
    material: Material

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
    covered = _area_in(body, facets, rectangle)
    if covered < (1.0 - FLAT_IN_FILES) * area:
        raise InputError(
            "the surface's rectangle reaches beyond the contact face",
            value=f"{covered:.6g} of {area:.6g} mm² on the face",
            allowed="a rectangle on the face",
        )
    outer = outer_facets(body.space, 2)
    frame, slack = facets.frame, FLAT_IN_FILES * min(rectangle.lengths)
    height = frame.height(outer.points.reshape(-1, 3)).reshape(outer.weights.shape)
    above = comm.allreduce(float(height.max(initial=0.0)), op=MPI.MAX)
    thickness = _thickness(comm, outer, facets, rectangle, height)
    strip = _STRIP * min(*rectangle.lengths, thickness)
    free = outer.among(~_held(body, outer))
    sides = [_free_plane(body, free, frame, rectangle, side, strip, slack) for side in range(4)]
    return Surroundings(
        free_sides=(sides[0], sides[1], sides[2], sides[3]),
        thickness=thickness,
        above=above if above > slack else 0.0,
        material=_material_under(body, facets, rectangle),
    )


def _area_in(body: ElasticBody, facets: ContactFacets, rectangle: PatchGrid) -> float:
    """Return the area of facets within a rectangle in their plane, of all ranks [mm²]."""
    quadrature = LoadedFace(body, facets, rectangle, degree=1).quadrature
    return float(body.comm.allreduce(float(quadrature.weight.sum())))


def _thickness(
    comm: Any, outer: OuterFacets, facets: ContactFacets, rectangle: PatchGrid, height: Array
) -> float:
    """Return the least depth of the underside under the rectangle, else the body's depth [mm]."""
    places = facets.frame.in_plane(outer.points.reshape(-1, 3)) - rectangle.origin
    inside = np.all((places > 0.0) & (places < rectangle.lengths), axis=1).reshape(height.shape)
    under = inside & (outer.normals @ facets.frame.normal < -0.5)
    least = comm.allreduce(float((-height[under]).min(initial=np.inf)), op=MPI.MIN)
    deepest = comm.allreduce(float((-height).max(initial=0.0)), op=MPI.MAX)
    return float(min(least, deepest))


def _held(body: ElasticBody, outer: OuterFacets) -> NDArray[np.bool_]:
    """Return which facets are supported: all their nodes are, in one component at least."""
    nodes = body.supported.reshape(-1, 3)[outer.nodes] | ~outer.on_facet[..., None]
    return np.asarray(nodes.all(axis=1).any(axis=1))


def _free_plane(
    body: ElasticBody,
    free: OuterFacets,
    frame: FaceFrame,
    rectangle: PatchGrid,
    side: int,
    strip: float,
    slack: float,
) -> bool:
    """Tell whether a free plane across the face bounds a side of the rectangle, strip deep."""
    axis, high = divmod(side, 2)
    outward = (1.0 if high else -1.0) * frame.axes[axis]
    along = np.cross(-frame.normal, outward)
    corner = np.array(rectangle.origin) + high * np.eye(2)[axis] * rectangle.lengths
    other = frame.axes[1 - axis]
    if along @ other < 0.0:  # the strip is to run from 0 to the length of the side
        corner = corner + np.eye(2)[1 - axis] * rectangle.lengths
    axes = np.stack([along, -frame.normal, outward])
    plane = FaceFrame(origin=frame.in_space(corner), axes=axes)
    level = np.abs(plane.height(free.points.reshape(-1, 3))).reshape(free.weights.shape)
    flat = (level.max(axis=1, initial=0.0) < slack) & np.all(
        free.normals @ outward > 1.0 - FLAT_IN_FILES, axis=1
    )
    chosen = contact_sides(body, free.among(flat), plane)
    length = rectangle.lengths[1 - axis]
    area = _area_in(body, chosen, PatchGrid(grid=(1, 1), lengths=(length, strip)))
    return area > (1.0 - FLAT_IN_FILES) * length * strip


def contact_sides(body: ElasticBody, outer: OuterFacets, frame: FaceFrame) -> ContactFacets:
    """Return outer facets in a plane as facets of that plane."""
    mesh = body.space.mesh
    mesh.topology.create_connectivity(3, 2)
    table = mesh.topology.connectivity(3, 2)
    facets = table.array[table.offsets[outer.cell] + outer.side]
    return contact_facets(mesh, facets.astype(np.int32), frame)


def _material_under(body: ElasticBody, facets: ContactFacets, rectangle: PatchGrid) -> Material:
    """Return the one material of the cells under the rectangle."""
    materials = body.materials_of(LoadedFace(body, facets, rectangle, degree=1).quadrature.cell)
    if len(materials) != 1:
        raise InputError(
            "the surface's rectangle lies on several materials",
            value=len(materials),
            allowed="one material under the rectangle",
        )
    return materials.pop()
