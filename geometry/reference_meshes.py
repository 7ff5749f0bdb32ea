"""Families of meshes of a rough block, from coarse to fine, whose results can be extrapolated."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from geometry.errors import InputError
from geometry.meshes import BlockShape
from geometry.refined_block import RefinedShape, places_in_reach
from geometry.surface import Surface

Array = NDArray[np.float64]
Shape: TypeAlias = BlockShape | RefinedShape
Cells: TypeAlias = Literal["tetrahedra", "hexahedra"]

_STEP = math.sqrt(2.0)
"""Ratio of the sizes of successive meshes of tetrahedra."""

_ACROSS = 2.5
"""Edges across a typical contact, on the finest mesh, when nothing else is asked for."""


def reference_shapes(
    surface: Surface,
    approach: float,
    height: float,
    *,
    count: int,
    fine: float | None = None,
    tilt: tuple[float, float] = (0.0, 0.0),
    mesh: Cells = "tetrahedra",
    cells: tuple[int, int, int] | None = None,
    grading: float = 8.0,
    element: str | None = None,
) -> tuple[Shape, ...]:
    """Return blocks to mesh, coarse to fine, all of whose sizes fall together.

    Args:
        surface: The rough surface, which covers the block's top.
        approach: Largest approach that the meshes are for [mm].
        height: Height of the block [mm].
        count: Number of meshes.
        fine: Edge length of the finest tetrahedra where contact can occur [mm]; by default
            `suggested_fine`.
        tilt: Slopes of the approach along x and y.
        mesh: ``"tetrahedra"``, small where contact can occur, or ``"hexahedra"`` everywhere.
        cells: Hexahedra of the finest mesh along x, y and over the height.
        grading: Height of the bottom layer of hexahedra relative to the top layer.
        element: ``P1`` or ``P2`` (default) tetrahedra; ``Q1`` (default) or ``Q2`` hexahedra.

    Returns:
        One shape per mesh; `characteristic_size` tells their sizes.

    Raises:
        InputError: When a value is out of its range, or hexahedra come without their number.
    """
    raise NotImplementedError


def characteristic_size(shape: Shape) -> float:
    """Return the edge length of a mesh where contact occurs, by which results are extrapolated.

    Args:
        shape: A block to mesh.

    Returns:
        Length [mm]; of hexahedra, the root of the area of a facet of the interface.
    """
    if isinstance(shape, RefinedShape):
        return shape.fine
    return math.sqrt(math.prod(shape.interface) / math.prod(shape.cells[:2]))


def contact_radius(surface: Surface, approach: float, tilt: tuple[float, float]) -> float:
    """Estimate the radius of a typical contact."""
    raise NotImplementedError
