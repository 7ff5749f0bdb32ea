"""A mesh of any body with marked facets and cells, its faces, and marks by arrays of the whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh

from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import compat
from patchlaw.macro.mesh.facets import (
    exterior_facets,
    facet_basis,
    facet_nodes,
    facet_outline,
    facet_places,
    facet_rule,
    facets_of_cells,
)
from patchlaw.support import Array, Counts, Flags, Indices, InputError, Locals, did_you_mean

Table = Counts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaggedMesh:
    """A body's mesh, distributed over the ranks of a communicator.

    Args:
        mesh: The dolfinx mesh, of tetrahedra or hexahedra; lengths in mm. An `Interface` takes
            plane ones too, of triangles or quadrilaterals.
        facet_tags: Tags of this rank's facets, those of ghost cells included or not.
        cell_tags: Tags of this rank's cells, ghosts included; None where nothing tells cells apart.
        facet_names: Tags of facets by name.
        cell_names: Tags of cells by name.

    Raises:
        InputError: When the mesh has other cells, or the tags are those of something else.
    """

    mesh: Any
    facet_tags: Any
    cell_tags: Any = None
    facet_names: Mapping[str, int] = field(default_factory=dict)
    cell_names: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name, dim = self.mesh.topology.cell_name(), self.mesh.topology.dim
        if dim != self.mesh.geometry.dim or name not in compat.CELLS:
            raise InputError(
                "the mesh of a body has cells that do not fit",
                value=name,
                allowed="tetrahedra or hexahedra, or those of a plane mesh",
            )
        kinds = (self.facet_tags, dim - 1, "facet"), (self.cell_tags, dim, "cell")
        for tags, dimension, what in kinds:
            if tags is not None and tags.dim != dimension:
                raise InputError(
                    f"the {what} tags mark something else",
                    value=f"dimension {tags.dim}",
                    allowed=f"tags of dimension {dimension}",
                )

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.mesh.comm

    def bounding_box(self) -> tuple[Array, Array]:
        """Return the lower and the upper corner of the box around all nodes, shapes (3,) [mm].

        Note:
            Collective.
        """
        return bounding_box(self.mesh.geometry.x, self.comm)

    def facet_name(self, tag: int) -> str:
        """Return the name of a tag of facets; its number where it has none."""
        return {number: name for name, number in self.facet_names.items()}.get(tag, str(tag))

    def facet_tag(self, wanted: str | int, *, key: str | None = None) -> int:
        """Return the tag of facets by its name or number.

        Args:
            wanted: A name, or the number of a tag.
            key: Key of the scene that the name comes from, for the error.

        Raises:
            InputError: When there is no such name; it shows the nearest one and all others.
        """
        return _tag(self.facet_names, wanted, "surface", key)

    def cell_tag(self, wanted: str | int, *, key: str | None = None) -> int:
        """Return the tag of cells by its name or number; see `facet_tag`."""
        return _tag(self.cell_names, wanted, "volume", key)


def bounding_box(points: Array, comm: Any) -> tuple[Array, Array]:
    """Return the lower and the upper corner of the box around the points of all ranks, (n,) each.

    Args:
        points: This rank's points, shape (m, n); there may be none.
        comm: MPI communicator.

    Note:
        Collective.
    """
    ends = comm.allgather((points.min(axis=0), points.max(axis=0)) if len(points) else None)
    lower, upper = (np.array([end[k] for end in ends if end is not None]) for k in (0, 1))
    return lower.min(axis=0), upper.max(axis=0)


def _tag(names: Mapping[str, int], wanted: str | int, what: str, key: str | None) -> int:
    if isinstance(wanted, str) and wanted in names:
        return names[wanted]
    tag = int(wanted) if str(wanted).strip().lstrip("-").isdecimal() else None
    if tag is not None and (tag in names.values() or not names):
        return tag
    hint = did_you_mean(str(wanted), names)
    listed = [name if name == str(number) else repr(name) for name, number in names.items()]
    more = f" and {len(listed) - 12} more" if len(listed) > 12 else ""
    raise InputError(
        f"the mesh has no {what} of this name{hint}" if names else f"the mesh has no named {what}s",
        value=wanted,
        key=key,
        allowed=", ".join(listed[:12]) + more if names else "a number",
    )


def named_groups(tags: Any, dimension: int) -> dict[str, int]:
    """Return the names of things of a dimension in what the newest dolfinx reads from gmsh."""
    groups = getattr(tags, "physical_groups", None) or {}
    return {name: int(group.tag) for name, group in groups.items() if int(group.dim) == dimension}


FLAT_IN_FILES = 1e-6
"""Part of the size of a face that is rounding in files: distance from its plane, and areas; also
the components of normals."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarFace:
    """A face of a body in the coordinates of its plane.

    Attributes:
        frame: The coordinates; the plane goes through the highest node.
        lengths: Sides of the bounding rectangle along e1 and e2 [mm].
        area: Area of the facets of all ranks [mm²].
        deviation: Half the difference of height between the highest and the lowest node [mm].
    """

    frame: FaceFrame
    lengths: tuple[float, float]
    area: float
    deviation: float


def planar_face(
    tagged: TaggedMesh,
    tag: int,
    *,
    name: str | None = None,
    deviation: float = 0.0,
    along: Sequence[float] | None = None,
    key: str | None = None,
) -> PlanarFace:
    """Return the plane of a face, of any outline, that need not hang together.

    Args:
        tagged: The mesh.
        tag: Tag of the facets.
        name: Name of the face, for errors; that of its tag by default.
        deviation: Largest distance of a node from the plane half-way between the highest and the
            lowest that is allowed [mm]: half the height of a crown. Rounding of the coordinates
            always is.
        along: Direction of the first axis of the face, see `FaceFrame.across`.
        key: Key of the scene that the name comes from, for errors.

    Raises:
        InputError: On all ranks, when the face has no facets, when facets lie inside the body, and
            when the face is curved or made of planes that face different ways.

    Note:
        Collective. The results do not depend on the ranks but for rounding.
    """
    named, comm = repr(name or tagged.facet_name(tag)), tagged.comm

    def refused(problem: str, allowed: str | None = None) -> InputError:
        return InputError(f"the surface {named} {problem}", key=key, allowed=allowed)

    check_outer(tagged, tag, name=named, key=key)
    corners, outward, _ = _facets(tagged, tag)
    areas = np.linalg.norm(outward, axis=1)
    area, total = comm.allreduce(float(areas.sum())), comm.allreduce(outward.sum(axis=0))
    if np.linalg.norm(total) < 0.5 * area:
        raise refused("is not planar: its facets face different ways and close around a body")
    frame = FaceFrame.across(total, along=along)
    lower, upper = bounding_box(facet_outline(corners) @ frame.axes.T, comm)
    upright = outward @ frame.normal / np.where(areas > 0.0, areas, 1.0)
    flattest = comm.allreduce(float(upright.min(initial=1.0)), min)
    lengths, off = upper[:2] - lower[:2], 0.5 * float(upper[2] - lower[2])
    if off > max(deviation, FLAT_IN_FILES * float(lengths.max())) or flattest <= 0.0:
        angle = np.degrees(np.arccos(np.clip(flattest, -1.0, 1.0)))
        raise refused(
            f"is not planar: its nodes are up to {off:.4g} mm off the plane through it, and its "
            f"facets up to {angle:.2g}° from it",
            f"at most {deviation:.4g} mm" if deviation else "a planar face",
        )
    return PlanarFace(
        frame=FaceFrame.through(np.stack([lower, upper]) @ frame.axes, total, along),
        lengths=(float(lengths[0]), float(lengths[1])),
        area=area,
        deviation=off,
    )


def check_outer(
    tagged: TaggedMesh, tag: int, *, name: str | None = None, why: str = "", key: str | None = None
) -> None:
    """Refuse a face that is no part of the body's outer surface.

    Args:
        tagged: The mesh.
        tag: Tag of the facets.
        name: What the error calls the face; its own name by default.
        why: What else the error says of facets inside the body.
        key: Key of the scene that the name comes from, for errors.

    Raises:
        InputError: On all ranks, when the face has no facets, or facets between two cells.

    Note:
        Collective.
    """
    named = name or repr(tagged.facet_name(tag))
    corners, _, inner = _facets(tagged, tag)
    count, inside = tagged.comm.allreduce(len(corners) + inner), tagged.comm.allreduce(inner)
    if not count:
        raise InputError(f"the surface {named} has no facets that belong to cells", key=key)
    if inside:
        raise InputError(
            f"the surface {named} has {inside} of {count} facets inside the body, between two "
            f"cells{why}",
            key=key,
            allowed="a face of the body's outer surface",
        )


def surface_area(tagged: TaggedMesh, tag: int) -> float:
    """Return the area of a body's outer surface with a tag [mm²].

    Args:
        tagged: The mesh.
        tag: Tag of the facets.

    Note:
        Collective.
    """
    nodes = _facets(tagged, tag)[0]
    areas = np.linalg.norm(_area_elements(nodes), axis=2)
    return float(tagged.comm.allreduce(float(areas.sum())))


def _area_elements(nodes: Array) -> Array:
    """Return vectors as long as the parts of facets at q quadrature points, shape (q, n, 3) [mm²].

    Args:
        nodes: Nodes of the facets, shape (n, 3, 4, 6 or 9, 3) [mm].
    """
    # their sums are exact: tangents of quadratic maps have products of degree 3 along a coordinate
    count = nodes.shape[1]
    rule, weights = facet_rule({3: 3, 6: 3, 4: 4, 9: 4}[count], 4 if count > 4 else 1)
    _, slopes = facet_basis(count, rule)
    along = np.einsum("qmk,nmi->qkni", slopes, nodes)
    return np.asarray(weights[:, None, None] * np.cross(along[:, 0], along[:, 1]))


def _facets(tagged: TaggedMesh, tag: int) -> tuple[Array, Array, int]:
    """Return this rank's outer facets of a face.

    Returns:
        Their nodes, shape (n, 3, 4, 6 or 9, 3) [mm]; outward vectors as long as their areas, shape
        (n, 3) [mm²]; the number of facets between two cells, each counted on one rank.
    """
    mesh, facets = tagged.mesh, np.asarray(tagged.facet_tags.find(tag))
    outer = np.isin(facets, exterior_facets(mesh))
    own = facets < mesh.topology.index_map(mesh.topology.dim - 1).size_local
    nodes = facet_nodes(mesh, facets[outer])
    corners = facet_places(mesh, nodes.nodes)
    middle = mesh.geometry.x[compat.cell_vertices(mesh)[nodes.cell]].mean(axis=1)
    areas = _area_elements(corners).sum(axis=0)
    away = np.einsum("ni,ni->n", areas, corners.mean(axis=1) - middle)
    inner = int((own & ~outer).sum())
    return corners, areas * np.where(away < 0.0, -1.0, 1.0)[:, None], inner


def marked_sides(tagged: TaggedMesh) -> Iterator[tuple[Indices, Indices, Locals]]:
    """Yield this rank's cells with a marked facet, one side of the reference cell after the other.

    Args:
        tagged: The mesh, of which whoever marks a facet has its cell.

    Yields:
        The corners of the side in its cell, shape (m,); cells that this rank owns and the tags of
        their facets there, shape (n,) each.
    """
    mesh, count = tagged.mesh, tagged.mesh.topology.index_map(tagged.mesh.topology.dim).size_local
    _, shapes = compat.reference_facets(mesh.topology.cell_name())
    sides = facets_of_cells(mesh)[:count]
    marked, tag_of = (np.zeros(int(sides.max(initial=-1)) + 1, kind) for kind in (bool, np.int32))
    known = np.asarray(tagged.facet_tags.indices) < len(marked)
    indices = np.asarray(tagged.facet_tags.indices)[known]
    marked[indices], tag_of[indices] = True, np.asarray(tagged.facet_tags.values)[known]
    for side, corners in enumerate(shapes):
        here = np.flatnonzero(marked[sides[:, side]])
        yield corners, here, tag_of[sides[here, side]]


def cell_tags(mesh: Any, tags: Locals) -> Any:
    """Return the tags of this rank's cells, ghosts included.

    Args:
        mesh: dolfinx mesh.
        tags: Tags of the cells that the mesh was made of, in their order, all ranks' together.
    """
    cells = np.asarray(mesh.topology.original_cell_index, dtype=np.int64)
    own = np.arange(len(cells), dtype=np.int32)
    return dmesh.meshtags(mesh, mesh.topology.dim, own, tags[cells])


def facet_tags(mesh: Any, facets: Table, tags: Locals, names: dict[str, int] | None = None) -> Any:
    """Return the tags of the facets of the cells that this rank owns; there may be none.

    Args:
        mesh: dolfinx mesh.
        facets: Marked facets of all ranks together: rows of the corners among the points that
            the mesh was made of, in any order, shape (n, 3 or 4), of a plane mesh (n, 2); negative
            for points that no cell has.
        tags: Their tags, shape (n,).
        names: Names of the tags, for errors.

    Raises:
        InputError: When a facet has two tags, or when a tag marks facets of cells and others too.

    Note:
        Collective.
    """
    name_of, dim = {tag: name for name, tag in (names or {}).items()}, mesh.topology.dim
    wanted, tags = _distinct(facets, tags, name_of)
    cell, side, row = _facets_found(mesh, wanted)
    of_cells = np.zeros(len(wanted), dtype=np.int64)
    of_cells[row] = 1
    _check_groups(mesh.comm.allreduce(of_cells) > 0, tags, name_of)
    mesh.topology.create_connectivity(dim - 1, dim)
    # two cells have an inner facet
    indices, first = np.unique(facets_of_cells(mesh)[cell, side], return_index=True)
    values = tags[row[first]].astype(np.int32)
    return dmesh.meshtags(mesh, dim - 1, indices.astype(np.int32), values)


def _distinct(facets: Table, tags: Locals, name_of: dict[int, str]) -> tuple[Table, Locals]:
    """Return every facet once, its nodes ascending."""
    rows, first, which = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_inverse=True
    )
    other = np.flatnonzero(tags != tags[first][which.ravel()])
    if len(other):
        one, two = tags[first][which.ravel()][other[0]], tags[other[0]]
        named = " and ".join(repr(name_of.get(tag, str(tag))) for tag in sorted((one, two)))
        raise InputError(
            f"{len(other)} facets of the mesh are in two groups, as in {named}",
            allowed="at most one group for a facet",
        )
    return rows, tags[first]


def _facets_found(mesh: Any, wanted: Table) -> tuple[Indices, Indices, Indices]:
    """Return the owned cells with such facets, the facet's index in its cell, and its row."""
    _, shapes = compat.reference_facets(mesh.topology.cell_name())
    points = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)
    vertices = compat.cell_vertices(mesh)[: mesh.topology.index_map(mesh.topology.dim).size_local]
    marked = np.isin(points, wanted)
    near = np.flatnonzero(marked[vertices].sum(axis=1) >= shapes.shape[1])
    own = np.sort(points[vertices[near]][:, shapes], axis=2).reshape(-1, shapes.shape[1])
    both = np.concatenate([wanted.reshape(-1, shapes.shape[1]), own])
    _, first, which = np.unique(both, axis=0, return_index=True, return_inverse=True)
    row = first[which.ravel()[len(wanted) :]]  # of its first occurrence; wanted rows come first
    hit = np.flatnonzero(row < len(wanted))
    return near[hit // len(shapes)], hit % len(shapes), row[hit]


def _check_groups(of_cells: Flags, tags: Locals, name_of: dict[int, str]) -> None:
    """Refuse tags of which some facets belong to cells and some do not."""
    for tag in np.unique(tags):
        of_tag = of_cells[tags == tag]
        if of_tag.any() and not of_tag.all():
            name = name_of.get(int(tag), str(tag))
            raise InputError(
                f"{(~of_tag).sum()} of {len(of_tag)} facets of the surface {name!r} belong to no "
                "cell; the mesh of the volume beside them may be missing"
            )
