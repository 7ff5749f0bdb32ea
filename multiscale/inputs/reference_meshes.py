"""The meshes of a reference: their shapes and the memory they will take, before any is made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import scipy

from patchlaw.geometry import BlockShape, RefinedShape, RigidPlane, Surface
from patchlaw.geometry.meshes.families import (
    ContactMap,
    Shape,
    characteristic_size,
    reference_shapes,
)
from patchlaw.multiscale.inputs.bodies import BodyFacts, block_unknowns
from patchlaw.multiscale.inputs.loads import Problem, refuse
from patchlaw.multiscale.inputs.surfaces import located
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.readable import listed, times
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.arrays import Array

_BISECTED = 1.6
"""Cells by bisection for a regular tetrahedron of their size, calibrated by unknowns of blocks."""

_SCATTER = 0.04
"""Scatter of the force on quadratic meshes by where nodes happen to lie, for one edge along the
radius of one contact: twice the 1.4 % that spheres show, and a part more by extrapolation."""

BYTES_PER_UNKNOWN = {1: 2000, 2: 3500}
"""Memory of mesh, stiffness and multigrid per unknown, by the element's degree [B]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceMeshes:
    """The meshes of a reference, from coarse to fine.

    Attributes:
        shapes: What to mesh, the finest last.
        sizes: Edge lengths where contact can occur, falling, shape (meshes,) [mm].
        across: Edges of the finest mesh across a typical contact at the largest load, estimated.
        unknowns: Degrees of freedom, estimated for tetrahedra.
        contacts: Number of equal contacts with as wide a spread of loads, estimated.
    """

    shapes: tuple[Shape, ...]
    sizes: Array
    across: float
    unknowns: tuple[int, ...]
    contacts: float

    @property
    def hexahedral(self) -> bool:
        """Whether the cells are hexahedra."""
        return self.shapes[-1].hexahedral

    @property
    def key(self) -> str:
        """Key of the scene that decides how fine the meshes are."""
        return _key(self.hexahedral)

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.shapes[-1].degree

    @property
    def force_order(self) -> float:
        """Known order of the force in the edge length where contact occurs.

        In families of quadratic tetrahedra all other edges fall with the square of that.
        """
        if self.hexahedral:
            return self.degree + 1.0
        return {1: 2.0, 2: 4.0}[self.degree]

    def scatter(self, area: Array, contacts: Array) -> Array:
        """Return the relative scatter of forces by where nodes happen to lie, shape (steps,).

        It falls with the cube of the edges along a contact's radius, and by averaging over several
        contacts. With the load contacts shrink.

        Args:
            area: Contact area of load steps, shape (steps,) [mm²].
            contacts: Number of their contacts, shape (steps,).
        """
        if self.hexahedral or not np.any(area):
            return np.zeros(len(area))
        each = area / np.maximum(contacts, 1.0)
        shrunk = np.sqrt(each / each[np.argmax(area)])
        edges = np.clip(0.5 * self.across * shrunk, 1.0, 0.5 * self.across)
        return _SCATTER / edges**3 / np.sqrt(np.clip(contacts, 1.0, self.contacts))

    @property
    def area_order(self) -> float:
        """Known order of the contact area in the mesh size."""
        return 1.0

    @property
    def bytes(self) -> float:
        """Memory of all meshes together over all ranks, roughly [B]."""
        return float(sum(self.unknowns)) * BYTES_PER_UNKNOWN[self.degree]

    @property
    def gathered(self) -> float:
        """Memory of rank 0 while it makes the largest mesh, roughly; 0 for hexahedra [B]."""
        # while tetrahedra are divided, 1 kB for each cell
        each = {1: 1900, 2: 250}[self.degree]
        return 0.0 if self.hexahedral else float(max(self.unknowns)) * each

    @property
    def statement(self) -> str:
        """What the meshes are, in words."""
        finest = self.shapes[-1]
        if isinstance(finest, BlockShape):
            kind = f"{times(finest.cells)} hexahedra ({finest.element}), grading {finest.grading:g}"
            where, unknowns = "edges", [f"{count}" for count in self.unknowns]
        else:  # unknowns are an estimate, which is worth two digits
            by = " by gmsh" * (finest.mesher == "gmsh")
            kind = f"tetrahedra ({finest.element}){by}, small only where contact can occur"
            where = "edges there"
            unknowns = [f"about {int(float(f'{count:.2g}'))}" for count in self.unknowns]
        count = {1: "one mesh", 2: "two meshes", 3: "three meshes"}[len(self.shapes)]
        sizes = listed(f"{1e3 * size:.3g}" for size in self.sizes)
        return (
            f"{count} of {kind}; {where} of {sizes} µm, {self.across:.2g} across a typical "
            f"contact; {listed(unknowns)} unknowns, about {self.bytes / 1e9:.2g} GB of memory"
        )

    def warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the meshes."""
        if len(self.shapes) == 1:
            yield (
                "one mesh: the discretisation error stays unknown, and the results have no error "
                "bar; reference.meshes = 2 gives one"
            )
        if self.across < {1: 12.0, 2: 3.0}[self.degree]:
            yield (
                f"{self.across:.2g} edges across a typical contact at the largest load: the "
                f"force is wrong by several per cent; refine {self.key}"
            )
        finest = self.shapes[-1]
        if isinstance(finest, BlockShape):
            top = float(finest.ticks[2][-1] - finest.ticks[2][-2])
            if top > 2.0 * float(self.sizes[-1]):
                yield (
                    f"the top layer is {1e3 * top:.3g} µm high, more than twice the width of its "
                    "cells, which see the contacts no better than cubes would: take more layers, "
                    "or a larger block.grading"
                )


def reference_meshes(
    scene: Scene,
    surface: Surface,
    body: BodyFacts,
    plane_at_largest_load: RigidPlane,
    contact: ContactMap,
) -> ReferenceMeshes:
    """Return the meshes of a scene's reference.

    Args:
        scene: The scene.
        surface: Its surface.
        body: What is known of its body.
        plane_at_largest_load: The rigid plane at the largest load, relative to the rough face.
        contact: Where contact is expected then.

    Raises:
        InputError: When they cannot be made; names file and key.
    """
    refuse(_unfit(scene))
    reference = scene.reference
    hexahedral = reference.hexahedral
    approach, tilt = plane_at_largest_load.approach, plane_at_largest_load.tilt
    with located(scene, _key(hexahedral)):
        element = None
        if scene.block is not None and body.element[0] == ("Q" if hexahedral else "P"):
            element = body.element
        shapes = reference_shapes(
            surface,
            _largest_approach(scene, approach),
            body.depth,
            count=reference.meshes,
            fine=reference.fine,
            tilt=tilt,
            mesh="hexahedra" if hexahedral else "tetrahedra",
            cells=reference.cells,
            grading=1.0 if scene.block is None else scene.block.grading,
            element=element,
            contact=contact,
            mesher=reference.mesher,
        )
    sizes = np.array([characteristic_size(shape) for shape in shapes])
    return ReferenceMeshes(
        shapes=shapes,
        sizes=sizes,
        across=2.0 * contact.typical / float(sizes[-1]),
        unknowns=tuple(mesh_unknowns(shape, body) for shape in shapes),
        contacts=contact.effective,
    )


def least_requests(scene: Scene, surface: Surface, plane: RigidPlane) -> Iterator[MemoryRequest]:
    """Yield the least memory that any meshes of a reference could need.

    It is known before their sizes are arranged, which takes memory too.

    Args:
        scene: The scene.
        surface: Its surface.
        plane: The rigid plane at the largest load.
    """
    fine = scene.reference.fine
    if fine is None or scene.reference.hexahedral:
        return
    # the nodes of the top face where contact can occur alone
    lowered = RigidPlane.above(surface, _largest_approach(scene, plane.approach), plane.tilt)
    depth = surface.highest - surface.heights
    share = float((lowered.at(surface.x[:, None], surface.y) > depth).mean())
    least = 3.0 * BYTES_PER_UNKNOWN[1] * surface.area * share / fine / fine
    yield _request(scene, "the reference", shared=least)


def _plane_is_prescribed(scene: Scene) -> bool:
    """Whether the plane is known, and not estimated on a half-space."""
    return scene.loading.quantity == "approach" and scene.loading.tilt != "free"


def _largest_approach(scene: Scene, approach: float) -> float:
    """Return the approach that meshes are for; bodies yield more than half-spaces."""
    return approach if _plane_is_prescribed(scene) else 1.1 * approach


def reference_requests(scene: Scene, meshes: ReferenceMeshes) -> Iterator[MemoryRequest]:
    """Yield the memory that the meshes of a reference need.

    Args:
        scene: The scene.
        meshes: Its meshes.
    """
    yield _request(scene, "the reference", shared=meshes.bytes)
    yield _request(scene, "rank 0, which meshes the reference,", root_only=meshes.gathered)


def _request(scene: Scene, purpose: str, **sizes: Any) -> MemoryRequest:
    reference = scene.reference
    return MemoryRequest(
        key=_key(reference.hexahedral),
        value=reference.cells or reference.fine,
        purpose=purpose,
        alternative="fewer reference.meshes",
        **sizes,
    )


def _key(hexahedral: bool) -> str:
    return "reference.cells" if hexahedral else "reference.fine"


def _unfit(scene: Scene) -> Iterator[Problem]:
    """Yield keys of the body that do not go with a reference."""
    block, reference = scene.block, scene.reference
    if block is None and reference.mesher == "gmsh":
        problem = "does not go with [body], whose mesh of the file is bisected"
        yield "reference.mesher", "gmsh", problem, "bisection"
    if block is None and reference.hexahedral:
        problem = "does not go with [body], whose meshes of a reference are of tetrahedra"
        yield "reference.cells", reference.cells, problem, "reference.fine, or neither"
    if block is not None and block.margin > 0.0:
        whole = "whose rough surface is the whole top"
        problem = f"does not go with coupling.kind = 'reference', {whole}"
        yield "block.margin", block.margin, problem, "0"
    if block is not None and reference.hexahedral and not block.element.startswith("Q"):
        problem, allowed = "does not go with a reference of hexahedra", "Q1, Q2"
        allowed = f"{allowed}, or reference.mesh = 'tetrahedra'"
        yield "block.element", block.element, problem, allowed


def mesh_unknowns(shape: Shape, body: BodyFacts | None = None) -> int:
    """Return the degrees of freedom of a mesh; for tetrahedra an estimate from their sizes.

    Args:
        shape: What is meshed: a block, or what lies below the rough part of a body's face.
        body: What is known of a body from a mesh, which the cells are added to; None of a block.
    """
    if isinstance(shape, BlockShape):
        return block_unknowns(shape)
    nodes = {1: 1.1, 2: 8.4}[shape.degree]  # of tetrahedra per cube of their edge
    # a linear mesh has an eighth of the nodes of quadratic displacements
    on_mesh = body is not None and body.on_mesh
    own = body.unknowns * 8.0 ** (shape.degree - body.degree) if body and on_mesh else 0.0
    if shape.mesher == "gmsh":
        return round(3.0 * nodes * _cubes(shape))
    least = 0.0 if on_mesh else {1: 5.0, 2: 34.0}[shape.degree] * math.prod(shape.cubes)
    return round(3.0 * max(_BISECTED * nodes * _cubes(shape), least) + own)


def _cubes(shape: RefinedShape) -> float:
    """Return the number of cubes as large as the edges at their place that fill a block."""
    counts = [int(np.clip(np.ceil(length / shape.fine), 8, 400)) for length in shape.interface]
    spacing = np.divide(shape.interface, counts)
    near = np.minimum((shape.places / spacing).astype(int), np.array(counts) - 1)
    classes = np.rint(np.log2(shape.edges / shape.fine) / 0.3).astype(int)
    beside, edges = [], []
    for one in np.unique(classes):
        away, chosen = np.ones(counts, dtype=bool), classes == one
        away[near[chosen, 0], near[chosen, 1]] = False
        beside.append(np.asarray(scipy.ndimage.distance_transform_edt(away, sampling=spacing)))
        edges.append(float(shape.edges[chosen].mean()))

    def density(depth: float) -> float:
        """Return cubes per volume, summed over the columns of the grid."""
        size = np.full(counts, shape.coarse + shape.growth * depth)
        for distance, edge in zip(beside, edges, strict=True):
            away = np.maximum(np.hypot(distance, depth) - 2.0 * edge, 0.0)
            np.minimum(size, edge + shape.growth * away, out=size)
        return float(np.sum(size**-3.0))

    # layers half as thick as the edges at their depth below the smallest, or a twentieth of it:
    # edges too tiny for any memory would grow through 10⁵ layers and more
    depths, total, least = [0.0], 0.0, min(edges)
    while depths[-1] < shape.height:
        grown = least + shape.growth * max(depths[-1] - 2.0 * least, 0.0)
        edge = min(grown, shape.coarse + shape.growth * depths[-1])
        depths.append(min(depths[-1] + max(0.5 * edge, 0.05 * depths[-1]), shape.height))
    for above, below in pairwise(depths):
        total += (below - above) * density(0.5 * (above + below))
    return total * float(np.prod(spacing))
