"""Distributed dolfinx meshes of blocks with marked faces, by gmsh or as a lattice."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.errors import InputError
from geometry.meshes.block import BlockShape
from geometry.meshes.lattice_parts import (
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

Builder: TypeAlias = Literal["auto", "gmsh", "lattice"]

GMSH_CELLS = 20_000
"""Largest number of cells of a flat block that gmsh meshes by default; it takes 0.1 s longer."""

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


def block_mesh(shape: BlockShape | RefinedShape, comm: Any, builder: Builder = "auto") -> BlockMesh:
    """Mesh a block, distributed over all ranks.

    gmsh meshes the whole block on rank 0, and dolfinx distributes it, so that time and memory of
    rank 0 grow with the whole mesh. Flat blocks can also be made as a lattice, with exactly the
    same cells, faces and nodes: every rank makes a box of cells of its own.

    Args:
        shape: Size, cells and element of the block.
        comm: MPI communicator that the mesh will live on.
        builder: ``"gmsh"``, ``"lattice"``, or ``"auto"``: gmsh up to `GMSH_CELLS` cells and for
            refined blocks, the lattice for larger flat ones.

    Raises:
        InputError: When the builder is unknown or cannot make the shape. Errors of gmsh on rank 0
            are raised on every rank.

    Note:
        Collective. By gmsh rank 0 spends 1 s and 0.11 GB on 10⁵ hexahedra and 11 s and 1.1 GB on
        10⁶; a fiftieth of that is spent in gmsh, the rest on the transfer to dolfinx. A lattice
        takes 0.3 s and 0.07 GB, and 2.7 s and 0.7 GB; 3·10⁶ hexahedra on two ranks take 5 s and
        1.1 GB each. Four fifths are spent on dolfinx' topology and geometry, a sixth on facets.
    """
    if builder not in get_args(Builder):
        raise InputError(
            "this builder of meshes is unknown",
            value=builder,
            allowed=", ".join(get_args(Builder)),
        )
    if isinstance(shape, BlockShape):
        if builder == "lattice" or (builder == "auto" and shape.cell_count > GMSH_CELLS):
            return _from_lattice(shape, comm)
    elif builder == "lattice":
        raise InputError("only flat blocks are lattices", value=builder, allowed="auto, gmsh")
    return _from_gmsh(shape, comm)


def _from_gmsh(shape: BlockShape | RefinedShape, comm: Any) -> BlockMesh:
    with ExitStack() as gmsh_session:
        models: list[Any] = []
        on_root(comm, lambda: models.append(gmsh_session.enter_context(shape.meshed())))
        mesh, facet_tags = compat.mesh_from_gmsh(models[0] if models else None, comm)
    planes = None
    if isinstance(shape, BlockShape):
        planes = _onto_planes(shape, mesh.geometry.x)
    else:
        mesh.geometry.x[:] *= shape.unit
    return BlockMesh(mesh=mesh, facet_tags=facet_tags, shape=shape, planes=planes)


def _onto_planes(shape: BlockShape, points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Move points of a flat block, which gmsh places to 1e-9, onto the nearest grid planes.

    Returns:
        Indices of these planes, shape (n, 3).
    """
    planes = np.empty(points.shape, dtype=np.intp)
    for axis, ticks in enumerate(shape.ticks):
        planes[:, axis] = np.searchsorted(0.5 * (ticks[1:] + ticks[:-1]), points[:, axis])
        points[:, axis] = ticks[planes[:, axis]]
    return planes


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
