"""The summits of a surface as paraboloids: place, height, principal radii and direction.

Maxima of the samples come first, then a climb from each on the interpolant.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry.rigid_plane import RigidPlane
from patchlaw.geometry.surface import Surface
from patchlaw.support import Array, Flags, Indices, InputError, Lengths, check_fields, frozen_array

_COINCIDENT = 1e-3
"""Distance of summits that are taken for one [cells]."""

_SUMMIT_ARRAYS = ("x", "y", "z", "radius_major", "radius_minor", "angle")
_BORDER_ARRAYS = ("border_x", "border_y", "border_z")


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMaxima:
    """Local maxima of a height map, in the order of their first cells.

    Args:
        position: Index coordinates (ix, iy), the mean of the cells of a plateau, shape (n, 2).
        height: Heights, shape (n,) [mm].
        on_border: Whether a cell of the maximum lies on the border, where not all 8 neighbours
            exist, shape (n,).
    """

    position: Array
    height: Array
    on_border: Flags


def grid_maxima(heights: Array) -> GridMaxima:
    """Find the cells, or plateaus of equal cells, that all neighbours stay below.

    Args:
        heights: Heights, shape (nx, ny) [mm].
    """
    candidate = heights == scipy.ndimage.maximum_filter(heights, size=3, mode="nearest")
    cells = np.argwhere(candidate)
    label = _plateaus(candidate, cells)
    # a plateau is no maximum where an equal cell beside it has a higher neighbour
    others = scipy.ndimage.maximum_filter(
        np.where(candidate, -np.inf, heights), size=3, mode="nearest"
    )
    shoulder = np.bincount(label, weights=(others == heights)[candidate]) > 0
    outer = np.any((cells == 0) | (cells == np.array(heights.shape) - 1), axis=1)
    on_border = np.bincount(label, weights=outer) > 0
    _, first = np.unique(label, return_index=True)
    start, size = cells[first], np.bincount(label)
    offsets = (cells - start[label]).T
    middle = start.astype(float)
    middle += np.stack([np.bincount(label, part) / size for part in offsets], axis=1)
    height = heights[tuple(start.T)]
    return GridMaxima(
        position=middle[~shoulder], height=height[~shoulder], on_border=on_border[~shoulder]
    )


def _plateaus(candidate: Flags, cells: Indices) -> Indices:
    """Label connected candidates (8 neighbours), numbered by first cell; neighbours are equal."""
    number = np.full(candidate.shape, -1)
    number[candidate] = np.arange(len(cells))
    pairs = []
    for offset in ((0, 1), (1, -1), (1, 0), (1, 1)):
        neighbour = cells + offset
        inside = np.all((neighbour >= 0) & (neighbour < candidate.shape), axis=1)
        other = number[tuple(neighbour[inside].T)]
        pairs.append(np.stack([np.flatnonzero(inside)[other >= 0], other[other >= 0]]))
    row, column = np.concatenate(pairs, axis=1)
    graph = scipy.sparse.coo_array((np.ones(len(row)), (row, column)), shape=2 * (len(cells),))
    _, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


def slopes_and_curvatures(surface: Surface, point: Array) -> tuple[Array, Array]:
    """Return the first and second derivatives of the interpolant.

    Args:
        surface: The surface.
        point: Points, shape (n, 2) [mm].

    Returns:
        h_x and h_y, shape (2, n), and h_xx, h_xy and h_yy, shape (3, n) [1/mm].
    """
    first, second = ((1, 0), (0, 1)), ((2, 0), (1, 1), (0, 2))
    slopes, curvatures = (
        np.stack([surface.interpolant(*point.T, dx=dx, dy=dy) for dx, dy in orders])
        for orders in (first, second)
    )
    return slopes, curvatures


def constrained_summits(surface: Surface, start: Array) -> Array:
    """Return the summits of the closed rectangle that the surface rises to from given points.

    Newton's method climbs the smooth interpolant in steps of at most a cell, uphill also where the
    surface is not concave; steps that lose height are shortened. A coordinate that lies on the
    border with the slope pointing outward stays there, so that the result is a summit, a maximum
    along an edge, or a corner. Samples on a ridge that is oblique to the grid are higher than their
    neighbours without being summits. From there the climb follows the ridge, over many cells if
    necessary. A point that gains no height stays where it was.

    Args:
        surface: The surface; its border counts also when it is periodic.
        start: Points near the maxima, shape (n, 2) [mm].

    Returns:
        The maxima, shape (n, 2) [mm].
    """
    point = np.array(start, float)
    rounding = 4.0 * np.finfo(float).eps * float(np.abs(surface.heights).max())
    on, longest = np.arange(len(point)), np.ones(len(point))
    shortest = 1e-10  # step that ends a climb, in cells
    for _ in range(200):
        if not on.size:
            break
        here = point[on]
        moved = _moved_uphill(surface, here, longest[on])
        before, after = surface.height_at(*here.T), surface.height_at(*moved.T)
        size = np.abs((moved - here) / surface.spacing).max(axis=1)
        gained = after - before > rounding
        # the last steps of Newton's method are right though the height does not show it
        taken = gained | ((size < _COINCIDENT) & (before - after <= rounding))
        point[on[taken]] = moved[taken]
        longest[on] = np.where(taken, np.minimum(2.0 * longest[on], 1.0), 0.25 * size)
        on = on[(size > shortest) & (longest[on] > shortest)]
    gained = surface.height_at(*point.T) - surface.height_at(*start.T) > rounding
    return np.where(gained[:, None], point, start)


def coincident(surface: Surface, point: Array) -> Indices:
    """Return a number for each point, the same for points at one place, shape (n,).

    Args:
        surface: The surface; points less than a thousandth of its cells apart are at one place.
        point: Points, shape (n, 2) [mm].
    """
    pairs = scipy.spatial.cKDTree(point / surface.spacing).query_pairs(
        _COINCIDENT, output_type="ndarray"
    )
    links = scipy.sparse.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=2 * (len(point),))
    return np.asarray(
        scipy.sparse.csgraph.connected_components(links, directed=False)[1], dtype=np.intp
    )


def _moved_uphill(surface: Surface, point: Array, longest: Array) -> Array:
    """Return points after a step of at most ``longest`` cells, shape (n,)."""
    cell, border = np.array(surface.spacing), np.array(surface.lengths)
    slopes, curvatures = slopes_and_curvatures(surface, point)
    slope = slopes.T * cell
    curvature = curvatures[[0, 1, 1, 2]].T.reshape(-1, 2, 2) * np.multiply.outer(cell, cell)
    fixed = ((point <= 0.0) & (slope < 0.0)) | ((point >= border) & (slope > 0.0))
    slope = np.where(fixed, 0.0, slope)
    curvature = np.where(fixed[:, :, None] | fixed[:, None, :], 0.0, curvature)
    step = _ascent(slope, curvature)
    size = np.abs(step).max(axis=1, initial=0.0)
    step *= np.divide(longest, size, out=np.ones_like(size), where=size > longest)[:, None]
    return np.clip(point + step * cell, 0.0, border)


def _ascent(slope: Array, curvature: Array) -> Array:
    """Return Newton's steps where the surface is concave; uphill along convex directions."""
    bend, axes = np.linalg.eigh(curvature)
    along = np.einsum("nij,ni->nj", axes, slope)
    # Newton's step would be longer than a cell there
    flat = np.abs(bend) < np.abs(along)
    step = np.where(flat, np.sign(along), along / np.where(flat, 1.0, np.abs(bend) + (bend == 0.0)))
    return np.asarray(np.einsum("nij,nj->ni", axes, step))


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
    lengths: Lengths
    highest: float
    mean_height: float
    border_x: Array = field(default_factory=lambda: np.empty(0))
    border_y: Array = field(default_factory=lambda: np.empty(0))
    border_z: Array = field(default_factory=lambda: np.empty(0))
    rejected: int = 0
    flat: int = 0

    def __post_init__(self) -> None:
        check_fields(self)
        for group in (_SUMMIT_ARRAYS, _BORDER_ARRAYS):
            arrays = {name: frozen_array(np.atleast_1d(getattr(self, name))) for name in group}
            sizes = {name: array.shape for name, array in arrays.items()}
            if len(set(sizes.values())) != 1 or arrays[group[0]].ndim != 1:
                raise InputError("the asperities' arrays differ in shape", value=sizes)
            for name, array in arrays.items():
                bad = np.flatnonzero(~np.isfinite(array))
                if bad.size:
                    raise InputError(
                        f"{name} of {bad.size} asperities is not finite, the first at index "
                        f"{bad[0]}",
                        value=float(array[bad[0]]),
                        allowed="finite numbers in mm and rad",
                    )
                object.__setattr__(self, name, array)
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


def find_asperities(surface: Surface) -> Asperities:
    """Find the summits of a surface and the paraboloids that osculate it there.

    Newton's iteration on the smooth interpolant starts at every cell that is not lower than its 8
    neighbours, and finds the summit between the samples. Central differences of the interpolant
    with a step of one cell around the summit form its Hessian. As the slope vanishes there, the
    eigenvalues are the principal curvatures. Neighbouring cells of equal height count once. So do
    several cells of a ridge oblique to the grid that climb to one summit. A climb that ends on the
    border finds no asperity. Also of a periodic surface the border ends what is searched.

    Args:
        surface: The surface.

    Returns:
        The asperities in the order of their cells.

    Source: Waddad et al. 2016, section 1.1, doi 10.1016/j.triboint.2015.12.023; the sub-grid
        position is an addition.
    """
    maxima = grid_maxima(surface.heights)
    cell = np.array(surface.spacing)
    start = (maxima.position + 0.5) * cell
    edge, inside = start[maxima.on_border], start[~maxima.on_border]
    summit, failed = _refined(surface, inside)
    # rounding of second differences, relative to the largest height
    none = -64.0 * np.finfo(float).eps * np.abs(surface.heights).max() / cell.min() ** 2
    most = np.linalg.eigvalsh(_hessians(surface, summit))[:, 1]
    concave = most < none
    summit = _distinct(surface, summit[concave], failed[concave])
    curvature, direction = np.linalg.eigh(_hessians(surface, summit))
    valid = curvature[:, 1] < none
    summit, curvature, direction = summit[valid], curvature[valid], direction[valid]
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


def _distinct(surface: Surface, point: Array, failed: Flags) -> Array:
    """Return every summit once; points where Newton's method failed climb to theirs first."""
    point = point.copy()
    point[failed] = constrained_summits(surface, point[failed])
    outside = np.any((point <= 0.0) | (point >= surface.lengths), axis=1)
    _, first = np.unique(coincident(surface, point), return_index=True)
    once = np.zeros(len(point), dtype=bool)
    once[first] = True
    return np.asarray(point[once & ~outside])


def _refined(surface: Surface, start: Array) -> tuple[Array, Flags]:
    """Return the summits next to ``start``, and where Newton's method leaves ±1 cell."""
    point, failed = start.copy(), np.zeros(len(start), dtype=bool)
    for _ in range(8):
        (x, y), (xx, xy, yy) = slopes_and_curvatures(surface, point)
        det = xx * yy - xy**2
        failed |= ~((det > 0.0) & (xx < 0.0))
        safe = np.where(failed, 1.0, det)
        step = np.stack([yy * x - xy * y, xx * y - xy * x], axis=1)
        moved = point - np.where(failed[:, None], 0.0, step / safe[:, None])
        failed |= np.any(np.abs(moved - start) > surface.spacing, axis=1)
        point = np.where(failed[:, None], start, moved)
    return point, failed


def _hessians(surface: Surface, point: Array) -> Array:
    """Return Hessians by central differences of one cell, shape (n, 2, 2) [1/mm]."""
    around = []
    for place, cell, length in zip(point.T, surface.spacing, surface.lengths, strict=True):
        if not surface.periodic:  # keep the stencil inside
            place = np.clip(place, cell, length - cell)
        stencil = place[:, None] + np.array([-1.0, 0.0, 1.0]) * cell
        around.append(stencil if surface.periodic else np.clip(stencil, 0.0, length))
    dx, dy = surface.spacing
    h = surface.height_at(around[0][:, :, None], around[1][:, None, :])
    xx = (h[:, 2, 1] - 2.0 * h[:, 1, 1] + h[:, 0, 1]) / dx**2
    yy = (h[:, 1, 2] - 2.0 * h[:, 1, 1] + h[:, 1, 0]) / dy**2
    xy = (h[:, 2, 2] - h[:, 2, 0] - h[:, 0, 2] + h[:, 0, 0]) / (4.0 * dx * dy)
    return np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2)
