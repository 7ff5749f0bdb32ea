"""Distributed dolfinx meshes of blocks with marked faces, by gmsh or as a lattice."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from geometry.collective import on_root
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

BOTTOM, TOP, SIDES = 1, 2, 3
"""Markers of the block's faces: z = −height, z = 0, and the four planes between them."""

_FACES = np.array([1, 2, 4, 8, 16, 32], dtype=np.uint8).reshape(3, 2)
"""Bits of a lattice's faces: the first and the last plane across x, y and z."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockMesh:
    """A block's mesh, distributed over the ranks of a communicator.

    Args:
        mesh: The dolfinx mesh; lengths in mm.
        facet_tags: Its facets marked BOTTOM, TOP or SIDES; may include ghosts.
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
    with ExitStack() as gmsh_session:
        models: list[Any] = []
        on_root(comm, lambda: models.append(gmsh_session.enter_context(shape.meshed())))
        mesh, facet_tags = compat.mesh_from_gmsh(models[0] if models else None, comm)
    mesh.geometry.x[:] *= shape.unit
    return BlockMesh(mesh=mesh, facet_tags=facet_tags, shape=shape)


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
    planes = node_planes(counts, numbers)
    facets, markers = _marked(mesh, _on_faces(planes, counts))
    tags = dmesh.meshtags(mesh, 2, facets, markers)
    return BlockMesh(mesh=mesh, facet_tags=tags, shape=shape, planes=planes)


def _on_faces(planes: NDArray[np.intp], counts: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Return the bits of the faces that nodes lie on, shape (n,)."""
    first, last = _FACES.T
    bits = np.where(planes == 0, first, 0) | np.where(planes == counts, last, 0)
    return np.bitwise_or.reduce(bits.astype(np.uint8), axis=1)


def _marked(mesh: Any, faces: NDArray[np.uint8]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return this rank's facets on the block's faces, ascending, and their markers."""
    topology = mesh.topology
    topology.create_connectivity(3, 2)
    topology.create_connectivity(2, 3)  # dolfinx' functions for facets need it
    _, corners = compat.reference_facets(topology.cell_name())
    vertices = faces[compat.cell_vertices(mesh)]
    outer = np.flatnonzero(vertices.any(axis=1))
    # a facet lies on the face that all its vertices lie on
    on = np.bitwise_and.reduce(vertices[outer][:, corners], axis=2)
    facets = topology.connectivity(3, 2).array.reshape(-1, len(corners))[outer][on > 0]
    (bottom, top), on = _FACES[2], on[on > 0]
    markers = np.select([on == bottom, on == top], [BOTTOM, TOP], SIDES).astype(np.int32)
    order = np.argsort(facets)
    return facets[order], markers[order]
