"""Coordinates on a planar contact face that lies anywhere in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.support import Array, InputError, frozen_array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceFrame:
    """Rectangular coordinates of a planar face: two in the plane, and the height above it.

    Args:
        origin: Point of the plane that has the coordinates (0, 0), shape (3,) [mm].
        axes: Rows e1, e2 and n: orthonormal, right-handed, n out of the body, shape (3, 3).

    Raises:
        InputError: When the origin is not finite or the axes are no rotation.
    """

    origin: Array
    axes: Array

    def __post_init__(self) -> None:
        origin, axes = frozen_array(self.origin), frozen_array(self.axes)
        if origin.shape != (3,) or not np.isfinite(origin).all():
            raise InputError(
                "the origin of a face is no point",
                value=self.origin,
                allowed="three finite numbers",
            )
        turned = axes.shape == (3, 3) and np.isfinite(axes).all()
        if not turned or np.abs(axes @ axes.T - np.eye(3)).max() > 1e-9 or np.linalg.det(axes) < 0:
            raise InputError(
                "the axes of a face do not fit",
                value=np.asarray(self.axes).tolist(),
                allowed="three orthonormal, right-handed rows e1, e2, n",
            )
        object.__setattr__(self, "origin", origin)
        object.__setattr__(self, "axes", axes)

    @classmethod
    def across(
        cls,
        normal: ArrayLike,
        origin: Sequence[float] | Array = (0, 0, 0),
        along: Sequence[float] | None = None,
    ) -> FaceFrame:
        """Return the frame with the default axes of a normal, or along a direction.

        e1 is the global x axis made perpendicular to the normal n, or the global y axis where n is
        within 30 degrees of ±x; e2 = n × e1. For the top of a block these are x, y and z.

        Args:
            normal: Outward normal, of any length, shape (3,).
            origin: Point of the plane with coordinates (0, 0), shape (3,) [mm].
            along: Direction, of any length, that e1 is instead of x or y, shape (3,).

        Raises:
            InputError: When the normal is no direction, or ``along`` has no part across it.
        """
        n = np.asarray(normal, dtype=float)
        if n.shape != (3,) or not np.isfinite(n).all() or not n.any():
            raise InputError(
                "the normal of a face is no direction",
                value=np.asarray(normal).tolist(),
                allowed="three finite numbers that are not all zero",
            )
        n = n / np.abs(n).max()
        n = n / np.linalg.norm(n)
        n = np.where(np.abs(n) < 1e-12, 0.0, n)  # exactly across an axis but for rounding
        n /= np.linalg.norm(n)
        near_x = abs(n[0]) > np.cos(np.pi / 6.0) + 1e-9  # 30° sharp is not, whatever its rounding
        default = (0.0, 1.0, 0.0) if near_x else (1.0, 0.0, 0.0)
        wanted = np.array(default if along is None else along, dtype=float)
        e1 = wanted - (wanted @ n) * n
        length = np.linalg.norm(e1)
        if not length > 1e-6 * np.linalg.norm(wanted):
            raise InputError(
                "the first axis of a face is along its normal, or no direction",
                value=wanted.tolist(),
                allowed=f"a direction across {np.round(n, 6).tolist()}",
            )
        e1 /= length
        axes = np.stack([e1, np.cross(n, e1), n]) + 0.0  # no negative zeros
        return cls(origin=np.asarray(origin, dtype=float), axes=axes)

    @classmethod
    def through(
        cls, points: ArrayLike, normal: ArrayLike, along: Sequence[float] | None = None
    ) -> FaceFrame:
        """Return the frame of a planar face, with default axes and the face's lower corner.

        The origin is the lower corner of the bounding rectangle of the points in (e1, e2), at the
        height of the highest of them along the normal.

        Args:
            points: Points of the face, of all ranks together, shape (n, 3) [mm].
            normal: Outward normal of the face, of any length, shape (3,).
            along: Direction of the first axis, see `across`.

        Raises:
            InputError: When there are no points, or the axes are no directions.
        """
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        if not len(places):
            raise InputError("a face without points has no frame")
        frame = cls.across(normal, along=along)
        local = places @ frame.axes.T
        corner = np.array([*local[:, :2].min(axis=0), local[:, 2].max()])
        return cls(origin=corner @ frame.axes, axes=frame.axes)

    @property
    def normal(self) -> Array:
        """Unit normal that points out of the body, shape (3,)."""
        return self.axes[2]

    def in_plane(self, points: ArrayLike) -> Array:
        """Return the coordinates along e1 and e2 of points (…, 3) [mm], shape (…, 2) [mm]."""
        return (np.asarray(points, dtype=float) - self.origin) @ self.axes[:2].T

    def height(self, points: ArrayLike) -> Array:
        """Return the heights of points (…, 3) [mm] above the plane, shape (…) [mm]."""
        return (np.asarray(points, dtype=float) - self.origin) @ self.axes[2]

    def in_space(self, places: ArrayLike, height: ArrayLike = 0.0) -> Array:
        """Return the points in space of coordinates in the plane, shape (…, 3) [mm].

        Args:
            places: Coordinates along e1 and e2, shape (…, 2) [mm].
            height: Heights above the plane, shape (…) or a number [mm].
        """
        lifted = np.multiply.outer(np.asarray(height, dtype=float), self.axes[2])
        return self.origin + np.asarray(places, dtype=float) @ self.axes[:2] + lifted

    def moved(self, x: float, y: float) -> FaceFrame:
        """Return the same frame with its origin at a point of the plane.

        Args:
            x: Coordinate of the point along e1 [mm].
            y: Coordinate along e2 [mm].
        """
        return FaceFrame(origin=self.in_space([x, y]), axes=self.axes)


UPWARD = FaceFrame(origin=np.zeros(3), axes=np.eye(3))
"""The frame of a block's top: the coordinates x and y themselves."""
