"""Reads the bodies of a scene that come from meshes, and checks them.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from patchlaw.geometry import Material, PatchGrid
from patchlaw.geometry.face_frame import UPWARD, FaceFrame
from patchlaw.multiscale.loading.path import BodyLoads
from patchlaw.multiscale.scene.body_sections import CounterBodySection
from patchlaw.multiscale.scene.loads import body_states
from patchlaw.multiscale.scene.parts import BodyFacts
from patchlaw.multiscale.scene.scene import Scene, content_digest
from patchlaw.support import InputError, located, on_root

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import ContactFacets, Loads, MeshedBody, TaggedMesh
    from patchlaw.macro.mesh.tagged import PlanarFace


_MILLIMETRES = {"mm": 1.0, "m": 1e3, "um": 1e-3, "inch": 25.4}
_SAME_PLANE = 1e-6
"""Distance between planes, relative to the face, that is rounding of coordinates in files."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneBody:
    """A body of a scene on its mesh, on every rank.

    Attributes:
        body: The elastic body.
        facets: Facets of the contact face, by region, in `frame`.
        frame: Coordinates of the contact face. Their origin is the lower corner of the bounding
            rectangle, or of the rectangle of the surface once it is placed.
        facts: What is known of it without the mesh.
    """

    body: MeshedBody
    facets: tuple[ContactFacets, ...]
    frame: FaceFrame
    facts: BodyFacts

    def placed(self, place: tuple[float, float]) -> SceneBody:
        """Return the body with its coordinates counted from a point of the contact face.

        Args:
            place: The point in the present coordinates [mm].
        """
        facets = tuple(part.moved(*place) for part in self.facets)
        return replace(self, frame=self.frame.moved(*place), facets=facets)

    def check_covers(self, lengths: tuple[float, float]) -> None:
        """Refuse a surface that does not lie on the contact face of the placed body.

        Args:
            lengths: Sides of the surface [mm].

        Raises:
            InputError: When it does not.

        Note:
            Collective.
        """
        from patchlaw.macro import LoadedFace

        whole = PatchGrid(grid=(1, 1), lengths=lengths)
        try:
            face = LoadedFace(self.body, self.facets[0], whole)
            covered = float(face.areas[0]) / whole.area
        except InputError:  # no facet lies in it
            covered = 0.0
        if covered < 1.0 - 1e-6:  # rounding
            x, y = self.facts.lengths
            raise InputError(
                f"the surface's rectangle, {lengths[0]:g} × {lengths[1]:g} mm, does not lie on the "
                f"contact face, which covers {100.0 * covered:.3g} % of it and is {x:.6g} × "
                f"{y:.6g} mm large",
                allowed="a rectangle on the face; or law.kind = 'representative', where the "
                "surface is a sample and the face may have any size and outline",
            )


Meshes = tuple[SceneBody | None, SceneBody | None]
"""The body and the counter-body where these are meshes."""


def read_bodies(scene: Scene, comm: Any) -> Meshes:
    """Read and check the meshes of a scene's bodies.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.

    Returns:
        The body below the surface, None for a block, and the body on the other side, None where
        that is rigid or a half-space.

    Raises:
        InputError: On all ranks, when a mesh, its names, supports or contact face do not fit; names
            file and key.

    Note:
        Collective.
    """
    first = counter = None
    if scene.body is not None:
        reader = _Reader(scene, scene.body, "body", comm)
        first = reader.read([region.surface for region in scene.law.regions])
    section = scene.counter_body
    if section is not None and section.mesh is not None:
        frame = first.frame if first else UPWARD
        counter = _Reader(scene, section, "counter_body", comm).read((), opposite=frame)
    return first, counter


class BodyReader:
    """Reads the bodies of scenes; those of the latest are not read again for the next."""

    def __init__(self) -> None:
        self._sections: Any = None
        self._bodies: Meshes = None, None

    def __call__(self, scene: Scene, comm: Any) -> Meshes:
        """Return the bodies of a scene; see `read_bodies`."""
        sections = scene.body, scene.counter_body
        if self._sections != sections:
            self._bodies = None, None  # before others take memory
            self._bodies, self._sections = read_bodies(scene, comm), sections
        return self._bodies


class _Reader:
    """Reads one body of a scene."""

    def __init__(
        self,
        scene: Scene,
        section: CounterBodySection,
        key: Literal["body", "counter_body"],
        comm: Any,
    ) -> None:
        from mpi4py import MPI

        self._scene, self._section, self._key = scene, section, key
        self._comm = comm or MPI.COMM_SELF
        self._path = scene.path_of(section.mesh) or Path()

    def read(self, regions: Sequence[str | int], opposite: FaceFrame | None = None) -> SceneBody:
        """Return the body with its contact face, and further regions of it.

        Args:
            regions: Names or numbers of further faces in the plane of the contact face.
            opposite: Frame of the face of a first body, which this one lies opposite to.
        """
        with located(self._scene.file, f"{self._key}.mesh"):
            return self._read(regions, opposite)

    def _read(self, regions: Sequence[str | int], opposite: FaceFrame | None) -> SceneBody:
        from patchlaw.macro import contact_facets
        from patchlaw.macro.mesh.from_file import read_mesh, refined, size_note

        mesh = read_mesh(self._path, self._comm, unit=_MILLIMETRES[self._section.mesh_unit])
        mesh = refined(mesh, self._section.refinements, key=f"{self._key}.refinements")
        note = size_note(mesh, key=f"{self._key}.mesh_unit")
        tags = [mesh.facet_tag(self._section.contact or 0, key=f"{self._key}.contact")]
        for region in regions:
            tag = mesh.facet_tag(region, key="law.regions")
            if tag in tags:
                problem = "the surface is the contact face or another region already"
                raise InputError(problem, key="law.regions", value=region)
            tags.append(tag)
        face = self._face(mesh, tags)
        frame = face.frame if opposite is None else _opposed(opposite, face.frame, self._key)
        body = self._body(mesh, tags, face.frame)
        facets = tuple(
            contact_facets(
                mesh.mesh, mesh.facet_tags.find(tag), frame, opposed=opposite is not None
            )
            for tag in tags
        )
        return SceneBody(
            body=body, facets=facets, frame=frame, facts=self._facts(body, face, facets, note)
        )

    def _body(self, mesh: TaggedMesh, contact: Sequence[int], frame: FaceFrame) -> MeshedBody:
        """Return the elastic body with its supports and loads."""
        from patchlaw.macro import MeshedBody, Support, check_loads, check_supports

        section, key = self._section, self._key
        supports = [
            Support(
                tag=mesh.facet_tag(one.surface, key=f"{key}.supports"),
                displacement=_components(one.displacement),
            )
            for one in section.supports
        ]
        with located(self._scene.file, f"{key}.supports"):
            for tag in contact:
                check_supports(mesh, supports, tag)
        states = body_states(self._scene, key)
        loads = [self._loads(mesh, one, frame) for one in states]
        for state, one in zip(states, loads, strict=True):
            keys = [self._key_of("tractions", load.surface) for load in state.tractions]
            keys += [self._key_of("pretension", bolt.surface) for bolt in state.pretension]
            for where, load in zip(keys, one.on_surfaces, strict=True):
                with located(self._scene.file, where):
                    for tag in contact:
                        check_loads(mesh, supports, [load], tag)
        x, y, z = map(float, frame.normal)
        order = 1 if section.element == "linear" else 2
        return MeshedBody(
            mesh, self._materials(mesh), supports, loads, normal=(x, y, z), order=order
        )

    def _loads(self, mesh: TaggedMesh, stated: BodyLoads, frame: FaceFrame) -> Loads:
        """Return loads by the markers of the mesh."""
        from patchlaw.macro import Loads, Traction
        from patchlaw.macro.mesh.tagged import surface_area

        tractions, pulls = list[Traction](), list[Traction]()
        for load in stated.tractions:
            tag = mesh.facet_tag(load.surface, key=self._key_of("tractions", load.surface))
            stress = load.stress or (0.0, 0.0, 0.0)
            tractions.append(Traction(tag=tag, stress=stress, pressure=load.pressure or 0.0))
        for bolt in stated.pretension:
            tag = mesh.facet_tag(bolt.surface, key=self._key_of("pretension", bolt.surface))
            area = surface_area(mesh, tag) or 1.0  # a face without facets is refused later
            x, y, z = (float(part) * bolt.pull / area for part in frame.normal)
            pulls.append(Traction(tag=tag, stress=(x, y, z)))
        return Loads(
            tractions=tuple(tractions),
            pulls=tuple(pulls),
            strain=tuple(self._strains(mesh, stated)),
        )

    def _key_of(self, what: str, face: str | int) -> str:
        """Return the key that loads a face first: that of the body, or that of a stage."""
        stages = enumerate(self._scene.loading.stage)
        later = ((f"load.stage.{n}.{self._key}", getattr(one, self._key)) for n, one in stages)
        for key, loads in ((self._key, self._section), *later):
            if loads is not None and face in {one.surface for one in getattr(loads, what)}:
                return f"{key}.{what}"
        return f"{self._key}.{what}"

    def _strains(self, mesh: TaggedMesh, stated: BodyLoads) -> Iterator[tuple[int | None, float]]:
        """Yield the free strains by temperatures, by markers of the volumes; None for all."""

        def by_tag(named: Mapping[str | None, float], what: str) -> dict[int | None, float]:
            key = f"{self._key}.{what}"
            return {
                name if name is None else mesh.cell_tag(name, key=key): value
                for name, value in named.items()
            }

        rises = by_tag(stated.rises, "temperature")
        expansions = by_tag(self._section.expansions, "materials")
        tags = {*rises, *expansions}
        for tag in sorted(tags - {None}) if tags != {None} else [None]:  # type: ignore[type-var]
            rise = rises.get(tag, rises.get(None, 0.0))
            if strain := rise * expansions.get(tag, expansions.get(None, 0.0)):
                yield tag, strain

    def _facts(
        self, body: MeshedBody, face: PlanarFace, facets: Sequence[ContactFacets], note: str | None
    ) -> BodyFacts:
        """Return what is known of the body without its mesh."""
        lowest, highest = self._extent(body.mesh, face.frame)
        cells = int(body.mesh.mesh.topology.index_map(3).size_global)
        return BodyFacts(
            lengths=face.lengths,
            area=face.area,
            depth=-lowest,
            cells=f"{cells} {'hexahedra' if body.hexahedral else 'tetrahedra'}",
            unknowns=body.dofs,
            element=f"{'Q' if body.hexahedral else 'P'}{body.degree}",
            materials=tuple(self._at_face(body, part) for part in facets),
            poisson_ratio=body.poisson_ratio,
            above=highest > _SAME_PLANE * max(face.lengths),
            digest=on_root(self._comm, lambda: content_digest(self._path)),
            notes=(*filter(None, [note]), *self._curved(face)),
        )

    def _face(self, mesh: TaggedMesh, tags: Sequence[int]) -> PlanarFace:
        """Return the plane of the contact face with all its regions."""
        from patchlaw.macro.mesh.tagged import PlanarFace, planar_face

        curved = self._scene.law.representative
        # a gap counts as one between planes up to here: a sphere has slopes of 2 % at its edge
        allowed = 5e-3 * self._shortest(mesh) if curved else 0.0
        along = getattr(self._section, "first_axis", None)
        key = f"{self._key}.contact"
        with located(self._scene.file, f"{self._key}.first_axis"):
            faces = [
                planar_face(mesh, tag, deviation=allowed, along=along, key=key) for tag in tags
            ]
        first, corners = faces[0], []
        for face, tag in zip(faces, tags, strict=True):
            height = float(first.frame.height(face.frame.origin[None])[0])
            apart = abs(height) > max(allowed, _SAME_PLANE * max(first.lengths))
            if apart or face.frame.normal @ first.frame.normal < 1.0 - _SAME_PLANE:
                raise InputError(
                    f"the surface {mesh.facet_name(tag)!r} does not lie in the plane of the "
                    f"contact face: it is {height:.4g} mm above it",
                    key="law.regions",
                )
            corners += [face.frame.in_space([[0.0, 0.0], face.lengths])]
        frame = FaceFrame.through(np.concatenate(corners), first.frame.normal, along)
        lengths = frame.in_plane(np.concatenate(corners)).max(axis=0)
        return PlanarFace(
            frame=frame,
            lengths=(float(lengths[0]), float(lengths[1])),
            area=sum(face.area for face in faces),
            deviation=max(face.deviation for face in faces),
        )

    def _shortest(self, mesh: TaggedMesh) -> float:
        lower, upper = mesh.bounding_box()
        return float(np.sort(upper - lower)[1])  # of the two longer sides

    def _materials(self, mesh: TaggedMesh) -> Material | dict[int, Material]:
        section = self._section
        if section.whole_material is not None:
            return section.whole_material
        return {
            mesh.cell_tag(name, key=f"{self._key}.materials"): one.elastic
            for name, one in section.materials.items()
        }

    def _at_face(self, body: MeshedBody, facets: ContactFacets) -> Material:
        """Return the material of the cells at a face, which must be one."""
        found = body.materials_of(facets.cell)
        if len(found) > 1:
            raise InputError(
                "the contact face has cells of several materials",
                key=f"{self._key}.contact",
                value=len(found),
                allowed="faces of one material each; further ones as law.regions",
            )
        return found.pop()

    def _extent(self, mesh: TaggedMesh, frame: FaceFrame) -> tuple[float, float]:
        """Return the heights between which the body lies, above the plane of its face [mm]."""
        heights = frame.height(mesh.mesh.geometry.x)
        parts = self._comm.allgather((heights.min(initial=0.0), heights.max(initial=0.0)))
        lowest, highest = zip(*parts, strict=True)
        return float(min(lowest)), float(max(highest))

    def _curved(self, face: PlanarFace) -> Iterator[str]:
        if face.deviation > _SAME_PLANE * max(face.lengths):
            yield (
                f"the contact face of {self._key} is up to {2.0 * face.deviation:.3g} mm below its "
                "highest point; that gap closes before laws act there"
            )


def _components(stated: Sequence[float | str]) -> tuple[float | None, float | None, float | None]:
    x, y, z = (None if isinstance(one, str) else one for one in stated)
    return x, y, z


def _opposed(first: FaceFrame, second: FaceFrame, key: str) -> FaceFrame:
    """Return the frame of a first face, moved along its normal into the plane of a second one."""
    if first.normal @ second.normal > -1.0 + _SAME_PLANE:
        raise InputError(
            "does not face the body: their contact faces are not parallel and opposite",
            key=f"{key}.contact",
            allowed="a face whose outward normal is opposite to that of the body's",
        )
    height = float(first.height(second.origin[None])[0])
    return replace(first, origin=first.in_space([[0.0, 0.0]], height)[0])
