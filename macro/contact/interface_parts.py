"""The contact face in a user's own mesh: found by number, by name or as facets, and checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.geometry.patches import PatchGrid, Regions
from patchlaw.macro.contact.displacements import Displacements
from patchlaw.macro.contact.loaded_face import Mode, Outline
from patchlaw.macro.contact.pressed_plane import ContactLaw
from patchlaw.macro.mesh.contact_face import ContactFacets, contact_facets
from patchlaw.macro.mesh.facets import facet_indices, facet_outline
from patchlaw.macro.mesh.tagged import FLAT_IN_FILES, TaggedMesh, bounding_box, planar_face
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import together

Facets = int | str | Sequence[int] | Sequence[bool] | NDArray[Any]
"""A face by number, by name, or as this rank's facets or a mask of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenFace:
    """A planar contact face in its frame.

    Args:
        facets: This rank's facets of it.
        marked: Facet tags whose marker 1 stands for the face.
        lower: Lower corner of its bounding rectangle in the frame, shape (2,) [mm].
        lengths: Sides of that rectangle [mm].
    """

    facets: ContactFacets
    marked: Any
    lower: Array
    lengths: tuple[float, float]


def chosen_face(
    displacements: Displacements,
    tags: Any,
    tag: Facets,
    names: Mapping[str, Any] | None = None,
    frame: FaceFrame | None = None,
) -> ChosenFace:
    """Return the contact face that tags and a tag choose.

    Args:
        displacements: The displacements.
        tags: The mesh's facet tags; or what dolfinx read from a file, or a `TaggedMesh`, that has
            ``facet_tags`` and names. None where the facets themselves are given.
        tag: Number or name of the face, or this rank's facets, shape (n,), of which a rank may
            have none, or a mask of all facets that it has.
        names: Numbers of the named faces, where the tags know none.
        frame: Coordinates on the face; None: those of `FaceFrame.through`.

    Raises:
        InputError: On all ranks, when the face or the frame does not fit.

    Note:
        Collective.
    """
    mesh, turned = displacements.space.mesh, displacements.axisymmetric
    facets, name = given_facets(mesh, tags, tag, names)
    marked = _marked(mesh, facets)
    plane = planar_face(TaggedMesh(mesh=mesh, facet_tags=marked), 1, name=name)
    if frame is None:
        placed = contact_facets(mesh, facets, plane.frame, axisymmetric=turned)
        return ChosenFace(facets=placed, marked=marked, lower=np.zeros(2), lengths=plane.lengths)
    if np.abs(frame.normal - plane.frame.normal).max() > FLAT_IN_FILES:
        raise InputError(
            "the frame's normal is not that of the face",
            value=frame.normal.tolist(),
            allowed=f"{plane.frame.normal.tolist()}, out of the body",
        )
    if mesh.topology.dim == 2 and abs(frame.axes[0, 2]) > FLAT_IN_FILES:
        raise InputError(
            "the frame's first axis is not along the edges of a plane mesh",
            key="frame",
            value=frame.axes[0].tolist(),
            allowed="a first axis in its plane",
        )
    placed = contact_facets(mesh, facets, frame, axisymmetric=turned)
    corner, other = bounding_box(facet_outline(placed.corners), mesh.comm)
    lengths = (float(other[0] - corner[0]), float(other[1] - corner[1]))
    return ChosenFace(facets=placed, marked=marked, lower=corner, lengths=lengths)


def chosen_zones(
    displacements: Displacements,
    tags: Any,
    zones: Sequence[Facets],
    names: Mapping[str, Any] | None = None,
    frame: FaceFrame | None = None,
) -> tuple[ChosenFace, list[ContactFacets]]:
    """Return the contact face that zones make up, and the facets of each.

    Args:
        displacements: As for `chosen_face`, as all others.
        tags: The facet tags.
        zones: Numbers or names of the zones.
        names: Numbers of the named faces.
        frame: Coordinates on the face.

    Raises:
        InputError: Also when a facet is in two zones.
    """
    mesh, turned = displacements.space.mesh, displacements.axisymmetric
    parts = [given_facets(mesh, tags, zone, names, key="laws")[0] for zone in zones]
    whole, times = np.unique(np.concatenate(parts), return_counts=True)
    if mesh.comm.allreduce(bool((times > 1).any()), max):
        raise InputError("zones that share facets", key="laws", value=list(zones))
    face = chosen_face(displacements, None, whole, None, frame)
    frame = face.facets.frame
    return face, [contact_facets(mesh, part, frame, axisymmetric=turned) for part in parts]


def opposite_facets(
    displacements: Displacements,
    tags: Any,
    tag: Facets,
    names: Mapping[str, Any] | None,
    frame: FaceFrame,
) -> ContactFacets:
    """Return this rank's facets of the face that lies opposite to another one of the mesh.

    Args:
        displacements: As for `chosen_face`, as the next three.
        tags: The facet tags.
        tag: The face.
        names: Numbers of the named faces.
        frame: Frame of the other face.

    Raises:
        InputError: When it is no face, or not parallel and opposite.
    """
    mesh = displacements.space.mesh
    facets, name = given_facets(mesh, tags, tag, names, key="opposite")
    tagged = TaggedMesh(mesh=mesh, facet_tags=_marked(mesh, facets))
    try:
        plane = planar_face(tagged, 1, name=name)
    except InputError as error:  # of no facets, of such inside the body, of a face that is curved
        raise error.located(key="opposite") from None
    if np.abs(frame.normal + plane.frame.normal).max() > FLAT_IN_FILES:
        raise InputError(
            "the faces are not parallel and opposite",
            key="opposite",
            value=plane.frame.normal.tolist(),
            allowed=f"a face whose outward normal is {(-frame.normal).tolist()}",
        )
    turned = displacements.axisymmetric
    return contact_facets(mesh, facets, frame, opposed=True, axisymmetric=turned)


def of_zones(given: Any, zones: Sequence[Facets], key: str) -> Any:
    """Return what is given for every zone by its name, in their order; or one thing for all.

    Raises:
        InputError: When it is not given for each of the zones.
    """
    if not isinstance(given, Mapping):
        return given
    if not zones or set(given) != set(zones):
        raise InputError(
            "something else than one for each zone of the laws",
            key=key,
            value=list(given),
            allowed=", ".join(map(str, zones)) or "laws by zone",
        )
    return [given[zone] for zone in zones]


def given_facets(
    mesh: Any,
    tags: Any,
    tag: Facets,
    names: Mapping[str, Any] | None = None,
    key: str = "tag",
) -> tuple[NDArray[np.int32], str]:
    """Return this rank's facets of a face, also those that other ranks give, and its name.

    Args:
        mesh: The mesh.
        tags: As for `chosen_face`, as all others.
        tag: Number or name of the face, or facets.
        names: Numbers of the named faces.
        key: What an error calls the face.

    Raises:
        InputError: On all ranks, when there is no such face.
    """
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    if isinstance(tag, np.ndarray | np.generic) and not tag.ndim:
        tag = tag.item()  # a number, not the facet with this number
    try:
        if isinstance(tag, str | int) and not isinstance(tag, bool):
            if tags is None:
                raise InputError("names a face without facet tags", value=tag, allowed="facets")
            tagged, name = _tagged(mesh, tags, names), str(tag)
            together(mesh.comm, lambda: _refuse_two_groups(tagged))
            given = np.asarray(tagged.facet_tags.find(tagged.facet_tag(tag)))
            if not mesh.comm.allreduce(len(given)):
                raise InputError(
                    f"the surface {name!r} has no facets that belong to cells",
                    allowed="a surface with facets; of one in two groups of gmsh dolfinx keeps the "
                    "smaller number, which read_mesh refuses",
                )
        else:
            given = together(mesh.comm, lambda: facet_indices(mesh, tag))
            name = "given by its facets"
    except InputError as error:
        raise error.located(key=key) from None
    return _on_all_ranks(mesh, given), name


def _refuse_two_groups(tagged: TaggedMesh) -> None:
    """Refuse facets that have several tags."""
    tags = tagged.facet_tags
    order = np.argsort(tags.indices, kind="stable")
    indices, values = np.asarray(tags.indices)[order], np.asarray(tags.values)[order]
    again = np.flatnonzero((indices[1:] == indices[:-1]) & (values[1:] != values[:-1]))
    if len(again):
        pair = sorted({int(values[again[0]]), int(values[again[0] + 1])})
        named = " and ".join(repr(tagged.facet_name(one)) for one in pair)
        raise InputError(
            f"{len(again)} facets of the mesh are in two groups, as in {named}",
            allowed="at most one group for a facet",
        )


def _tagged(mesh: Any, tags: Any, names: Mapping[str, Any] | None) -> TaggedMesh:
    """Return tags with the names that they know, or are given."""
    known = names or getattr(tags, "facet_names", None) or _groups(tags, mesh.topology.dim - 1)
    return TaggedMesh(
        mesh=mesh, facet_tags=getattr(tags, "facet_tags", tags), facet_names=dict(known)
    )


def _groups(tags: Any, dimension: int) -> dict[str, int]:
    """Return the names of a body's sides in what the newest dolfinx reads from gmsh."""
    groups = getattr(tags, "physical_groups", None) or {}
    return {name: int(group.tag) for name, group in groups.items() if int(group.dim) == dimension}


def _marked(mesh: Any, facets: NDArray[np.int32]) -> Any:
    """Return facet tags whose marker 1 stands for facets, ascending."""
    return dmesh.meshtags(mesh, mesh.topology.dim - 1, facets, np.ones(len(facets), np.int32))


def _on_all_ranks(mesh: Any, facets: NDArray[Any]) -> NDArray[np.int32]:
    """Return this rank's facets among those that any rank gives, ascending.

    Whoever marks a facet may not have its cell.
    """
    numbers = mesh.topology.index_map(mesh.topology.dim - 1)
    chosen = mesh.comm.allgather(numbers.local_to_global(facets.astype(np.int32)))
    local = np.arange(numbers.size_local + numbers.num_ghosts, dtype=np.int32)
    return local[np.isin(numbers.local_to_global(local), np.concatenate(chosen))]


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceLaws:
    """Laws of patches on a face.

    Args:
        laws: One law per patch.
        patches: The patches.
        mode: Where the laws are evaluated.
        shift: Where the patches' coordinates begin in those of the face, shape (2,) [mm].
    """

    laws: tuple[ContactLaw, ...]
    patches: PatchGrid | Outline
    mode: Mode
    shift: Array


def laws_on_face(
    laws: Any,
    patches: PatchGrid | None,
    mode: Mode | None,
    lower: Array,
    lengths: tuple[float, float],
    *,
    on_edges: bool = False,
) -> InterfaceLaws:
    """Return laws per patch from whatever a user gives.

    Args:
        laws: A table with ``patches`` and ``laws``, a law, or a law per patch.
        patches: Patches on the face; None: those of the table in the middle of the face, or one
            patch on its bounding rectangle.
        mode: Where laws are evaluated; None: the default of such laws.
        lower: Lower corner of the face's bounding rectangle, shape (2,) [mm].
        lengths: Sides of that rectangle [mm].
        on_edges: Whether the face is a strip along the edges of a plane mesh, which patches divide
            along x alone.

    Raises:
        InputError: When these are no laws, or not as many as patches.
    """
    if not isinstance(patches, PatchGrid | None):
        raise InputError("these are no patches", value=patches, allowed="a PatchGrid")
    shift = np.zeros(2)
    if on_edges and patches is not None:
        patches = _strip(patches, lower, lengths)
    if _is_law(laws):
        corner = (float(lower[0]), float(lower[1]))
        patches = patches or PatchGrid(grid=(1, 1), lengths=lengths, origin=corner)
        return InterfaceLaws(
            laws=(laws,) * patches.count, patches=patches, mode=mode or "pointwise", shift=shift
        )
    if hasattr(laws, "patches") and hasattr(laws, "laws"):
        if not isinstance(laws.patches, PatchGrid):
            only = _only_region(laws)
            return laws_on_face(only, patches, mode, lower, lengths, on_edges=on_edges)
        if patches is None:
            patches = _strip(laws.patches, lower, lengths) if on_edges else laws.patches
            shift = lower + 0.5 * np.asarray(lengths) - patches.middle
            shift[np.abs(shift) < 1e-12 * max(lengths)] = 0.0
        laws = laws.laws
    if not isinstance(laws, Sequence) or not laws or not all(map(_is_law, laws)):
        raise InputError(
            "the interface has no laws",
            value=laws,
            allowed="a law table, a law with pressure() and stiffness(), or a list of such laws",
        )
    if patches is None:
        raise InputError("laws of patches need the patches", key="patches", allowed="a PatchGrid")
    if len(laws) != patches.count:
        raise InputError("every patch needs a law", value=len(laws), allowed=f"{patches.count}")
    return InterfaceLaws(laws=tuple(laws), patches=patches, mode=mode or "patchwise", shift=shift)


def _strip(patches: PatchGrid, lower: Array, lengths: tuple[float, float]) -> PatchGrid:
    """Return patches as wide as the strip that edges stand for.

    Raises:
        InputError: When they are not in one row.
    """
    if patches.grid[1] != 1:
        raise InputError(
            "patches of a plane mesh lie in one row",
            key="patches",
            value=patches.grid,
            allowed="a PatchGrid whose grid is (n, 1)",
        )
    size, corner = (patches.lengths[0], lengths[1]), (patches.origin[0], float(lower[1]))
    return PatchGrid(grid=patches.grid, lengths=size, origin=corner)


def laws_by_zone(laws: Any) -> Mapping[Any, ContactLaw]:
    """Return the laws of zones by their names, from such a mapping or a table of regions.

    Raises:
        InputError: When these are none.
    """
    if isinstance(getattr(laws, "patches", None), Regions):
        laws = dict(zip(laws.patches.names, laws.laws, strict=True))
    if not isinstance(laws, Mapping) or not laws or not all(map(_is_law, laws.values())):
        raise InputError(
            "an interface without a face",
            key="tag",
            value=None,
            allowed="a face; or laws by zone, {zone: law}, whose zones are faces",
        )
    return laws


def _only_region(table: Any) -> Any:
    """Return the law of a table of regions, which must be one: others need faces of their own."""
    if len(table.laws) != 1:
        raise InputError(
            "a table of several regions holds on no single face",
            value=len(table.laws),
            allowed="no tag, where regions are named like faces; or an Interface for the facets "
            "of each region, with that region's law of the table, such as laws=table['ring']",
        )
    return table.laws[0]


def _is_law(candidate: Any) -> bool:
    return callable(getattr(candidate, "pressure", None)) and callable(
        getattr(candidate, "stiffness", None)
    )
