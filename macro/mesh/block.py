"""Distributed dolfinx meshes of blocks with marked faces, by gmsh or as a lattice."""

from __future__ import annotations

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
from macro import compat
from macro.mesh.tagged import TaggedMesh
from support.collective import on_root

BOTTOM, TOP, SIDES = 1, 2, 3
"""Markers of the block's faces: z = −height, z = 0, and the four planes between them."""

FLAT = 1e-9
"""Distance from a face, relative to the size of a body that was meshed here, that is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockMesh(TaggedMesh):
    """A block's mesh, its facets marked BOTTOM, TOP or SIDES.

    Args:
        shape: The shape that was meshed.
        planes: Indices of the grid planes across x, y and z that every row of ``mesh.geometry.x``
            lies on in the flat block, shape (n, 3); None for meshes without grid planes.
    """

    shape: BlockShape | RefinedShape
    planes: NDArray[np.intp] | None = None


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
    planes = None
    if isinstance(shape, BlockShape):
        mesh, planes = _from_lattice(shape, comm)
    else:
        with ExitStack() as gmsh_session:
            models: list[Any] = []
            on_root(comm, lambda: models.append(gmsh_session.enter_context(shape.meshed())))
            mesh = compat.mesh_from_gmsh(models[0] if models else None, comm)
        mesh.geometry.x[:] *= shape.unit
    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    level = dmesh.compute_midpoints(mesh, 2, facets)[:, 2] / shape.height
    markers = np.select([level < -1.0 + FLAT, level > -FLAT], [BOTTOM, TOP], SIDES)
    tags = dmesh.meshtags(mesh, 2, facets, markers.astype(np.int32))
    return BlockMesh(mesh=mesh, facet_tags=tags, shape=shape, planes=planes)


def _from_lattice(shape: BlockShape, comm: Any) -> tuple[Any, NDArray[np.intp]]:
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
