"""Turns a gmsh block into a distributed dolfinx mesh with marked faces."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.meshes import BlockShape
from geometry.refined_block import RefinedShape
from macro import compat

BOTTOM, TOP, SIDES = 1, 2, 3
"""Markers of the block's faces: z = −height, z = 0, and the four planes between them."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockMesh:
    """A block's mesh, distributed over the ranks of a communicator.

    Args:
        mesh: The dolfinx mesh; lengths in mm.
        facet_tags: Its facets marked BOTTOM, TOP or SIDES; may include ghosts.
        shape: What was meshed.
        planes: Which grid planes across x, y and z met at every row of ``mesh.geometry.x`` when
            the block was flat, shape (n, 3); None for meshes without grid planes.
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
    """Mesh a block with gmsh on rank 0 and distribute it.

    Args:
        shape: Size, cells and element of the block.
        comm: MPI communicator that the mesh will live on.

    Raises:
        InputError: Whatever gmsh's part of the work raised on rank 0, on every rank.

    Note:
        Collective.
    """
    with ExitStack() as gmsh_session:
        models: list[Any] = []
        on_root(comm, lambda: models.append(gmsh_session.enter_context(shape.meshed())))
        mesh, facet_tags = compat.mesh_from_gmsh(models[0] if models else None, comm)
    planes = _planes(shape, mesh.geometry.x) if isinstance(shape, BlockShape) else None
    return BlockMesh(mesh=mesh, facet_tags=facet_tags, shape=shape, planes=planes)


def _planes(shape: BlockShape, points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the indices of the grid planes next to points of a flat block, shape (n, 3)."""
    borders = (0.5 * (ticks[1:] + ticks[:-1]) for ticks in shape.ticks)
    return np.stack([np.searchsorted(at, points[:, k]) for k, at in enumerate(borders)], axis=1)
