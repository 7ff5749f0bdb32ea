"""Distributed dolfinx meshes of blocks with marked faces, flat and rough.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh

from patchlaw.geometry import BlockShape, RefinedShape, Surface
from patchlaw.geometry.meshes.bisection import Tetrahedra, with_middles
from patchlaw.geometry.meshes.block import (
    cells_beyond,
    lattice_cells,
    lattice_part,
    node_planes,
    node_share,
)
from patchlaw.macro import compat
from patchlaw.macro.mesh.facets import exterior_facets
from patchlaw.macro.mesh.tagged import TaggedMesh
from patchlaw.support import Array, Indices, InputError, on_root

BOTTOM, TOP, SIDES = 1, 2, 3
"""Markers of the block's faces: z = −height, z = 0, and the four planes between them."""

FLAT = 1e-9
"""Distance from a face, relative to the size of a body that was meshed here, that is rounding."""

_DECAY = 3.0
"""Power of the height above the bottom with which the roughness decays into the depth."""

_LEAST_VOLUME = 0.05
"""Smallest volume of a cell relative to that in the flat block; smaller cells are refused."""

_STEEPEST = 2.0
"""Largest slope between neighbouring nodes; steeper tops are refused (edges 27° apart)."""

_EDGES = np.array([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])
"""Ends of a quadratic tetrahedron's edges, in dolfinx's order of the nodes 4 … 9 between them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockMesh(TaggedMesh):
    """A block's mesh, its facets marked BOTTOM, TOP or SIDES.

    Args:
        shape: The shape that was meshed.
        planes: Indices of the grid planes across x, y and z that every row of ``mesh.geometry.x``
            lies on in the flat block, shape (n, 3); None for meshes without grid planes.
    """

    shape: BlockShape | RefinedShape
    planes: Indices | None = None


def block_mesh(shape: BlockShape | RefinedShape, comm: Any) -> BlockMesh:
    """Mesh a block, distributed over all ranks.

    A flat block is a lattice, of which every rank makes a box of cells of its own. A refined block
    is meshed whole on rank 0 and distributed by dolfinx, so that time and memory of rank 0 grow
    with the whole mesh.

    Args:
        shape: Size, cells and element of the block.
        comm: MPI communicator that the mesh will live on.

    Raises:
        InputError: When the shape cannot be meshed; on every rank.

    Note:
        Collective. A lattice of 10⁵ hexahedra takes 0.3 s and 0.07 GB, one of 10⁶ 2.7 s and 0.7 GB;
        3·10⁶ hexahedra on two ranks take 5 s and 1.1 GB each. Four fifths are spent on dolfinx'
        topology and geometry, a sixth on facets.
    """
    planes = None
    if isinstance(shape, BlockShape):
        mesh, planes = _from_lattice(shape, comm)
    else:
        whole: list[Tetrahedra] = []
        on_root(comm, lambda: whole.append(shape.meshed()))
        mesh = distributed(whole[0] if whole else None, shape.degree, comm)
    facets = exterior_facets(mesh)
    level = dmesh.compute_midpoints(mesh, 2, facets)[:, 2] / shape.height
    markers = np.select([level < -1.0 + FLAT, level > -FLAT], [BOTTOM, TOP], SIDES)
    tags = dmesh.meshtags(mesh, 2, facets, markers.astype(np.int32))
    return BlockMesh(mesh=mesh, facet_tags=tags, shape=shape, planes=planes)


def distributed(whole: Tetrahedra | None, degree: int, comm: Any) -> Any:
    """Return the dolfinx mesh of tetrahedra that rank 0 has, with nodes in their edges on request.

    Args:
        whole: The mesh; None but on rank 0.
        degree: 1, or 2 for nodes in the middles of edges, which can be moved.
        comm: MPI communicator.

    Note:
        Collective.
    """
    if whole is None:
        points, cells = np.empty((0, 3)), np.empty((0, {1: 4, 2: 10}[degree]), np.int64)
    else:
        points, cells = with_middles(whole) if degree == 2 else (whole.points, whole.cells)
    return compat.mesh_from_cells(cells, points, None, comm)


def _from_lattice(shape: BlockShape, comm: Any) -> tuple[Any, Indices]:
    """Return the mesh of a lattice, and the planes that its nodes lie on."""
    x, y, z = ticks = shape.ticks
    counts = (len(x) - 1, len(y) - 1, len(z) - 1)
    part = lattice_part(counts, comm.size, comm.rank)
    cells = lattice_cells(counts, part, hexahedra=shape.hexahedral)
    boxes, others = cells_beyond(counts, comm.size, part)
    if not shape.hexahedral:
        boxes, others = (6 * boxes[:, None] + np.arange(6)).ravel(), np.repeat(others, 6)
    points = node_share(ticks, comm.size, comm.rank)
    mesh = compat.mesh_from_cells(cells, points, (boxes, others), comm)
    numbers = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)  # empty lists too
    return mesh, node_planes(counts, numbers)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshQuality:
    """How far the roughness has deformed the cells.

    Attributes:
        thinnest: Smallest volume at a node of a cell (the Jacobian of its map), relative to that
            of the flat block; negative in a cell turned inside out.
        steepest: Largest slope of an edge of the top.
    """

    thinnest: float
    steepest: float


def rough_block_mesh(
    shape: BlockShape | RefinedShape, surface: Surface, comm: Any
) -> tuple[BlockMesh, MeshQuality]:
    """Mesh a flat block and move its nodes onto the roughness.

    The top becomes z = h(x, y) − <h>, with the surface's interpolant h at the nodes. Below the top
    the movement decays as (1 + z/height)³. Every rank moves its own nodes.

    The edges of quadratic tetrahedra bend with the roughness. They stay straight in the few cells
    that bending would turn inside out: cells far from contact that are long beside its waves.

    Along a vertical line the movement keeps the order of points if the deepest valley lies less
    than height/3 below the mean. Hexahedra have vertical sides and then stay valid; tetrahedra are
    checked one by one.

    Args:
        shape: The flat block, without margin; its interface is the surface's rectangle.
        surface: The rough surface.
        comm: MPI communicator.

    Raises:
        InputError: When the rectangles differ, a valley is too deep for the block, the roughness
            is too steep for the mesh, or it turns a cell inside out.

    Note:
        Collective.
    """
    if shape.margin or not np.allclose(shape.interface, surface.lengths, rtol=1e-9, atol=0.0):
        raise InputError(
            "the rough surface must cover the block's top",
            value=shape.interface,
            allowed=f"an interface of {surface.lengths} mm without margin",
        )
    _check_depth(shape.height, surface)
    flat = block_mesh(shape, comm)
    return flat, move_onto(flat.mesh, surface, shape.height)


def move_onto(mesh: Any, surface: Surface, depth: float) -> MeshQuality:
    """Move the nodes around a planar face onto the roughness; see `rough_block_mesh`.

    The rough part of the face is the rectangle [0, Lx] × [0, Ly] at z = 0. The movement decays into
    the depth, and beside the rectangle within half of its shorter side.

    Args:
        mesh: The dolfinx mesh of a body with a flat face.
        surface: The rough surface, which covers the rectangle.
        depth: Depth below the face from which on nothing moves [mm].

    Raises:
        InputError: When a valley is too deep for the body, the roughness is too steep for the mesh,
            or it turns a cell inside out.

    Note:
        Collective.
    """
    points, comm = mesh.geometry.x, mesh.comm
    _check_depth(depth, surface)
    places = np.clip(points[:, :2], 0.0, surface.lengths)
    rise = surface.height_at(*places.T) - surface.mean_height if len(points) else np.empty(0)
    beside = np.linalg.norm(points[:, :2] - places, axis=1) / (0.5 * min(surface.lengths))
    rise = rise * np.maximum(1.0 - beside, 0.0) ** _DECAY
    moved = points.copy()
    moved[:, 2] += rise * np.maximum(1.0 - np.abs(points[:, 2]) / depth, 0.0) ** _DECAY
    if compat.geometry_degree(mesh) == 2:
        _straighten(mesh, moved)
    quality = MeshQuality(
        thinnest=float(comm.allreduce(_volumes(mesh, moved).min(initial=np.inf), min)),
        steepest=float(comm.allreduce(_steepest(mesh, depth, rise), max)),
    )
    if quality.steepest > _STEEPEST:
        raise InputError(
            "the roughness is too steep for a mesh",
            value=quality.steepest,
            allowed=f"slopes up to {_STEEPEST:g} between neighbouring nodes of the top",
        )
    if quality.thinnest <= _LEAST_VOLUME:
        raise InputError(
            "the roughness turns cells inside out, which are much longer than its waves",
            value=quality.thinnest,
            allowed=f"cells that keep {_LEAST_VOLUME:.0%} of their volume at every node",
        )
    points[:] = moved
    return quality


def _check_depth(depth: float, surface: Surface) -> None:
    valley = surface.mean_height - float(surface.heights.min())
    deepest = (1.0 - _LEAST_VOLUME) * depth / _DECAY
    if valley > deepest:
        raise InputError(
            "a valley of the roughness is too deep for the body",
            value=valley,
            allowed=f"{deepest:.6g} mm below the mean, where the body is {depth:g} mm thick",
        )


def _straighten(mesh: Any, moved: Array) -> None:
    """Move the middle nodes of edges onto the chord in cells that bend too much, on all ranks.

    They are those that bending leaves less than 0.3 of their volume at a node.
    """
    cells, names = compat.cell_vertices(mesh), mesh.geometry.input_global_indices
    done: Array = np.empty(0, dtype=np.int64)
    while True:
        middles = cells[:, 4:]
        bent = np.unique(np.asarray(names)[middles[_volumes(mesh, moved) < 0.3]])
        straight = np.union1d(done, np.concatenate(mesh.comm.allgather(bent)))
        if len(straight) == len(done):
            return
        done = straight
        cell, edge = np.nonzero(np.isin(np.asarray(names)[middles], done))
        ends = cells[cell[:, None], _EDGES[edge]]
        moved[middles[cell, edge], 2] = moved[ends, 2].mean(axis=1)


def _volumes(mesh: Any, moved: Array) -> Array:
    """Return each cell's smallest ratio of the volumes at its nodes after and before a movement.

    Nodes move along z alone, which changes one row of the Jacobian matrix.
    """
    cells, points = compat.cell_vertices(mesh), mesh.geometry.x
    x, y, before, after = (row[cells] for row in (*points.T, moved[:, 2]))
    smallest = np.full(len(cells), np.inf)
    degree = compat.geometry_degree(mesh)
    for slopes in compat.lagrange_gradients(mesh.topology.cell_name(), degree):
        normal = np.cross(x @ slopes, y @ slopes)
        volumes = (np.einsum("ci,ci->c", normal, z @ slopes) for z in (after, before))
        np.minimum(smallest, np.divide(*volumes), out=smallest)
    return smallest


def _steepest(mesh: Any, depth: float, rise: Array) -> float:
    """Return the largest slope between horizontal neighbours on the top."""
    points = mesh.geometry.x
    cells = compat.cell_vertices(mesh)
    top = np.abs(points[:, 2]) < FLAT * depth
    cells = cells[top[cells].any(axis=1)]
    i, j = np.triu_indices(cells.shape[1], 1)
    a, b = cells[:, i].ravel(), cells[:, j].ravel()
    both = top[a] & top[b]
    a, b = a[both], b[both]
    run = np.linalg.norm(points[a, :2] - points[b, :2], axis=1)
    return float((np.abs(rise[a] - rise[b]) / run).max(initial=0.0))
