"""A contact face on other elements, with another quadrature or on fewer cells, and its edges.

Contacts there, and pressures at the edges, tell the errors of a contact on the face.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem
from scipy.spatial import cKDTree

from patchlaw.geometry import BlockShape
from patchlaw.macro import compat
from patchlaw.macro.bodies import Block, MeshedBody
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium
from patchlaw.macro.contact.face_laws import Sampling
from patchlaw.macro.contact.face_pair import FacePair
from patchlaw.macro.contact.law_problem import LawContactProblem
from patchlaw.macro.contact.loaded_face import ContactFace, LoadedFace, Outline
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.mesh.block import block_mesh
from patchlaw.macro.mesh.contact_face import ContactFacets, contact_facets, top_facets
from patchlaw.macro.mesh.facets import facet_nodes, facets_of_cells
from patchlaw.macro.mesh.from_file import refined
from patchlaw.support import Array, Locals

_GUESSED = 1e-4
"""Relative residual of displacements that Newton's method starts from."""
ChooseBody = Callable[[ElasticBody], ElasticBody]
"""Returns a body on the same mesh, with displacements of any degree."""


def bodies_of(face: ContactFace) -> list[ElasticBody]:
    """Return the body under a face, or both."""
    return [one.body for one in face.sides]


def quadratic_dofs(body: ElasticBody) -> int:
    """Return the degrees of freedom that quadratic displacements have, or would have.

    Args:
        body: The body.

    Note:
        Collective. Tetrahedra have a node on every edge; hexahedra on faces and in cells, too.
    """
    if body.degree == 2:
        return body.dofs
    topology, count = body.mesh.mesh.topology, body.dofs // 3
    for dimension in (1, 2, 3) if body.hexahedral else (1,):
        topology.create_entities(dimension)
        count += int(topology.index_map(dimension).size_global)
    return 3 * count


def face_on(face: ContactFace, choose: ChooseBody, finer: bool = False) -> ContactFace:
    """Return the face on other elements.

    Args:
        face: The contact face of a body, or of two.
        choose: Returns the bodies with these elements.
        finer: Whether the quadrature is exact for polynomials of more than twice the degree that
            it is now.

    Note:
        Collective.
    """
    first, *second = (_one_on(one, choose, finer) for one in face.sides)
    return FacePair(first, *second) if second else first


def _one_on(face: LoadedFace, choose: ChooseBody, finer: bool) -> LoadedFace:
    degree = face.quadrature_degree
    return replace(face, body=choose(face.body), degree=2 * degree + 2 if finer else degree)


def face_on_half(face: ContactFace) -> LoadedFace | None:
    """Return the face of a block with half as many cells along every side; None where it has few.

    Args:
        face: The contact face; None comes back for bodies on meshes of their own.

    Note:
        Collective.
    """
    if not isinstance(face, LoadedFace) or not isinstance(face.body, Block):
        return None
    block, patches = face.body, face.patches
    shape = block.mesh.shape
    if not isinstance(shape, BlockShape) or not isinstance(patches, Outline):
        return None
    if min(shape.cells) < 4:
        return None
    x, y, z = (count // 2 for count in shape.cells)
    mesh = block_mesh(replace(shape, cells=(x, y, z)), block.comm)
    half = Block(mesh, block.material, block.sides)
    coarse = LoadedFace.of_regions(half, (top_facets(mesh),), patches.lengths)
    return replace(coarse, degree=face.quadrature_degree)


def refined_face(face: ContactFace) -> ContactFace | None:
    """Return the face on quadratic elements, every cell cut into eight; None where it is not cut.

    Args:
        face: The contact face; None comes back for blocks, and where a body has curved cells.

    Note:
        Collective.
    """
    if not all(_can_be_refined(one) for one in face.sides):
        return None
    first, *second = (_one_refined(one) for one in face.sides)
    return FacePair(first, *second) if second else first


def _can_be_refined(face: LoadedFace) -> bool:
    body, patches = face.body, face.patches
    on_mesh = isinstance(body, MeshedBody) and isinstance(patches, Outline)
    return on_mesh and compat.geometry_degree(body.mesh.mesh) == 1


def _one_refined(face: LoadedFace) -> LoadedFace:
    patches = face.patches
    assert isinstance(patches, Outline)
    of_facet = _tags_of(face.body, face.facets)
    own = dict(zip(patches.region.tolist(), of_facet.tolist(), strict=True))
    tag_of = {region: tag for part in face.comm.allgather(own) for region, tag in part.items()}
    tags = [tag_of[region] for region in range(patches.count)]
    body, parts = _cut(face.body, face.facets, tags)
    return LoadedFace.of_regions(body, parts, patches.lengths)


def refined_body(
    body: MeshedBody, facets: ContactFacets
) -> tuple[MeshedBody, ContactFacets] | None:
    """Return a body on quadratic elements, every cell cut into eight, with facets of it.

    Args:
        body: The body; None comes back where it has curved cells.
        facets: Facets of its contact face, all those with some markers.

    Note:
        Collective.
    """
    if compat.geometry_degree(body.mesh.mesh) != 1:
        return None
    tags = body.comm.allgather(set(_tags_of(body, facets).tolist()))
    cut, (first, *others) = _cut(body, facets, sorted(set().union(*tags)))
    return cut, first.joined(others)


def _cut(
    body: MeshedBody, facets: ContactFacets, tags: Sequence[int]
) -> tuple[MeshedBody, list[ContactFacets]]:
    """Return a body with its cells cut into eight, and its facets by marker."""
    opposed, mesh = bool(facets.outward @ facets.frame.normal < 0.0), refined(body.mesh)
    parts = [
        contact_facets(mesh.mesh, mesh.facet_tags.find(tag), facets.frame, opposed=opposed)
        for tag in tags
    ]
    return replace(body, mesh=mesh, order=2), parts


def _tags_of(body: MeshedBody, facets: ContactFacets) -> Locals:
    """Return the markers of facets of this rank, shape (n,)."""
    tags, of_cells = body.mesh.facet_tags, facets_of_cells(body.mesh.mesh)
    place = np.searchsorted(tags.indices, of_cells[facets.cell, facets.side])
    return np.asarray(tags.values[place])


def start_from_mesh(problem: LawContactProblem, known: FaceEquilibrium, sampling: Sampling) -> None:
    """Take the displacements by pressures on another mesh for the latest solution of a problem.

    Args:
        problem: The problem.
        known: A contact on the other mesh, with some force. Pressures are those of its samples that
            are nearest.
        sampling: The samples there.

    Note:
        Collective; one linear solve.
    """
    own = np.column_stack([sampling.x, sampling.y, known.sample_pressure])
    there, here = np.concatenate(problem.face.comm.allgather(own)), problem.sampling
    nearest = cKDTree(there[:, :2]).query(np.column_stack([here.x, here.y]))[1]
    problem.start_from(there[nearest, 2], _GUESSED)


def carried(displacement: Array, before: ContactFace, face: ContactFace) -> Array:
    """Return displacements of the bodies of a face at the nodes of other elements.

    Args:
        displacement: This rank's owned displacements, shape (n,) [mm].
        before: The face that they are of.
        face: The face on other elements on the same meshes.

    Note:
        Collective.
    """
    parts, pairs = [], zip(bodies_of(before), bodies_of(face), strict=True)
    whole = before.body.split(displacement) if isinstance(before, FacePair) else None
    for part, (one, other) in zip(whole or [displacement], pairs, strict=True):
        parts.append(part if one is other else _carried(part, one, other))
    return np.concatenate(parts)


def _carried(displacement: Array, of: Any, to: Any) -> Array:
    """Return this rank's displacements at the nodes of other elements on the same mesh."""
    found = fem.Function(to.space)
    found.interpolate(of.function(displacement))
    return np.asarray(found.x.array[: to.owned_dofs].copy())


_SAME = 1e-6
"""Distance of two midpoints of one edge over the edge."""
_FLAT = 1e-6
"""Extent of a plane along its normal over its longest side."""
_ORDER = {3: (0, 1, 2), 4: (0, 1, 3, 2)}  # vertices of a square are numbered row by row


class FaceEdges(NamedTuple):
    """Edges that bound a face, on every rank.

    Attributes:
        middle: Their midpoints in the plane, shape (n, 2) [mm].
        length: Their lengths, shape (n,) [mm].
    """

    middle: Array
    length: Array


def free_edges(body: Any, facets: ContactFacets) -> FaceEdges:
    """Return the edges that only one facet of a contact face has, but those on planes of symmetry.

    Args:
        body: The body, whose supports tell planes of symmetry.
        facets: This rank's facets; there may be none.

    Note:
        Collective.
    """
    middle, length = _edges(facets.vertices, body.comm)
    near = cKDTree(middle).query_ball_point(middle, _SAME * length, return_length=True)
    free = near == 1
    for corners in _planes_of_symmetry(body, facets.frame.normal):
        mirrored, _ = _edges(facets.frame.in_plane(corners), body.comm)
        free &= cKDTree(mirrored).query(middle)[0] > _SAME * length
    return FaceEdges(middle[free], length[free])


def _edges(vertices: Array, comm: Any) -> tuple[Array, Array]:
    """Return midpoints and lengths of the edges of all ranks' facets, of shared ones twice."""
    start = vertices[:, list(_ORDER[vertices.shape[1]])]
    end = np.roll(start, -1, axis=1)
    middle = 0.5 * (start + end).reshape(-1, 2)
    length = np.linalg.norm(end - start, axis=2).ravel()
    parts = comm.allgather((middle, length))
    middle, length = (np.concatenate([part[i] for part in parts]) for i in range(2))
    return middle, length


def _planes_of_symmetry(body: Any, normal: Array) -> Iterator[Array]:
    """Yield this rank's facets of the planes that a face is mirrored in, (n, 3 or 4, 3) [mm].

    Supports hold them along their normal alone, which lies in the face.

    Args:
        body: The body.
        normal: Normal of the face, shape (3,).
    """
    tagged = body.mesh
    for support in getattr(body, "supports", ()):
        held = [axis for axis, value in enumerate(support.displacement) if value is not None]
        if len(held) != 1 or abs(normal[held[0]]) > _FLAT:
            continue
        nodes = facet_nodes(tagged.mesh, tagged.facet_tags.find(support.tag))
        corners = tagged.mesh.geometry.x[nodes.corners]
        parts = np.concatenate(body.comm.allgather(corners.reshape(-1, 3)))
        extent = np.ptp(parts, axis=0)
        if extent[held[0]] <= _FLAT * extent.max():
            yield corners


def nearest_samples(edges: FaceEdges, x: Array, y: Array, comm: Any) -> list[tuple[Array, float]]:
    """Return this rank's samples that are nearest to every edge.

    Args:
        edges: The edges.
        x: Abscissae of this rank's samples, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        comm: MPI communicator of the mesh.

    Returns:
        For every edge the indices of this rank's samples, and the share of each: 1 over the number
        of samples on all ranks that are as near.

    Note:
        Collective.
    """
    tree, count = cKDTree(np.column_stack([x, y])), len(edges.length)
    own = tree.query(edges.middle)[0] if len(x) else np.full(count, np.inf)
    distance = np.min(comm.allgather(own), axis=0) * (1.0 + _SAME)
    found = tree.query_ball_point(edges.middle, distance) if len(x) else [[]] * count
    number = np.sum(comm.allgather([len(indices) for indices in found]), axis=0)
    return [
        (np.array(indices, np.intp), 1.0 / total)
        for indices, total in zip(found, number, strict=True)
    ]
