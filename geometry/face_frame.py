"""A planar contact face: coordinates on it, and Legendre modes on a rectangle of it; Gauss' rule.

The face lies anywhere in space. Modes expand smooth fields on it: on an interval of length L they
are P_k(2x/L − 1) √(2k + 1), orthogonal, with mean square 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
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


@cache
def gauss_rule(count: int) -> tuple[Array, Array]:
    """Return places on [−1, 1] and weights of Gauss' rule, not to be written to, shapes (count,).

    Its eigenvalue problem takes longer than most sums over the places, so it is solved once.

    Args:
        count: Number of places.
    """
    rule = legendre.leggauss(count)
    for values in rule:
        values.flags.writeable = False
    return rule


def mode_values(points: ArrayLike, length: float, count: int) -> Array:
    """Return the modes at points.

    Args:
        points: Abscissae on [0, L], shape (n,) [mm].
        length: L [mm].
        count: Number of modes.

    Returns:
        Shape (count, n).
    """
    t = 2.0 * np.asarray(points, float) / length - 1.0
    return np.asarray(legendre.legvander(t, count - 1).T * _norms(count))


def mode_slopes(points: ArrayLike, length: float, count: int) -> Array:
    """Return the derivatives of the modes at points.

    Args:
        points: Abscissae on [0, L], shape (n,) [mm].
        length: L [mm].
        count: Number of modes.

    Returns:
        Shape (count, n) [1/mm]; from P_{k+1}' = P_{k−1}' + (2k + 1) P_k.
    """
    t = 2.0 * np.asarray(points, float) / length - 1.0
    values = legendre.legvander(t, count - 1).T * (2.0 * np.arange(count) + 1.0)[:, None]
    slopes = np.zeros_like(values)
    for k in range(1, count):
        slopes[k] = values[k - 1] + (slopes[k - 2] if k > 1 else 0.0)
    return np.asarray(slopes * _norms(count) * (2.0 / length))


def mode_means(borders: ArrayLike, length: float, count: int) -> Array:
    """Return the means of the modes over intervals.

    Args:
        borders: Borders of adjoining intervals on [0, L], ascending, shape (n + 1,) [mm].
        length: L [mm].
        count: Number of modes.

    Returns:
        Shape (count, n); from ∫ P_k = (P_{k+1} − P_{k−1}) / (2k + 1).
    """
    t = 2.0 * np.asarray(borders, float) / length - 1.0
    values = legendre.legvander(t, count).T
    integrals = np.empty((count, t.size))
    integrals[0] = t
    k = np.arange(1, count)[:, None]
    integrals[1:] = (values[2:] - values[: count - 1]) / (2.0 * k + 1.0)
    return np.asarray(np.diff(integrals, axis=1) / np.diff(t) * _norms(count))


def modes_within(
    lengths: tuple[float, float],
    whole: tuple[float, float],
    origin: tuple[float, float],
    count: int,
) -> Array:
    """Return the modes of a rectangle in those of a part of it.

    On a part of the rectangle its modes are polynomials of the same degrees, so that nothing is
    lost.

    Args:
        lengths: Sides of the part, whose corner is the origin of the coordinates [mm].
        whole: Sides of the rectangle [mm].
        origin: Corner of the rectangle [mm].
        count: Number of modes K along a side.

    Returns:
        Means over the part of its modes times those of the rectangle, shape (K², K²).
    """
    nodes, weights = gauss_rule(count)
    share = 0.5 * (1.0 + nodes)
    along = [
        (0.5 * weights * mode_values(share * inner, inner, count))
        @ mode_values(share * inner - start, length, count).T
        for inner, start, length in zip(lengths, origin, whole, strict=True)
    ]
    return np.kron(*along)


def _norms(count: int) -> Array:
    return np.asarray(np.sqrt(2.0 * np.arange(count) + 1.0)[:, None])
