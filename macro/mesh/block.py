"""Distributed dolfinx meshes of blocks with marked faces, by gmsh or as a lattice."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from geometry.meshes.block import BlockShape
from geometry.meshes.lattice import (
    cells_beyond,
    lattice_cells,
    lattice_part,
    node_planes,
    node_share,
)
from geometry.meshes.refined_block import RefinedShape
from geometry.meshes.stepped import SteppedShape
from macro import compat
from macro.mesh.tagged import TaggedMesh
from support.collective import on_root
from support.errors import InputError

BOTTOM, TOP, SIDES = 1, 2, 3
"""Markers of the block's faces: z = −height, z = 0, and the four planes between them."""

FLAT = 1e-9
"""Distance from a face, relative to the size of a body that was meshed here, that is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockMesh:
    """A block's mesh, distributed over the ranks of a communicator.

    Args:
        mesh: The dolfinx mesh; lengths in mm.
        facet_tags: Its outer facets that this rank owns, marked BOTTOM, TOP or SIDES.
        shape: The shape that was meshed.
        planes: Indices of the grid planes across x, y and z that every row of ``mesh.geometry.x``
            lies on in the flat block, shape (n, 3); None for meshes without grid planes.
    """

    mesh: Any
    facet_tags: Any
    shape: BlockShape | RefinedShape
    planes: NDArray[np.intp] | None = None

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.mesh.comm


def block_mesh(shape: BlockShape | RefinedShape, comm: Any) -> BlockMesh:
    """Mesh a block, distributed over all ranks.

    A flat block is a lattice, of which every rank makes a box of cells of its own. A refined block
    is meshed whole by gmsh on rank 0 and distributed by dolfinx, so that time and memory of rank 0
    grow with the whole mesh.

    Args:
        shape: Size, cells and element of the block.
        comm: MPI communicator that the mesh will live on.

    Raises:
        InputError: When gmsh cannot make the shape. Errors of gmsh on rank 0 are raised on every
            rank.

    Note:
        Collective. A lattice of 10⁵ hexahedra takes 0.3 s and 0.07 GB, one of 10⁶ 2.7 s and 0.7 GB;
        3·10⁶ hexahedra on two ranks take 5 s and 1.1 GB each. Four fifths are spent on dolfinx'
        topology and geometry, a sixth on facets.
    """
    if isinstance(shape, BlockShape):
        return _from_lattice(shape, comm)
    mesh = _from_gmsh(shape, comm)
    return BlockMesh(mesh=mesh, facet_tags=_faces(mesh, shape.height), shape=shape)


def _from_gmsh(shape: RefinedShape | SteppedShape, comm: Any) -> Any:
    """Return the mesh that gmsh makes on rank 0, distributed."""
    with ExitStack() as gmsh_session:
        models: list[Any] = []
        on_root(comm, lambda: models.append(gmsh_session.enter_context(shape.meshed())))
        mesh = compat.mesh_from_gmsh(models[0] if models else None, comm)
    mesh.geometry.x[:] *= shape.unit
    return mesh


def _outer_facets(mesh: Any) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the outer facets of this rank, shape (n,), and their middles (n, 3) [mm]."""
    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    return facets, dmesh.compute_midpoints(mesh, 2, facets)


def _from_lattice(shape: BlockShape, comm: Any) -> BlockMesh:
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
    return BlockMesh(
        mesh=mesh,
        facet_tags=_faces(mesh, shape.height),
        shape=shape,
        planes=node_planes(counts, numbers),
    )


def _faces(mesh: Any, height: float) -> Any:
    """Return the outer facets of this rank, marked by the height of their middles."""
    facets, middles = _outer_facets(mesh)
    level = middles[:, 2] / height
    markers = np.select([level < -1.0 + FLAT, level > -FLAT], [BOTTOM, TOP], SIDES)
    return dmesh.meshtags(mesh, 2, facets, markers.astype(np.int32))


ROUGH = "rough"
"""Name of the contact face."""


def stepped_mesh(
    shape: SteppedShape, planes: Mapping[str, tuple[int, float]], comm: Any
) -> TaggedMesh:
    """Mesh a block on boxes, distributed over all ranks.

    Args:
        shape: The body and its cells.
        planes: Surfaces to mark, such as those of supports: by name the axis that a plane is
            perpendicular to (0, 1, 2) and its coordinate [mm]. The contact face is marked as
            ``ROUGH``.
        comm: MPI communicator that the mesh will live on.

    Raises:
        InputError: When gmsh cannot make the body, or no facet lies in a plane.

    Note:
        Collective. It is meshed whole on rank 0, as refined blocks are.
    """
    mesh = _from_gmsh(shape, comm)
    facets, middles = _outer_facets(mesh)
    markers, names = np.zeros(len(facets), dtype=np.int32), {}
    for number, (name, (axis, at)) in enumerate({ROUGH: (2, 0.0), **planes}.items(), start=1):
        inside = np.abs(middles[:, axis] - at) < FLAT * shape.unit
        if not comm.allreduce(int(inside.sum())):
            raise InputError(
                f"no outer facet lies in the plane {name!r}", value=at, allowed="a face of the body"
            )
        markers[inside], names[name] = number, number
    marked = markers > 0
    tags = dmesh.meshtags(mesh, 2, facets[marked], markers[marked])
    return TaggedMesh(mesh=mesh, facet_tags=tags, facet_names=names)
