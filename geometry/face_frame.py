"""Coordinates in the plane of a contact face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]

_ALONG_X = np.cos(np.radians(30.0))
"""Cosine of the angle to the x axis below which a normal counts as along it."""
_RIGHT_ANGLES = 1e-9
"""Largest deviation of axes from unit length and right angles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceFrame:
    """Coordinates (x, y) in the plane of a contact face, and heights above it.

    Args:
        origin: Where both coordinates are zero, shape (3,) [mm].
        axes: Unit vectors along x and y and of the normal out of the body, as rows, right-handed,
            shape (3, 3).

    Raises:
        InputError: When the axes are no right-handed system of unit vectors.
    """

    origin: Array
    axes: Array

    def __post_init__(self) -> None:
        origin, axes = np.array(self.origin, float), np.array(self.axes, float)
        turned = axes.shape == (3, 3) and np.allclose(
            axes @ axes.T, np.eye(3), rtol=0.0, atol=_RIGHT_ANGLES
        )
        if not turned or np.linalg.det(axes) < 0.0 or origin.shape != (3,):
            raise InputError(
                "the axes of a face do not fit",
                value=axes.tolist(),
                allowed="three unit vectors at right angles, right-handed",
            )
        object.__setattr__(self, "origin", origin)
        object.__setattr__(self, "axes", axes)

    @classmethod
    def through(cls, points: ArrayLike, normal: ArrayLike) -> Self:
        """Return the usual frame of a face: x as near to the global x axis as the plane allows.

        Where the normal is along the global x axis, within 30 degrees, x is near the global y
        axis. The origin is the lower corner of the smallest rectangle along these axes that holds
        the points, at the height of the highest point.

        Args:
            points: Points of the face, shape (n, 3) [mm].
            normal: Normal out of the body, of any length, shape (3,).
        """
        places = np.asarray(points, float)
        n = np.asarray(normal, float) / np.linalg.norm(normal)
        along = np.eye(3)[1] if abs(n[0]) > _ALONG_X else np.eye(3)[0]
        first = along - (along @ n) * n
        first /= np.linalg.norm(first)
        axes = np.stack([first, np.cross(n, first), n])
        offset = places @ axes.T
        corner = np.array([*offset[:, :2].min(axis=0), offset[:, 2].max()])
        return cls(origin=corner @ axes, axes=axes)

    @property
    def normal(self) -> Array:
        """Unit normal out of the body, shape (3,)."""
        return np.asarray(self.axes[2])

    def in_plane(self, points: Array) -> Array:
        """Return the coordinates (x, y) of points of shape (…, 3), shape (…, 2) [mm]."""
        return np.asarray((points - self.origin) @ self.axes[:2].T)

    def height(self, points: Array) -> Array:
        """Return the heights of points of shape (…, 3) above the plane, shape (…) [mm]."""
        return np.asarray((points - self.origin) @ self.normal)

    def moved(self, x: float, y: float) -> FaceFrame:
        """Return the same frame with its origin at a point of the plane [mm]."""
        return FaceFrame(origin=self.origin + np.array([x, y]) @ self.axes[:2], axes=self.axes)


UPWARD = FaceFrame(origin=np.zeros(3), axes=np.eye(3))
"""The frame of a block's top: the coordinates x and y themselves."""
