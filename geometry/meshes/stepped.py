"""A block that stands on boxes, such as an L or a pad on its back plate, small cells at its top."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.meshes.refined_block import RefinedShape, refined_solid
from support.errors import InputError

Array = NDArray[np.float64]

_TOUCH = 1e-9
"""Distance between a block's bottom and its boxes, relative to the block's height: rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SteppedShape:
    """A block, its top the contact face, joined to boxes below it.

    The block occupies [0, Lx] × [0, Ly] × [−height, 0]; its sides are free over its whole height.
    Cells grow with the distance from the places on its top, and near the edges where the block
    stands on the boxes.

    Args:
        block: The block under the contact face, and the sizes of the cells.
        boxes: Lower and upper corners of the boxes, shape (n, 2, 3) [mm]. They lie below the
            block's bottom, and all together are one body.

    Raises:
        InputError: When a box has no volume, or reaches above the block's bottom.
    """

    block: RefinedShape
    boxes: Array

    def __post_init__(self) -> None:
        boxes = np.asarray(self.boxes, float)
        object.__setattr__(self, "boxes", boxes)
        if boxes.ndim != 3 or boxes.shape[1:] != (2, 3) or not len(boxes):
            raise InputError("boxes have two corners", value=boxes.shape, allowed="(n, 2, 3)")
        if not (np.isfinite(boxes).all() and np.all(boxes[:, 0] < boxes[:, 1])):
            problem = "a box has no volume"
            raise InputError(problem, value=boxes.tolist(), allowed="lower corner < upper corner")
        bottom = -self.block.height
        if np.any(boxes[:, 1, 2] > bottom * (1.0 - _TOUCH)):
            raise InputError(
                "a box reaches above the bottom of the block that stands on it",
                value=float(boxes[:, 1, 2].max()),
                allowed=f"z ≤ {bottom:g} mm",
            )

    @property
    def degree(self) -> int:
        """Polynomial degree of the element."""
        return self.block.degree

    @property
    def fine(self) -> float:
        """Edge length where contact can occur [mm]."""
        return self.block.fine

    @property
    def unit(self) -> float:
        """Length that gmsh meshes the body in, its largest extent [mm]."""
        corners = np.concatenate([self.boxes.reshape(-1, 3), np.zeros((1, 3))])
        return max(self.block.unit, float(np.ptp(corners, axis=0).max()))

    @contextmanager
    def meshed(self) -> Iterator[Any]:
        """Mesh the body in gmsh for as long as the context lasts; see `RefinedShape.meshed`.

        Raises:
            InputError: When block and boxes are not one body.
        """
        with refined_solid(self.block, self.unit, self.boxes) as model:
            yield model
