"""The summits of a surface as paraboloids: place, height, principal radii and direction."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.rigid_plane import RigidPlane
from geometry.summits import coincident, constrained_summits, grid_maxima
from geometry.surface import Surface
from support.checks import frozen_array, positive_lengths
from support.errors import InputError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NEWTON_STEPS = 8
_ROUNDING = 64.0 * np.finfo(float).eps
"""Second difference that is only rounding, relative to the largest height."""
_SUMMIT_ARRAYS = ("x", "y", "z", "radius_major", "radius_minor", "angle")
_BORDER_ARRAYS = ("border_x", "border_y", "border_z")


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Asperities:
    """Summits of a surface, each an elliptic paraboloid, and counts of the maxima that are none.

    Args:
        x: Abscissae of the summits, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        z: Heights, shape (n,) [mm].
        radius_major: Larger principal radii of curvature R', shape (n,) [mm].
        radius_minor: Smaller principal radii R'', shape (n,) [mm].
        angle: Directions of the larger radius, which is that of the major semi-axis of the
            contact, from the x axis, in [0, π), shape (n,) [rad].
        lengths: Sides (Lx, Ly) of the surface [mm].
        highest: Highest point z_M of the surface's interpolant [mm].
        mean_height: Mean height of the surface [mm].
        border_x: Abscissae of maxima among the cells of the border, shape (m,) [mm]. A search
            among 8 neighbours cannot confirm them, so they are not asperities.
        border_y: Their ordinates, shape (m,) [mm].
        border_z: Their heights, shape (m,) [mm].
        rejected: Number of further maxima of the samples that are no asperities: they have no two
            positive radii, or climb to another summit or to the border.
        flat: Number of those that are flat, as steps of the measured heights leave them.

    Raises:
        InputError: When the arrays differ in length, a number is not finite, or not R' ≥ R'' > 0
            everywhere.
    """

    x: Array
    y: Array
    z: Array
    radius_major: Array
    radius_minor: Array
    angle: Array
    lengths: tuple[float, float]
    highest: float
    mean_height: float
    border_x: Array = field(default_factory=_none)
    border_y: Array = field(default_factory=_none)
    border_z: Array = field(default_factory=_none)
    rejected: int = 0
    flat: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "lengths", positive_lengths(self.lengths, "the asperities"))
        for group in (_SUMMIT_ARRAYS, _BORDER_ARRAYS):
            for name in group:
                object.__setattr__(self, name, frozen_array(np.atleast_1d(getattr(self, name))))
            sizes = {name: getattr(self, name).shape for name in group}
            if len(set(sizes.values())) != 1 or any(len(size) != 1 for size in sizes.values()):
                raise InputError("the asperities' arrays differ in shape", value=sizes)
        for name in ("x", "y", "z", "angle", *_BORDER_ARRAYS):
            bad = np.flatnonzero(~np.isfinite(getattr(self, name)))
            if bad.size:
                raise InputError(
                    f"{name} of {bad.size} asperities is not finite, the first at index {bad[0]}",
                    value=float(getattr(self, name)[bad[0]]),
                    allowed="finite numbers in mm and rad",
                )
        if not np.all((self.radius_major >= self.radius_minor) & (self.radius_minor > 0.0)):
            raise InputError("an asperity's principal radii are not R' ≥ R'' > 0")

    def __len__(self) -> int:
        return len(self.x)

    @property
    def count(self) -> int:
        """Number of asperities n."""
        return len(self)

    @property
    def radius(self) -> Array:
        """Equivalent radii R = sqrt(R' R''), shape (n,) [mm]."""
        return np.sqrt(self.radius_major * self.radius_minor)

    def interference(self, plane: RigidPlane) -> Array:
        """Return how far undisplaced summits would penetrate a plane, shape (n,) [mm].

        Returns:
            δ(x_k) − (z_M − z_k), negative for a summit that the plane stays above.

        Source:
            Waddad et al. 2016, eq. 6, doi 10.1016/j.triboint.2015.12.023.
        """
        return plane.at(self.x, self.y) - (self.highest - self.z)

    def subset(self, mask: ArrayLike) -> Asperities:
        """Return some of the asperities; border maxima and counts remain those of the surface.

        Args:
            mask: Anything that indexes an array of length n: booleans or indices.
        """
        index = np.asarray(mask)
        return replace(self, **{name: getattr(self, name)[index] for name in _SUMMIT_ARRAYS})


def find_asperities(surface: Surface, *, periodic: bool | None = None) -> Asperities:
    """Find the summits of a surface and the paraboloids that osculate it there.

    Newton's iteration on the smooth interpolant starts at every cell that is not lower than its 8
    neighbours, and finds the summit between the samples. Central differences of the interpolant
    with a step of one cell around the summit form its Hessian. As the slope vanishes there, the
    eigenvalues are the principal curvatures. Neighbouring cells of equal height count once. So do
    several cells of a ridge oblique to the grid that climb to one summit. A climb that ends on the
    border finds no asperity.

    Args:
        surface: The surface.
        periodic: Whether neighbours are found across the border; the surface's own flag when
            not given. A periodic search needs a periodic surface.

    Returns:
        The asperities in the order of their cells.

    Raises:
        InputError: When a surface that is not periodic is searched periodically.

    Source: Waddad et al. 2016, section 1.1, doi 10.1016/j.triboint.2015.12.023; the sub-grid
        position is an addition.
    """
    periodic = surface.periodic if periodic is None else periodic
    if periodic and not surface.periodic:
        raise InputError("a periodic search for summits needs a periodic surface")
    maxima = grid_maxima(surface.heights, periodic=periodic)
    cell = np.array(surface.spacing)
    start = (maxima.position + 0.5) * cell
    edge, inside = start[maxima.on_border], start[~maxima.on_border]
    summit, failed = _refined(surface, inside)
    none = -_ROUNDING * np.abs(surface.heights).max() / cell.min() ** 2
    most = np.linalg.eigvalsh(_hessians(surface, summit))[:, 1]
    concave = most < none
    summit = _distinct(surface, summit[concave], failed[concave], bounded=not periodic)
    curvature, direction = np.linalg.eigh(_hessians(surface, summit))
    valid = curvature[:, 1] < none
    summit, curvature, direction = summit[valid], curvature[valid], direction[valid]
    if surface.periodic:
        summit = np.mod(summit, surface.lengths)
        summit[summit >= surface.lengths] = 0.0  # by rounding of coordinates just below zero
    return Asperities(
        x=summit[:, 0],
        y=summit[:, 1],
        z=surface.height_at(*summit.T),
        radius_major=-1.0 / curvature[:, 1],
        radius_minor=-1.0 / curvature[:, 0],
        angle=np.mod(np.arctan2(direction[:, 1, 1], direction[:, 0, 1]), np.pi),
        lengths=surface.lengths,
        highest=surface.highest,
        mean_height=surface.mean_height,
        border_x=edge[:, 0],
        border_y=edge[:, 1],
        border_z=maxima.height[maxima.on_border],
        rejected=len(inside) - len(summit),
        flat=int(np.count_nonzero(~concave & (most <= -none))),
    )


def _distinct(surface: Surface, point: Array, failed: Mask, *, bounded: bool) -> Array:
    """Return every summit once; points where Newton's method failed climb to theirs first."""
    point = point.copy()
    point[failed] = constrained_summits(surface, point[failed], bounded=bounded)
    size = np.array(surface.lengths)
    outside = failed & bounded & np.any((point <= 0.0) | (point >= size), axis=1)
    _, first = np.unique(
        coincident(surface, point if bounded else np.mod(point, size)), return_index=True
    )
    once = np.zeros(len(point), dtype=bool)
    once[first] = True
    return np.asarray(point[once & ~outside])


def _refined(surface: Surface, start: Array) -> tuple[Array, Mask]:
    """Return the summits next to ``start``, and where Newton's method leaves ±1 cell."""
    h, cell, point = surface.interpolant, np.array(surface.spacing), start.copy()
    failed = np.zeros(len(start), dtype=bool)
    for _ in range(_NEWTON_STEPS):
        gradient = surface.gradient_at(*point.T)
        xx, xy, yy = h(*point.T, dx=2), h(*point.T, dx=1, dy=1), h(*point.T, dy=2)
        det = xx * yy - xy**2
        failed |= ~((det > 0.0) & (xx < 0.0))
        safe = np.where(failed, 1.0, det)
        step = np.stack(
            [
                yy * gradient[:, 0] - xy * gradient[:, 1],
                xx * gradient[:, 1] - xy * gradient[:, 0],
            ],
            axis=1,
        )
        moved = point - np.where(failed[:, None], 0.0, step / safe[:, None])
        failed |= np.any(np.abs(moved - start) > cell, axis=1)
        point = np.where(failed[:, None], start, moved)
    return point, failed


def _hessians(surface: Surface, point: Array) -> Array:
    """Return Hessians by central differences of one cell, shape (n, 2, 2) [1/mm]."""
    dx, dy = surface.spacing
    x, y = point.T
    if not surface.periodic:  # keep the stencil inside
        x = np.clip(x, dx, surface.lengths[0] - dx)
        y = np.clip(y, dy, surface.lengths[1] - dy)
    step = np.array([-1.0, 0.0, 1.0])
    px, py = x[:, None, None] + step[:, None] * dx, y[:, None, None] + step * dy
    if not surface.periodic:
        px, py = np.clip(px, 0.0, surface.lengths[0]), np.clip(py, 0.0, surface.lengths[1])
    h = surface.height_at(px, py)
    xx = (h[:, 2, 1] - 2.0 * h[:, 1, 1] + h[:, 0, 1]) / dx**2
    yy = (h[:, 1, 2] - 2.0 * h[:, 1, 1] + h[:, 1, 0]) / dy**2
    xy = (h[:, 2, 2] - h[:, 2, 0] - h[:, 0, 2] + h[:, 0, 0]) / (4.0 * dx * dy)
    return np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2)
