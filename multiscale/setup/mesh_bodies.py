"""The bodies of a scene that come from meshes: read, checked, and known by their facts.

Theory: demos/theory.md, section 11.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry import InputError, Material, MaterialPair
from geometry.collective import on_root
from geometry.face_frame import UPWARD, FaceFrame
from multiscale.scene.body_sections import CounterBodySection
from multiscale.scene.scene import Scene
from multiscale.setup.surface_and_block import block_material

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ContactFacets, MeshedBody, TaggedMesh

MILLIMETRES = {"mm": 1.0, "m": 1e3, "um": 1e-3, "inch": 25.4}
"""Units of meshes in mm."""

_SAME_PLANE = 1e-6
"""Distance between planes, relative to the face, that is rounding of coordinates in files."""
_MOST_CURVED = 5e-3
"""Height of a slightly curved face over its shorter side, up to which its gap counts as one between
planes. A sphere has slopes of 2 % at its edge then, whose squares are not counted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceFacts:
    """What is known of a body and its contact face without its mesh.

    Attributes:
        lengths: Sides of the bounding rectangle of the contact face along its axes [mm].
        area: Area of the contact face [mm²].
        depth: Extent of the body below its contact face [mm].
        cells: What its mesh is made of, in words.
        unknowns: Degrees of freedom.
        element: Hexahedra Q or tetrahedra P, and the degree of the displacements.
        materials: Elastic constants at the contact face, and at its further regions.
        poisson_ratio: Largest Poisson's ratio in the body.
        above: Whether parts of the body lie above the plane of its contact face.
        digest: SHA-256 of the file of the mesh; empty for a block.
        notes: What a user should know of the mesh.
    """

    lengths: tuple[float, float]
    area: float
    depth: float
    cells: str
    unknowns: int
    element: str
    materials: tuple[Material, ...]
    poisson_ratio: float
    above: bool = False
    digest: str = ""
    notes: tuple[str, ...] = ()

    @property
    def degree(self) -> int:
        """Degree of the displacements."""
        return int(self.element[1])


Faces = tuple[FaceFacts | None, FaceFacts | None]
"""What is known of the meshes of a body and of its counter-body."""


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
    facts: FaceFacts

    def placed(self, place: tuple[float, float]) -> SceneBody:
        """Return the body with its coordinates counted from a point of the contact face.

        Args:
            place: The point in the present coordinates [mm].
        """
        frame = self.frame.moved(*place)
        facets = tuple(
            replace(part, frame=frame, corners=part.corners - np.asarray(place))
            for part in self.facets
        )
        return replace(self, frame=frame, facets=facets)


@dataclass(eq=False)
class SceneBodies:
    """The bodies of a scene that come from meshes.

    Attributes:
        first: The body below the surface; None for a block.
        counter: The body on the other side; None where that is rigid or a half-space.
    """

    first: SceneBody | None = None
    counter: SceneBody | None = None

    @property
    def facts(self) -> Faces:
        """What is known of the body and of the counter-body."""
        first, counter = (one.facts if one else None for one in (self.first, self.counter))
        return first, counter

    def place(self, place: tuple[float, float]) -> None:
        """Count the coordinates of both contact faces from a point of the first one.

        Args:
            place: The point [mm].
        """
        self.first = self.first and self.first.placed(place)
        self.counter = self.counter and self.counter.placed(place)

    def release(self) -> None:
        """Let go of the bodies, whose matrices stay in memory as long as they are held."""
        self.first = self.counter = None


def materials_in_contact(scene: Scene, faces: Faces) -> MaterialPair:
    """Return the materials on both sides of a scene's interface; the second may be rigid.

    Args:
        scene: The scene.
        faces: What is known of its meshes.
    """
    face, counter = faces
    first = block_material(scene) if face is None else face.materials[0]
    return MaterialPair(first=first, second=second_material(scene, counter))


def second_material(scene: Scene, counter: FaceFacts | None) -> Material | None:
    """Return the material of a scene's counter-body at the interface; None where it is rigid.

    Args:
        scene: The scene.
        counter: What is known of its mesh; None of a half-space.
    """
    if counter is not None:
        return counter.materials[0]
    return None if scene.counter_body is None else scene.counter_body.whole_material


def scene_bodies(scene: Scene, comm: Any) -> SceneBodies:
    """Read and check the meshes of a scene's bodies.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.

    Raises:
        InputError: On all ranks, when a mesh, its names, supports or contact face do not fit; names
            file and key.

    Note:
        Collective.
    """
    found, second = SceneBodies(), scene.counter_body
    if scene.body is not None:
        reader = _Reader(scene, scene.body, "body", comm)
        found.first = reader.read([region.surface for region in scene.law.regions])
    if second is not None and second.mesh is not None:
        frame = found.first.frame if found.first else UPWARD
        found.counter = _Reader(scene, second, "counter_body", comm).read((), opposite=frame)
    return found


class _Reader:
    """Reads one body of a scene."""

    def __init__(self, scene: Scene, section: CounterBodySection, key: str, comm: Any) -> None:
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
        try:
            return self._read(regions, opposite)
        except InputError as error:
            raise error.located(key=f"{self._key}.mesh", file=self._scene.file) from None

    def _read(self, regions: Sequence[str | int], opposite: FaceFrame | None) -> SceneBody:
        from macro import MeshedBody, Support, Traction, contact_facets
        from macro.mesh.checks import size_note
        from macro.mesh.from_file import read_mesh
        from macro.mesh.supports import check_supports

        section, key = self._section, self._key
        mesh = read_mesh(self._path, self._comm, unit=MILLIMETRES[section.mesh_unit])
        tags = [mesh.facet_tag(section.contact or 0, key=f"{key}.contact")]
        tags += [mesh.facet_tag(region, key="law.regions") for region in regions]
        face = self._face(mesh, tags)
        supports = [
            Support(
                tag=mesh.facet_tag(one.surface, key=f"{key}.supports"),
                displacement=_components(one.displacement),
            )
            for one in section.supports
        ]
        for tag in tags:
            check_supports(mesh, supports, tag, key=f"{key}.supports")
        loads = [
            Traction(tag=mesh.facet_tag(one.surface, key=f"{key}.tractions"), stress=one.stress)
            for one in section.tractions
        ]
        frame = face.frame if opposite is None else _opposed(opposite, face.frame, key)
        axis = face.frame.normal
        body = MeshedBody(
            mesh,
            self._materials(mesh),
            supports,
            loads,
            normal=(float(axis[0]), float(axis[1]), float(axis[2])),
            order=1 if section.element == "linear" else 2,
        )
        facets = tuple(
            contact_facets(
                mesh.mesh, mesh.facet_tags.find(tag), frame, opposed=opposite is not None
            )
            for tag in tags
        )
        lowest, highest = self._extent(mesh, face.frame)
        note = size_note(mesh)
        facts = FaceFacts(
            lengths=face.lengths,
            area=face.area,
            depth=-lowest,
            cells=f"{_cells(mesh)} {'hexahedra' if body.hexahedral else 'tetrahedra'}",
            unknowns=body.dofs,
            element=f"{'Q' if body.hexahedral else 'P'}{body.degree}",
            materials=tuple(self._at_face(body, part) for part in facets),
            poisson_ratio=body.poisson_ratio,
            above=highest > _SAME_PLANE * max(face.lengths),
            digest=on_root(self._comm, lambda: _digest(self._path)),
            notes=(*filter(None, [note]), *self._curved(face.deviation)),
        )
        return SceneBody(body=body, facets=facets, frame=frame, facts=facts)

    def _face(self, mesh: TaggedMesh, tags: Sequence[int]) -> _Face:
        """Return the plane of the contact face with all its regions."""
        from macro.mesh.planar_face import planar_face

        names = {tag: name for name, tag in mesh.facet_names.items()}
        curved = self._scene.law.representative
        allowed = _MOST_CURVED * self._shortest(mesh) if curved else 0.0
        faces = [
            planar_face(
                mesh, tag, name=names.get(tag), deviation=allowed, key=f"{self._key}.contact"
            )
            for tag in tags
        ]
        first, corners = faces[0], []
        for face, tag in zip(faces, tags, strict=True):
            height = float(first.frame.height(face.frame.origin[None])[0])
            apart = abs(height) > max(allowed, _SAME_PLANE * max(first.lengths))
            if apart or face.frame.normal @ first.frame.normal < 1.0 - _SAME_PLANE:
                raise InputError(
                    f"the surface {names.get(tag, str(tag))!r} does not lie in the plane of the "
                    f"contact face: it is {height:.4g} mm above it",
                    key="law.regions",
                )
            corners += [face.frame.in_space([[0.0, 0.0], face.lengths])]
        frame = FaceFrame.through(np.concatenate(corners), first.frame.normal)
        lengths = frame.in_plane(np.concatenate(corners)).max(axis=0)
        return _Face(
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
            mesh.cell_tag(name, key=f"{self._key}.materials"): one.material
            for name, one in section.materials.items()
        }

    def _at_face(self, body: MeshedBody, facets: ContactFacets) -> Material:
        """Return the material of the cells at a face, which must be one."""
        materials = body.materials
        if isinstance(materials, Material):
            return materials
        tags = body.mesh.cell_tags
        of_cells = np.zeros(int(tags.indices.max(initial=-1)) + 1, dtype=np.int64)
        of_cells[tags.indices] = tags.values
        here = set(map(int, of_cells[facets.cell]))
        found = {materials[tag] for part in self._comm.allgather(here) for tag in part}
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

    def _curved(self, deviation: float) -> Iterator[str]:
        if deviation > _SAME_PLANE * 1e3:
            yield (
                f"the contact face of {self._key} is up to {2.0 * deviation:.3g} mm below its "
                "highest point; that gap closes before laws act there"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Face:
    """A contact face with all its regions."""

    frame: FaceFrame
    lengths: tuple[float, float]
    area: float
    deviation: float


def _components(
    stated: Sequence[float | str],
) -> tuple[float | None, float | None, float | None]:
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


def _cells(mesh: TaggedMesh) -> int:
    return int(mesh.mesh.topology.index_map(3).size_global)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a mesh's files."""
    whole = hashlib.sha256(path.read_bytes())
    arrays = path.with_suffix(".h5")
    if path.suffix.lower() == ".xdmf" and arrays.is_file():
        whole.update(arrays.read_bytes())
    return whole.hexdigest()
