"""What a user gives an interface, checked: its face in the mesh, laws, plane, friction and wear.

Faces are found by number, by name or as facets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from patchlaw.geometry import Control, Friction, PatchGrid, Regions, RigidPlane
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro.contact.face_laws import ContactLaw
from patchlaw.macro.contact.face_pair import FacesOfOneMesh
from patchlaw.macro.contact.loaded_face import LoadedFace, Mode
from patchlaw.macro.linear_solvers.node_matrices import Displacements
from patchlaw.macro.mesh.contact_face import ContactFacets, contact_facets
from patchlaw.macro.mesh.facets import facet_indices, facet_outline, on_all_ranks
from patchlaw.macro.mesh.tagged import (
    FLAT_IN_FILES,
    TaggedMesh,
    bounding_box,
    named_groups,
    planar_face,
)
from patchlaw.support import Array, InputError, Locals, located, together

Facets = int | str | Sequence[int] | Sequence[bool] | NDArray[Any]
"""A face by number, by name, or as this rank's facets or a mask of them."""

_BY_FACETS = "given by its facets"


class MarkedFaces(NamedTuple):
    """The faces of a mesh, by number, by name or as their facets.

    Attributes:
        displacements: The displacements of the mesh.
        tags: The mesh's facet tags; or what dolfinx read from a file, or a `TaggedMesh`, that has
            ``facet_tags`` and names. None where the facets themselves are given.
        names: Numbers of the named faces, where the tags know none.
    """

    displacements: Displacements
    tags: Any
    names: Mapping[str, Any] | None

    @property
    def mesh(self) -> Any:
        """The mesh."""
        return self.displacements.space.mesh

    def _on(self, facets: Any, frame: FaceFrame, *, opposed: bool = False) -> ContactFacets:
        turned = self.displacements.axisymmetric
        return contact_facets(self.mesh, facets, frame, opposed=opposed, axisymmetric=turned)

    def with_laws(
        self,
        tag: Facets | None,
        laws: Any,
        opposite: Facets | None,
        mode: Mode | None,
        patches: PatchGrid | None,
        frame: FaceFrame | None,
    ) -> tuple[LoadedFace | FacesOfOneMesh, tuple[ContactLaw, ...], Mode, Any]:
        """Return the contact face that a tag, or zones, choose, with its laws.

        Args:
            tag: Number or name of the face, or this rank's facets, shape (n,), of which a rank may
                have none, or a mask of all facets that it has; None where laws are given by zone.
            laws: The laws, see `laws_on_face`; by zone as `laws_by_zone` returns them.
            opposite: The face opposite to it, if there is one.
            mode: Where laws are evaluated; None: the default of such laws.
            patches: Patches on the face.
            frame: Coordinates on the face; None: those of `FaceFrame.through`.

        Returns:
            The face with its patches, or both faces; a law for every patch; where they are
            evaluated; and facet tags whose marker 1 stands for the face.

        Raises:
            InputError: On all ranks, when face, frame or laws do not fit, or a facet is in two
                zones.

        Note:
            Collective.
        """
        mesh, displacements = self.mesh, self.displacements
        if tag is None:
            parts = [self.find(zone, "laws")[0] for zone in laws]
            facets, times = np.unique(np.concatenate(parts), return_counts=True)
            if mesh.comm.allreduce(bool((times > 1).any()), max):
                raise InputError("zones that share facets", key="laws", value=list(laws))
            face, marked, lower, lengths = self._placed(facets, _BY_FACETS, frame)
            zones = [self._on(one, face.frame) for one in parts]
            corner = float(lower[0]), float(lower[1])
            loaded = LoadedFace.of_regions(displacements, zones, lengths, corner)
            chosen, mode = tuple(laws.values()), mode or "pointwise"
        else:
            facets, name = self.find(tag)
            face, marked, lower, lengths = self._placed(facets, name, frame)
            given = laws, patches, mode, lengths, lower
            chosen, grid, mode = laws_on_face(*given, on_edges=mesh.topology.dim == 2)
            shift = np.zeros(2)
            if patches is None:  # those of a table lie in the middle of the face
                shift = lower + 0.5 * np.asarray(lengths) - grid.middle
            if frame is None and np.abs(shift).max() >= 1e-12 * max(lengths):
                face = face.moved(*np.where(np.abs(shift) < 1e-12 * max(lengths), 0.0, shift))
            loaded = LoadedFace(displacements, face, grid)
        if opposite is None:
            return loaded, chosen, mode, marked
        if tag is None and mode == "patchwise":
            raise InputError("laws by zone hold at points between two faces", key="mode")
        other = self._opposite(opposite, loaded.facets.frame)
        pair = FacesOfOneMesh(loaded, replace(loaded, facets=other))
        pair.check_common()
        return pair, chosen, mode, marked

    def find(self, tag: Facets, key: str = "tag") -> tuple[Locals, str]:
        """Return this rank's facets of a face, also those that other ranks give, and its name.

        Args:
            tag: Number or name of the face, or facets.
            key: What an error calls the face.

        Raises:
            InputError: On all ranks, when there is no such face.
        """
        mesh, tags = self.mesh, self.tags
        mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
        if isinstance(tag, np.ndarray | np.generic) and not tag.ndim:
            tag = tag.item()  # a number, not the facet with this number
        with located(key=key):
            if isinstance(tag, str | int) and not isinstance(tag, bool):
                if tags is None:
                    raise InputError("names a face without facet tags", value=tag, allowed="facets")
                tagged, name = _tagged(mesh, tags, self.names), str(tag)
                together(mesh.comm, lambda: _refuse_two_groups(tagged))
                given = np.asarray(tagged.facet_tags.find(tagged.facet_tag(tag)))
                if not mesh.comm.allreduce(len(given)):
                    raise InputError(
                        f"the surface {name!r} has no facets that belong to cells",
                        allowed="a surface with facets; of one in two groups of gmsh dolfinx keeps "
                        "the smaller number, which read_mesh refuses",
                    )
            else:
                given = together(mesh.comm, lambda: facet_indices(mesh, tag))
                name = _BY_FACETS
        return on_all_ranks(mesh, given), name

    def _placed(
        self, facets: Locals, name: str, frame: FaceFrame | None
    ) -> tuple[ContactFacets, Any, Array, tuple[float, float]]:
        """Return facets in the frame of their face, and its bounding rectangle there.

        Returns:
            The facets, the tags that mark them, the lower corner of the rectangle, shape (2,), and
            its sides [mm].
        """
        mesh, marked = self.mesh, _marked(self.mesh, facets)
        plane = planar_face(TaggedMesh(mesh=mesh, facet_tags=marked), 1, name=name)
        if frame is None:
            return self._on(facets, plane.frame), marked, np.zeros(2), plane.lengths
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
        placed = self._on(facets, frame)
        corner, other = bounding_box(facet_outline(placed.corners), mesh.comm)
        return placed, marked, corner, (float(other[0] - corner[0]), float(other[1] - corner[1]))

    def _opposite(self, tag: Facets, frame: FaceFrame) -> ContactFacets:
        """Return this rank's facets of the face that lies opposite to another one of the mesh.

        Args:
            tag: The face.
            frame: Frame of the other face.

        Raises:
            InputError: When it is no face, or not parallel and opposite.
        """
        facets, name = self.find(tag, "opposite")
        tagged = TaggedMesh(mesh=self.mesh, facet_tags=_marked(self.mesh, facets))
        with located(key="opposite"):  # no facets, some inside the body, or a curved face
            plane = planar_face(tagged, 1, name=name)
        if np.abs(frame.normal + plane.frame.normal).max() > FLAT_IN_FILES:
            raise InputError(
                "the faces are not parallel and opposite",
                key="opposite",
                value=plane.frame.normal.tolist(),
                allowed=f"a face whose outward normal is {(-frame.normal).tolist()}",
            )
        return self._on(facets, frame, opposed=True)


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


def friction_or_wear(friction: Any, wear: Any, zones: Sequence[Facets]) -> tuple[Any, Any]:
    """Return friction and coefficients of wear of the face, or lists of those of its zones.

    Raises:
        InputError: When there is not one for each of the zones.
    """
    rubs = _friction_of(of_zones(friction, zones, "friction"))
    wears = of_zones(wear, zones, "wear")
    if isinstance(wears, list) and not all(
        isinstance(one, Real) and 0.0 <= float(one) < np.inf for one in wears
    ):
        allowed = "a number >= 0 for each [mm²/N]"
        raise InputError("not every zone has one", key="wear", value=wears, allowed=allowed)
    return rubs, wears


def _friction_of(given: Any) -> Any:
    """Return friction that may be given by its coefficient, and that of zones likewise."""
    if isinstance(given, list):
        if not all(isinstance(one, Real | Friction) for one in given):
            raise InputError(
                "not every zone has one", key="friction", value=given, allowed="numbers or Friction"
            )
        return list(map(_friction_of, given))
    return Friction(coefficient=float(given)) if isinstance(given, Real) else given


def check_in_plane(indenter: RigidPlane | Control, *, turned: bool) -> None:
    """Refuse motions and loads of the plane that a plane mesh does not know.

    Raises:
        InputError: With what it knows.
    """
    given = [(0.0, 0.0) if indenter.tilt is None else indenter.tilt]
    if isinstance(indenter, Control):
        given += [indenter.moment, indenter.shear.pair if indenter.shear else (0.0, 0.0)]
    along = np.array(given)
    if along[:, 1].any():
        raise InputError(
            "the plane moves or is loaded across a plane mesh",
            key="indenter",
            value=str(indenter),
            allowed="tilt, moment and shear along x alone, such as tilt=(1e-3, 0.0)",
        )
    if turned and (indenter.tilt is None or along.any()):
        raise InputError(
            "the plane of an axisymmetric problem neither tilts nor is sheared",
            key="indenter",
            value=str(indenter),
            allowed="approach or force alone",
        )


def prescribed_by(indenter: RigidPlane | Control, middle: Array) -> Control:
    """Return what an indenter prescribes of the plane at the middle of the patches."""
    if isinstance(indenter, Control):
        return indenter
    about_middle = indenter.centre is None
    approach = indenter.approach if about_middle else float(indenter.at(*middle))
    return Control(approach=approach, tilt=indenter.tilt)


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
    known = names or getattr(tags, "facet_names", None) or named_groups(tags, mesh.topology.dim - 1)
    return TaggedMesh(
        mesh=mesh, facet_tags=getattr(tags, "facet_tags", tags), facet_names=dict(known)
    )


def _marked(mesh: Any, facets: Locals) -> Any:
    """Return facet tags whose marker 1 stands for facets, ascending."""
    return dmesh.meshtags(mesh, mesh.topology.dim - 1, facets, np.ones(len(facets), np.int32))


def laws_on_face(
    laws: Any,
    patches: PatchGrid | None,
    mode: Mode | None,
    lengths: tuple[float, float],
    lower: Array,
    *,
    on_edges: bool = False,
) -> tuple[tuple[ContactLaw, ...], PatchGrid, Mode]:
    """Return laws per patch from whatever a user gives, their patches, and where they hold.

    Args:
        laws: A table with ``patches`` and ``laws``, a law, or a law per patch.
        patches: Patches on the face; None: those of the table, or one patch on the rectangle around
            the face.
        mode: Where laws are evaluated; None: the default of such laws.
        lengths: Sides of the face's bounding rectangle [mm].
        lower: Lower corner of that rectangle, shape (2,) [mm].
        on_edges: Whether the face is a strip along the edges of a plane mesh, which patches divide
            along x alone.

    Raises:
        InputError: When these are no laws, or not as many as patches.
    """
    if not isinstance(patches, PatchGrid | None):
        raise InputError("these are no patches", value=patches, allowed="a PatchGrid")
    if not _is_law(laws) and hasattr(laws, "patches") and hasattr(laws, "laws"):
        if isinstance(laws.patches, PatchGrid):
            laws, patches = laws.laws, patches or laws.patches
        else:
            laws = _only_region(laws)
    if on_edges and patches is not None:
        patches = _strip(patches, lower, lengths)
    if _is_law(laws):
        corner = (float(lower[0]), float(lower[1]))
        patches = patches or PatchGrid(grid=(1, 1), lengths=lengths, origin=corner)
        return (laws,) * patches.count, patches, mode or "pointwise"
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
    return tuple(laws), patches, mode or "patchwise"


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
