"""Heights that a scene was given in memory, from Python."""

from __future__ import annotations

import hashlib
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import PlainSerializer, PlainValidator

from support.checks import real_array


class HeightMap:
    """Heights in memory, equal to others with the same numbers; float64 is not copied.

    Args:
        values: Heights, shape (nx, ny); not a number, or masked, where they are missing.

    Raises:
        ValueError: When they are no map of numbers.
    """

    def __init__(self, values: Any) -> None:
        self.values = real_array(values)
        if self.values.ndim != 2:
            raise ValueError("is no map of heights (allowed: numbers with an index [ix, iy])")

    @cached_property
    def digest(self) -> str:
        """Shape and SHA-256, which stand for the heights where a scene is written down."""
        content = np.ascontiguousarray(self.values).tobytes()
        return f"{self.values.shape} {self.values.dtype} {hashlib.sha256(content).hexdigest()}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeightMap) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        nx, ny = self.values.shape
        return f"{nx} × {ny} heights"


def _height_map(value: Any) -> Any:
    return value if value is None or isinstance(value, HeightMap) else HeightMap(value)


HeightsOfArray = Annotated[
    HeightMap | None,
    PlainValidator(_height_map),
    PlainSerializer(
        lambda heights: heights and heights.digest, return_type=str | None, when_used="json"
    ),
]
