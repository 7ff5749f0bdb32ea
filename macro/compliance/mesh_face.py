"""Compliance of a rectangle on the contact face of a meshed body, in Legendre modes.

The displacement by a mode of pressure is that of a half-space, in closed form, and a correction u:
`HalfSpaceCorrections` load the body for it. The correction is smooth, so that the user's mesh
resolves it. Where the body rises above the plane of its face the half-space ends there; then the
modes load the mesh itself, and their displacements are as good as the mesh under them.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from geometry.face_frame import FaceFrame
from geometry.materials import Material
from geometry.patches import PatchGrid
from macro import compat
from macro.bodies import MeshedBody
from macro.compliance.face_compliance import FaceCompliance, stresses_in_face
from macro.compliance.half_space_corrections import HalfSpaceCorrections, HalfSpaceFields
from macro.compliance.surroundings import FaceMoments
from macro.elastic_body import ElasticBody
from macro.linear_solvers.options import PREFIX
from macro.linear_solvers.selection import FACTORISED
from macro.linear_solvers.solvers import solve_linear, solved_at_once
from macro.mesh.contact_face import ContactFacets
from support.arrays import Array
from support.errors import InputError

MOST_DOFS = 500_000
"""Degrees of freedom up to which linear elements are raised to quadratic ones."""


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
    )


def raised(body: MeshedBody) -> MeshedBody:
    """Return the body with quadratic elements, if it is not too large; else the body itself."""
    return replace(body, order=2) if body.degree == 1 and 8 * body.dofs <= MOST_DOFS else body


def mesh_face_compliance(
    body: ElasticBody,
    facets: ContactFacets,
    rectangle: PatchGrid,
    material: Material,
    count: int,
    fields: HalfSpaceFields | None,
) -> FaceCompliance:
    """Solve for the response of a rectangle on a body's face to every mode of pressure.

    Args:
        body: The body.
        facets: Facets of its contact face, in its frame.
        rectangle: The rectangle as one patch, in that frame.
        material: Elastic constants under the rectangle.
        count: Modes K along a side of the rectangle.
        fields: The half-space of that material under the modes, where the body lies on one side of
            the plane of its face; None to load the mesh by the modes themselves.

    Returns:
        The compliance, the same on every rank.

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective. One solve for each of the K² modes.
    """
    if count < 1 or (fields is not None and fields.count != count):
        raise InputError("a face has one mode at least", value=count, allowed="K ≥ 1")
    moments = FaceMoments(body, facets, rectangle, count)
    loads: Sequence[_Load] = [_Tractions(moments, 2)]
    if fields is not None:
        loads = [HalfSpaceCorrections(body, facets, rectangle, material, fields)]
    responses = np.zeros((4, count**2, count**2))
    for _, mode, displacement in _displacements(body, loads, count**2):
        responses[:, :, mode] = moments.of(displacement)
    area = float(np.prod(rectangle.lengths))
    # per unit moment: a mode has the moment A, and its own displacements' moments are over A
    return _gathered(responses / area, area, material, fields)


def mesh_face_tractions(
    body: ElasticBody,
    facets: ContactFacets,
    rectangle: PatchGrid,
    material: Material,
    count: int,
    fields: Sequence[HalfSpaceFields] | None,
) -> Array:
    """Solve for the displacements of a rectangle on a body's face by every mode of traction.

    Args:
        body: The body.
        facets: Facets of its contact face, in its frame.
        rectangle: The rectangle as one patch, in that frame.
        material: Elastic constants under the rectangle.
        count: Modes K along a side of the rectangle.
        fields: The half-space of that material under modes along x, along y and downwards; None to
            load the mesh by the modes themselves, see `mesh_face_compliance`.

    Returns:
        Displacements along x, along y and downwards by tractions likewise, in modes: symmetric,
        shape (3, 3, K², K²) [mm/N]; the same on every rank.

    Raises:
        NotConverged: When a linear solve fails.

    Note:
        Collective. One solve for each of the 3 K² modes.
    """
    moments = FaceMoments(body, facets, rectangle, count)
    loads: Sequence[_Load] = [_Tractions(moments, axis) for axis in range(3)]
    if fields is not None:
        loads = [HalfSpaceCorrections(body, facets, rectangle, material, field) for field in fields]
    total = np.zeros((3, 3, count**2, count**2))
    for axis, mode, displacement in _displacements(body, loads, count**2):
        total[:, axis, :, mode] = moments.displacements(displacement)
    total /= float(np.prod(rectangle.lengths))
    if fields is not None:
        total += np.stack([field.displacement_modes() for field in fields], axis=1)
    return np.asarray(0.5 * (total + total.transpose(1, 0, 3, 2)))


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


def _displacements(
    body: ElasticBody, loads: Sequence[_Load], count: int
) -> Iterator[tuple[int, int, Any]]:
    """Yield the number of a load, that of a mode, and the displacements by it as a function.

    Args:
        body: The body.
        loads: The loads.
        count: Modes of each.
    """

    def load(number: int) -> Array:
        return loads[number // count].load(number % count)

    for number, values in _solutions(body, load, len(loads) * count):
        which, mode = divmod(number, count)
        displacement = body.function(values)
        displacement.x.array[:] += loads[which].prescribed(mode)
        yield which, mode, displacement


def _solutions(
    body: ElasticBody, forces: Callable[[int], Array], count: int
) -> Iterator[tuple[int, Array]]:
    """Yield the numbers of loads and this rank's owned displacements by them."""
    free, (load, solution) = body.free.array_r.copy(), body.stiffness.createVecs()
    if body.dofs <= FACTORISED and not PETSc.Options(PREFIX).hasName("pc_type"):
        right = np.stack([free * forces(number) for number in range(count)], axis=1)
        yield from enumerate(solved_at_once(body.stiffness, right).T)
        return
    for number in range(count):
        load.array[:] = free * forces(number)
        solve_linear(body.solver, load, solution)
        yield number, solution.array_r
        compat.collect_garbage(solution.comm)
