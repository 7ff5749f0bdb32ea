"""Meshes of a block whose top is the rough surface itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.meshes import BlockShape
from geometry.refined_block import RefinedShape
from geometry.surface import Surface
from macro import compat
from macro.mesh import BlockMesh, block_mesh

Array = NDArray[np.float64]

_DECAY = 3.0
"""Power of the distance from the bottom with which the roughness fades into the depth."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshQuality:
    """How far the roughness has deformed the cells.

    Attributes:
        thinnest: Smallest height of a vertical edge relative to that of the flat block.
        steepest: Largest slope of an edge of the top.
    """

    thinnest: float
    steepest: float


def rough_block_mesh(
    shape: BlockShape | RefinedShape, surface: Surface, comm: Any
) -> tuple[BlockMesh, MeshQuality]:
    """Mesh a flat block and move its nodes onto the roughness.

    The top becomes z = h(x, y) − <h>, from the surface's interpolant at the nodes; below, the
    movement fades as (1 + z/height)³. Every rank moves the nodes that it has.

    Args:
        shape: The flat block, without margin; its interface is the surface's rectangle.
        surface: The rough surface.
        comm: MPI communicator.

    Raises:
        InputError: When the rectangles differ, or the roughness is too high for the block and
            turns a cell inside out.

    Note:
        Collective.
    """
    if shape.margin or not np.allclose(shape.interface, surface.lengths, rtol=1e-9, atol=0.0):
        raise InputError(
            "the rough surface must cover the block's top",
            value=shape.interface,
            allowed=f"an interface of {surface.lengths} mm without margin",
        )
    flat = block_mesh(shape, comm)
    points = flat.mesh.geometry.x
    x, y = (np.clip(points[:, k], 0.0, surface.lengths[k]) for k in (0, 1))
    rise = surface.height_at(x, y) - surface.mean_height if len(points) else np.empty(0)
    # the vertical strain of the movement is largest at the top
    lowest = np.min(1.0 + _DECAY * rise / shape.height, initial=1.0)
    quality = MeshQuality(
        thinnest=float(comm.allreduce(float(lowest), op=MPI.MIN)),
        steepest=float(comm.allreduce(_steepest(flat, rise), op=MPI.MAX)),
    )
    if quality.thinnest <= 0.05:
        raise InputError(
            "the roughness is too high for the block: cells would turn inside out",
            value=float(np.ptp(surface.heights)),
            allowed=f"heights well below {shape.height / _DECAY:g} mm below their mean",
        )
    points[:, 2] += rise * (1.0 + points[:, 2] / shape.height) ** _DECAY
    return flat, quality


def _steepest(flat: BlockMesh, rise: Array) -> float:
    """Return the largest slope between horizontal neighbours on the top."""
    points = flat.mesh.geometry.x
    cells = compat.cell_vertices(flat.mesh)
    top = np.abs(points[:, 2]) < 1e-9 * flat.shape.height
    steepest = 0.0
    for i in range(cells.shape[1]):
        for j in range(i):
            a, b = cells[:, i], cells[:, j]
            both = top[a] & top[b]
            run = np.hypot(*(points[a[both], k] - points[b[both], k] for k in (0, 1)))
            slope = np.abs(rise[a[both]] - rise[b[both]]) / run
            steepest = max(steepest, float(slope.max(initial=0.0)))
    return steepest
