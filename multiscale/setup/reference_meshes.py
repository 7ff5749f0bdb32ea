"""The meshes of a reference: their shapes, and what they will take, before any is made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from geometry.errors import InputError
from geometry.meshes.block import BlockShape
from geometry.meshes.families import characteristic_size, contact_radius, reference_shapes
from geometry.meshes.refined_block import RefinedShape
from geometry.surface import Surface
from multiscale.machine.nodes import ClusterNodes, MemoryRequest
from multiscale.scene.scene import Scene

Array = NDArray[np.float64]
Shape: TypeAlias = BlockShape | RefinedShape
Plane: TypeAlias = tuple[float, tuple[float, float]]

BYTES_PER_UNKNOWN = {1: 2000, 2: 3500}
"""Memory that mesh, stiffness and multigrid take per unknown, by the element's degree [B]."""

_GMSH = {1: 1900, 2: 250}
"""Memory that rank 0 takes per unknown of tetrahedra from gmsh to their distribution, by the
element's degree: 1 kB a cell [B]."""

_NODES = {1: 1.1, 2: 8.4}
"""Nodes of unstructured tetrahedra per cube of their edge, by the element's degree."""

_RESERVE = 0.1
"""Depth beyond the largest approach that tetrahedra are small for, relative to it: what the block
yields more than a half-space, where the approach is not given."""

_ORDERS = {1: (2.0, 1.0), 2: (3.0, 1.0)}
"""Known orders of force and contact area in the mesh size, by the element's degree."""

_MOST_LATTICE = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceMeshes:
    """The meshes of a reference, from coarse to fine.

    Attributes:
        shapes: What to mesh, the finest last.
        sizes: Edge lengths where contact can occur, falling, shape (meshes,) [mm].
        across: Edges of the finest mesh across a typical contact at the largest load, estimated.
        unknowns: Degrees of freedom, estimated for tetrahedra.
        key: Key of the scene that decides how fine they are.
    """

    shapes: tuple[Shape, ...]
    sizes: Array
    across: float
    unknowns: tuple[int, ...]
    key: str

    @property
    def hexahedral(self) -> bool:
        """Whether the cells are hexahedra."""
        return self.shapes[-1].hexahedral

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.shapes[-1].degree

    @property
    def force_order(self) -> float:
        """Known order of the force in the mesh size."""
        return _ORDERS[self.degree][0]

    @property
    def area_order(self) -> float:
        """Known order of the contact area in the mesh size."""
        return _ORDERS[self.degree][1]

    @property
    def bytes(self) -> float:
        """Memory that all meshes take together, roughly, over all ranks [B]."""
        return float(sum(self.unknowns)) * BYTES_PER_UNKNOWN[self.degree]

    @property
    def gathered(self) -> float:
        """Memory that rank 0 takes to make the largest, 0 where all ranks do, roughly [B]."""
        return 0.0 if self.hexahedral else float(max(self.unknowns)) * _GMSH[self.degree]


def reference_meshes(
    scene: Scene, surface: Surface, plane_at_largest_load: Plane, nodes: ClusterNodes
) -> ReferenceMeshes:
    """Return the meshes of a scene's reference.

    Args:
        scene: The scene.
        surface: Its surface.
        plane_at_largest_load: Largest approach at the middle [mm] and the plane's slopes there.
        nodes: The nodes of the run.

    Raises:
        InputError: When they cannot be made or would not fit into memory; names file and key.
    """
    _check_block(scene)
    hexahedral = scene.reference.hexahedral
    key = "reference.cells" if hexahedral else "reference.fine"
    approach, tilt = plane_at_largest_load
    given = scene.loading.force is None and scene.loading.tilt != "free"
    reach = approach if given else (1.0 + _RESERVE) * approach
    try:
        if scene.reference.fine is not None and not hexahedral:
            least = _least_bytes(surface, reach, tilt, scene.reference.fine)
            _check_memory(scene, key, nodes, least)
        height = scene.block.height_under(surface.lengths)
        shapes = reference_shapes(
            surface, reach, height, count=scene.reference.meshes, tilt=tilt, **_asked(scene)
        )
        radius = contact_radius(surface, approach, tilt=tilt)
    except InputError as error:
        raise error.located(key=key, file=scene.file) from None
    sizes = np.array([characteristic_size(shape) for shape in shapes])
    meshes = ReferenceMeshes(
        shapes=shapes,
        sizes=sizes,
        across=2.0 * radius / float(sizes[-1]),
        unknowns=tuple(_unknowns(shape) for shape in shapes),
        key=key,
    )
    _check_memory(scene, key, nodes, meshes.bytes, meshes.gathered)
    return meshes


def _asked(scene: Scene) -> dict[str, Any]:
    """Return what the scene says of its cells."""
    block = scene.block
    if scene.reference.hexahedral:
        return {
            "mesh": "hexahedra",
            "cells": scene.reference.cells,
            "grading": block.grading,
            "element": block.element,
        }
    stated = block.element if block.element.startswith("P") else None
    return {"mesh": "tetrahedra", "fine": scene.reference.fine, "element": stated}


def _check_block(scene: Scene) -> None:
    block, hexahedral = scene.block, scene.reference.hexahedral
    for wrong, key, value, problem, allowed in (
        (
            block.margin > 0.0,
            "block.margin",
            block.margin,
            "does not go with coupling.kind = 'reference', whose rough surface is the whole top",
            "0",
        ),
        (
            hexahedral and not block.element.startswith("Q"),
            "block.element",
            block.element,
            "does not go with a reference of hexahedra",
            "Q1, Q2, or reference.mesh = 'tetrahedra'",
        ),
    ):
        if wrong:
            raise InputError(problem, key=key, value=value, allowed=allowed, file=scene.file)


def reference_needs(shared: float, gathered: float = 0.0) -> Iterator[tuple[str, MemoryRequest]]:
    """Yield what of a reference takes memory, and how much.

    Args:
        shared: See `ReferenceMeshes.bytes`.
        gathered: See `ReferenceMeshes.gathered`.
    """
    yield "the reference", MemoryRequest(shared=shared)
    yield "gmsh on rank 0, which meshes the reference,", MemoryRequest(once=gathered)


def _check_memory(
    scene: Scene, key: str, nodes: ClusterNodes, shared: float, gathered: float = 0.0
) -> None:
    for what, need in reference_needs(shared, gathered):
        if not nodes.fit(need):
            raise InputError(
                f"{what} needs about {need.alone / 1e9:.3g} GB of memory",
                key=key,
                value=scene.reference.cells or scene.reference.fine,
                allowed=f"what fits into {nodes.room(need)}; or fewer reference.meshes",
                file=scene.file,
            )


def _least_bytes(surface: Surface, reach: float, tilt: tuple[float, float], fine: float) -> float:
    """Return the memory that nodes of the top within reach take alone [B]."""
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    lean = tilt[0] * (x - 0.5 * surface.lengths[0]) + tilt[1] * (y - 0.5 * surface.lengths[1])
    inside = surface.heights > surface.highest - reach - lean
    return float(3.0 * BYTES_PER_UNKNOWN[1] * surface.area * inside.mean() / fine / fine)


def _unknowns(shape: Shape) -> int:
    """Return the degrees of freedom of a mesh; of tetrahedra what their sizes let expect."""
    if isinstance(shape, BlockShape):
        nodes = [shape.degree * (len(ticks) - 1) + 1 for ticks in shape.ticks]
        return 3 * int(np.prod(nodes, dtype=float))
    return round(3.0 * _NODES[shape.degree] * _cubes(shape))


def _cubes(shape: RefinedShape) -> float:
    """Return the number of cubes as large as the edges at their place that fill a block."""
    counts = [
        int(np.clip(np.ceil(length / shape.fine), 8, _MOST_LATTICE)) for length in shape.interface
    ]
    spacing = np.divide(shape.interface, counts)
    away = np.ones(counts, dtype=bool)
    near = np.minimum((shape.places / spacing).astype(int), np.array(counts) - 1)
    away[near[:, 0], near[:, 1]] = False
    beside = np.asarray(distance_transform_edt(away, sampling=spacing))
    # layers as thick as the elements under the places
    depths, total = [0.0], 0.0
    while depths[-1] < shape.height and _edge(shape, depths[-1]) < shape.coarse:
        depths.append(min(depths[-1] + 0.5 * _edge(shape, depths[-1]), shape.height))
    for above, below in pairwise(depths):
        distance = np.hypot(beside, 0.5 * (above + below))
        total += (below - above) * float(np.sum(_edge(shape, distance) ** -3.0))
    total += (shape.height - depths[-1]) * beside.size * shape.coarse**-3.0  # all alike below
    return total * float(np.prod(spacing))


def _edge(shape: RefinedShape, distance: Any) -> Any:
    """Return the edge length at a distance from the places of contact [mm]."""
    grown = shape.fine + shape.growth * np.maximum(distance - 2.0 * shape.fine, 0.0)
    return np.minimum(grown, shape.coarse)
