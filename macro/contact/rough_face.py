"""The rough face of a body, which a rigid plane is pressed on, also of a user's own mesh.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from patchlaw.geometry import Control, PatchGrid, RefinedShape, Surface
from patchlaw.geometry.face_frame import UPWARD, FaceFrame
from patchlaw.geometry.meshes.bisection import (
    Table,
    Tetrahedra,
    from_hexahedra,
    reentrant_edges,
    refined,
)
from patchlaw.geometry.meshes.refined_block import EdgeLengths
from patchlaw.geometry.rigid_plane import UNSUPPORTED, PlaneLevers, PlaneResponse, find_equilibrium
from patchlaw.macro import compat
from patchlaw.macro.bodies import Block, MeshedBody
from patchlaw.macro.contact.loaded_face import LoadedFace
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.mesh.block import TOP, MeshQuality, distributed, move_onto
from patchlaw.macro.mesh.contact_face import ContactFacets, contact_facets
from patchlaw.macro.mesh.facets import exterior_facets, facet_nodes
from patchlaw.macro.mesh.supports import Support
from patchlaw.macro.mesh.tagged import TaggedMesh, cell_tags, check_outer, facet_tags
from patchlaw.support import Array, Flags, InputError, Locals, NotConverged, on_root


@dataclass(frozen=True, eq=False)
class RoughFace:
    """The rough face of a body that is meshed with its roughness: around z = 0, looking along z.

    Args:
        body: The body.
        marker: Marker of the face's facets.
        lengths: Sides (Lx, Ly) of the face's rectangle, which begins at the origin [mm]. A plane
            turns about its middle.
    """

    body: ElasticBody
    marker: int
    lengths: tuple[float, float]

    @classmethod
    def of_block(cls, block: Block) -> Self:
        """Return the top of a block.

        Raises:
            InputError: When the block has a margin.
        """
        if block.mesh.shape.margin:
            raise InputError(
                "the plane presses on the whole top, which has no margin",
                value=block.mesh.shape.margin,
                allowed="0 mm",
            )
        return cls(block, TOP, block.mesh.shape.interface)

    @cached_property
    def facets(self) -> ContactFacets:
        """The facets whose cells this rank owns; there may be none."""
        mesh = self.body.mesh
        return contact_facets(mesh.mesh, mesh.facet_tags.find(self.marker), UPWARD)

    @cached_property
    def modulus(self) -> float:
        """Largest contact modulus E* of the cells behind the face [MPa].

        Raises:
            InputError: When no facet has the marker.
        """
        behind = self.body.materials_of(self.facets.cell)
        if not behind:
            raise InputError("no facet of the body has this marker", value=self.marker)
        return max(material.contact_modulus for material in behind)

    @property
    def whole(self) -> PatchGrid:
        """One patch of the whole face."""
        return PatchGrid(grid=(1, 1), lengths=self.lengths)

    @cached_property
    def loaded(self) -> LoadedFace:
        """The face with quadrature that is exact for products of two basis functions."""
        return LoadedFace(self.body, self.facets, self.whole, 2 * self.body.degree)


class PlaneOverNodes:
    """A rigid plane above this rank's nodes on the top.

    Args:
        x: Abscissae of the nodes, shape (n,) [mm].
        y: Their ordinates [mm].
        distance: Their distances from the plane at no approach and no tilt [mm].
        lengths: Sides of the interface, about whose centre the plane turns [mm].
        comm: MPI communicator.

    Attributes:
        distance: As given.
        levers: Levers of the nodes.
        centre: Centre of the interface, shape (2,) [mm].

    Note:
        Methods that sum over the nodes are collective.
    """

    def __init__(
        self, x: Array, y: Array, distance: Array, lengths: tuple[float, float], comm: Any
    ) -> None:
        self.distance, self.centre = distance, 0.5 * np.asarray(lengths)
        self.levers = PlaneLevers.at(x, y, lengths, comm=comm)

    def placed(self, control: Control, plane: Array) -> Array:
        """Return the plane with its prescribed motions, and with its free ones as at the start.

        Without any force the plane just touches the top.

        Args:
            control: What the load step prescribes.
            plane: Where the plane may start, shape (3,).
        """
        plane = control.prescribed(plane)
        if control.force == 0.0:
            plane[0] = self.levers.first_touch(self.distance, plane[1:])
        return plane

    def interference(self, plane: Array, displacement: Array) -> Array:
        """Return how far the plane is below the nodes, negative where it is above, (n,) [mm].

        Args:
            plane: Approach [mm] and slopes, shape (3,).
            displacement: Downward displacements of the nodes, shape (n,) [mm].
        """
        return self.levers.matrix @ plane - displacement - self.distance

    def supported_motions(self, free: Flags, at: Flags) -> Array:
        """Return the combinations of free motions that move some of the nodes, shape (k, k').

        They are scaled so that ``levers.scaled(free)[at]`` times them has orthonormal columns, all
        ranks together.

        Args:
            free: Motions that are free, shape (3,).
            at: Which of this rank's nodes are meant, shape (n,).
        """
        levers = self.levers.scaled(free)[at]
        values, vectors = np.linalg.eigh(self.levers.summed(levers.T @ levers))
        supported = values > UNSUPPORTED * max(values.max(initial=0.0), 1.0)
        scaled: Array = vectors[:, supported] / np.sqrt(values[supported])
        return scaled

    def on_springs(
        self, control: Control, start: Array, displacement: Array, stiffness: Array
    ) -> Array:
        """Return where the plane comes to rest on springs at the nodes, shape (3,).

        Args:
            control: What the load step prescribes.
            start: The plane to start from, with what is prescribed of it, shape (3,).
            displacement: Downward displacements of the nodes, shape (n,) [mm].
            stiffness: Stiffnesses of springs that only push, shape (n,) [N/mm].

        Raises:
            NotConverged: When nothing can hold the plane.
        """

        def respond(plane: Array) -> PlaneResponse[None]:
            depth = self.interference(plane, displacement)
            return PlaneResponse(
                loads=self.levers.loads(stiffness * np.maximum(depth, 0.0)),
                stiffness=lambda: self.levers.stiffness(np.where(depth > 0.0, stiffness, 0.0)),
                state=None,
            )

        return find_equilibrium(respond, control, start, self.levers.half)[0]


def not_found(control: Control, reason: str, iterations: int) -> NotConverged:
    """Return the error of a load step whose contact was not found.

    Args:
        control: What the load step prescribes.
        reason: Name of the reason.
        iterations: Iterations that were made.
    """
    return NotConverged(
        f"the contact of the rough block at {control}",
        reason=reason,
        iterations=iterations,
        remedy="take smaller load steps (load.steps)",
    )


class Guess(NamedTuple):
    """Where an iteration on meshed roughness starts, and what a solution is for further ones.

    Attributes:
        plane: Approach [mm] and slopes of the plane, shape (3,).
        displacement: This rank's owned degrees of freedom [mm].
        contact: Contact forces of its nodes, or pressures of its quadrature points, shape (n,).
    """

    plane: Array
    displacement: Array
    contact: Array


class ContactSolution(NamedTuple):
    """Contact of a rough top with a rigid plane; arrays hold this rank's part.

    Attributes:
        end: Plane, displacement, and what the method starts from in further load steps.
        nodal_force: Contact forces of the nodes of the top, shape (n,) [N].
        touching: Whether these nodes are in contact, shape (n,).
        iterations: Active sets that were solved for, or Newton steps.
        linear_iterations: Iterations of the linear solver.
        reason: Name of the reason to stop.
    """

    end: Guess
    nodal_force: Array
    touching: Flags
    iterations: int
    linear_iterations: int
    reason: str


def largest(values: Array, comm: Any) -> float:
    """Return the largest size of numbers over all ranks; 0 where there are none.

    Args:
        values: This rank's numbers.
        comm: MPI communicator.

    Note:
        Collective.
    """
    return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), max))


_STEEP = 0.5
"""Vertical component of the normals of sides, which move with the roughness; a bottom has more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatBody:
    """A body whose contact face is flat, from the user's mesh, to be meshed with its roughness.

    Args:
        body: The body on the user's mesh.
        contact: Tag of its contact face.
        frame: Frame of that face; the rough rectangle begins at its origin.
        lengths: Sides of the rectangle [mm].

    Raises:
        InputError: When the cells are curved, whose parts would be straight, or a support holds a
            face inside the body, which the divided mesh does not know.

    Note:
        Everything here is collective. Rank 0 has the whole mesh while it is refined.
    """

    body: MeshedBody
    contact: int
    frame: FaceFrame
    lengths: tuple[float, float]

    def __post_init__(self) -> None:
        if compat.geometry_degree(self.body.mesh.mesh) == 2:
            raise InputError(
                "a mesh of curved cells is not divided for a reference",
                allowed="a mesh of straight cells, or another coupling",
            )
        for support in self.body.supports:
            why = ", which a reference does not hold"
            check_outer(self.body.mesh, support.tag, why=why)

    @property
    def comm(self) -> Any:
        """Communicator of the body."""
        return self.body.mesh.comm

    @cached_property
    def whole(self) -> Tetrahedra | None:
        """The user's mesh in tetrahedra, in the coordinates of the frame; None but on rank 0."""
        parts = self.comm.gather(_own_part(self.body.mesh))
        found: list[Tetrahedra] = []
        on_root(self.comm, lambda: found.append(self._joined(parts)))
        return found[0] if found else None

    def _joined(self, parts: Sequence[dict[str, Array]]) -> Tetrahedra:
        """Return the mesh of all ranks' parts."""
        joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        numbers, first = np.unique(joined["numbers"], return_index=True)
        points = (joined["points"][first] - self.frame.origin) @ self.frame.axes.T
        order = np.argsort(joined["cell_numbers"], kind="stable")
        cells = np.searchsorted(numbers, joined["cells"][order])
        cell_tags, tags = joined["cell_tags"][order], joined["facet_tags"]
        facets = np.searchsorted(numbers, joined["facets"])
        if cells.shape[1] == 8:
            points, cells, facets = from_hexahedra(points, cells, facets)
            cell_tags, tags = np.repeat(cell_tags, 24), np.repeat(tags, 4)
        facets, first = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)
        face = np.unique(facets[tags[first] == self.contact])
        points[face, 2] = 0.0  # but for rounding in the file
        return Tetrahedra(
            points=points,
            cells=cells,
            cell_tags=cell_tags.astype(np.int32),
            facets=facets,
            facet_tags=tags[first].astype(np.int32),
        )

    @cached_property
    def depth(self) -> float:
        """Thickness of the body below the rough part of its face, at most its longer side [mm]."""
        return float(on_root(self.comm, self._depth))

    def _depth(self) -> float:
        """Return the depth of the highest part of the body's surface that is no side."""
        mesh = self.whole
        assert mesh is not None
        corners = mesh.points[mesh.facets]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        level = np.abs(normal[:, 2]) > _STEEP * np.linalg.norm(normal, axis=1)
        margin = 0.5 * min(self.lengths)  # in which the movement decays beside the rectangle
        lower, upper = corners[..., :2].min(axis=1), corners[..., :2].max(axis=1)
        near = np.all((upper > -margin) & (lower < np.add(self.lengths, margin)), axis=1)
        top = corners[..., 2].max(axis=1)
        bottom = level & near & (mesh.facet_tags != self.contact) & (top < 0.0)
        return min(float(-top[bottom].max(initial=-np.inf)), max(self.lengths))

    @cached_property
    def _hollows(self) -> Array:
        """Ends of the edges of the surface where stresses are singular, (n, 2, 3); on rank 0."""
        assert self.whole is not None
        return reentrant_edges(self.whole)

    @cached_property
    def supports(self) -> list[Support]:
        """The supports in the coordinates of the frame.

        Raises:
            InputError: When a component is free and the face does not look along an axis.
        """
        axes, found = self.frame.axes, []
        for support in self.body.supports:
            known = np.array([part is not None for part in support.displacement])
            given = np.array([part or 0.0 for part in support.displacement])
            involved = np.abs(axes) > 1e-9
            if np.any(involved[:, known].any(axis=1) & involved[:, ~known].any(axis=1)):
                raise InputError(
                    "a support with a free component does not go with a meshed roughness on a face "
                    "that is oblique to the axes of the mesh",
                    value=list(support.displacement),
                    allowed="all three components; or a mesh whose face looks along an axis",
                )
            turned = axes @ given
            mine = involved[:, known].any(axis=1)
            x, y, z = (float(v) if fixed else None for v, fixed in zip(turned, mine, strict=True))
            found.append(replace(support, displacement=(x, y, z)))
        return found

    def rough(self, shape: RefinedShape, surface: Surface) -> tuple[RoughFace, MeshQuality]:
        """Return the body refined and moved onto the roughness.

        Args:
            shape: Sizes of the cells around places on the rectangle, and their element.
            surface: The rough surface, which covers the rectangle.

        Raises:
            InputError: When the roughness does not fit the body or the mesh.
        """
        made: list[Tetrahedra] = []
        whole = self.whole

        def refine() -> tuple[Table, Locals]:
            """Return the marked facets of the refined mesh, and their tags."""
            assert whole is not None
            made.append(refined(whole, EdgeLengths(shape, self._hollows)))
            facets, tags = made[0].facets, made[0].facet_tags.copy()
            middles = made[0].points[facets].mean(axis=1)[:, :2]
            inside = np.all((middles > 0.0) & (middles < self.lengths), axis=1)
            tags[inside & (tags == self.contact)] = self._rough_tag(whole)
            marked = tags >= 0
            return facets[marked], tags[marked]

        facets, tags = on_root(self.comm, refine)
        own = made[0] if made else None
        mesh = distributed(own, shape.degree, self.comm)
        of_cells = self.comm.bcast(None if own is None else own.cell_tags)
        tagged = TaggedMesh(
            mesh=mesh,
            facet_tags=facet_tags(mesh, facets, tags),
            cell_tags=cell_tags(mesh, of_cells),
        )
        quality = move_onto(mesh, surface, self.depth)
        body = MeshedBody(tagged, self.body.materials, self.supports, order=shape.degree)
        return RoughFace(body, self.comm.bcast(self._rough_tag(whole)), self.lengths), quality

    @staticmethod
    def _rough_tag(whole: Tetrahedra | None) -> int:
        """Return a tag that no facet of the mesh has."""
        return 0 if whole is None else int(whole.facet_tags.max(initial=0)) + 1


def _own_part(tagged: TaggedMesh) -> dict[str, Array]:
    """Return this rank's part of a mesh: its own cells, and all outer facets of these.

    Facets without a tag have the tag −1.
    """
    mesh = tagged.mesh
    own = mesh.topology.index_map(3).size_local
    numbers = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)
    corners = len(compat.reference_facets(mesh.topology.cell_name())[0])
    rows = compat.cell_vertices(mesh)[:own, :corners]
    outer = exterior_facets(mesh)
    tags = np.full(int(outer.max(initial=0)) + 1, -1, dtype=np.int32)
    known = np.asarray(tagged.facet_tags.indices)
    fits = known < len(tags)
    tags[known[fits]] = np.asarray(tagged.facet_tags.values)[fits]
    of_cells = np.zeros(own, np.int32)
    if tagged.cell_tags is not None:
        among: Flags = tagged.cell_tags.indices < own
        of_cells[tagged.cell_tags.indices[among]] = tagged.cell_tags.values[among]
    return {
        "numbers": numbers,
        "points": mesh.geometry.x,
        "cells": numbers[rows].reshape(-1, corners),
        "cell_numbers": np.asarray(mesh.topology.original_cell_index, dtype=np.int64)[:own],
        "cell_tags": of_cells,
        "facets": numbers[facet_nodes(mesh, outer).corners],
        "facet_tags": tags[outer],
    }
