"""The tensor cubic spline through heights at cell centres, and its highest point."""

from __future__ import annotations

import copy
from functools import lru_cache
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.support import Array, Indices, InputError, blocks

_PADDING = 28
"""Cells by which periodic samples are continued: the influence of a sample on a cubic spline decays
by 2 − √3 per cell and is below 1e-16 there, so that a padded spline is periodic to rounding."""

_MOST_CLIMBS, _CLIMBED = 60, 1e-9
"""Steps to a local maximum, and their length, in cells, at which it counts as reached: its height
is then right to 1e-18 of the curvature."""


@lru_cache(maxsize=64)
def cell_centres(length: float, count: int) -> Array:
    """Return the centres of equal cells along a side, shape (count,), not to be written to [mm].

    Args:
        length: The side [mm].
        count: Number of cells.
    """
    centres = (np.arange(count) + 0.5) * (length / count)
    centres.flags.writeable = False
    return centres


class Interpolant:
    """Tensor cubic spline through samples at cell centres, defined on the whole rectangle.

    A periodic one wraps. Otherwise the spline also goes through heights on the border that the
    heights beside it bound, see `_on_border`: a groove that meets the border leaves no ridge there.
    Smooth surfaces are met at fourth order, in the outer half cells at second order at least.

    Args:
        heights: Samples at cell centres, shape (nx, ny) [mm].
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        periodic: Whether the samples continue periodically.
    """

    def __init__(
        self, heights: Array, lengths: tuple[float, float], *, periodic: bool = False
    ) -> None:
        self.lengths, self.periodic = lengths, periodic
        self._corner = (0.0, 0.0)
        self._spacing = (lengths[0] / heights.shape[0], lengths[1] / heights.shape[1])
        self._lowest = float(heights.min())  # apart, so that its size adds no rounding to slopes
        samples = heights - self._lowest
        samples = np.pad(samples, _PADDING, mode="wrap") if periodic else bordered(samples)
        places = []
        for length, step, count in zip(lengths, self._spacing, heights.shape, strict=True):
            padding = _PADDING if periodic else 1
            places.append((np.arange(-padding, count + padding) + 0.5) * step)
            if not periodic:
                places[-1][[0, -1]] = 0.0, length
        self._spline = scipy.interpolate.RectBivariateSpline(*places, samples, kx=3, ky=3, s=0)
        self._derivatives: dict[tuple[int, int], Any] = {}

    def window(self, corner: tuple[float, float], lengths: tuple[float, float]) -> Self:
        """Return the same spline on a rectangle within, whose lower corner is its origin.

        Args:
            corner: Lower corner of the rectangle [mm].
            lengths: Its sides [mm].
        """
        part = copy.copy(self)
        part.lengths, part.periodic = lengths, False
        part._corner = (self._corner[0] + corner[0], self._corner[1] + corner[1])
        return part

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the derivatives, each as large as the spline."""
        return self.__dict__ | {"_derivatives": {}}

    def __call__(self, x: ArrayLike, y: ArrayLike, *, dx: int = 0, dy: int = 0) -> Array:
        """Evaluate the spline or one of its derivatives.

        On a lattice, given by rising abscissae (n, 1) and ordinates (1, m), this takes a tenth of
        the time that it takes at n m scattered points.

        Args:
            x: Abscissae [mm]; broadcast against ``y``.
            y: Ordinates [mm].
            dx: Order of the derivative in x, 0 to 2.
            dy: Order of the derivative in y, 0 to 2.

        Returns:
            Values of the broadcast shape [mm / mm^(dx + dy)].

        Raises:
            InputError: When a point lies outside and the samples are not periodic.
        """
        x, y, spline = self._inside(x, 0), self._inside(y, 1), self._derivative(dx, dy)
        values = spline(x[:, 0], y[0]) if _is_lattice(x, y) else at_points(spline, x, y)
        return np.asarray(values if dx or dy else values + self._lowest, dtype=np.float64)

    def maximum(self) -> tuple[float, float, float]:
        """Return (x, y, z) of the highest point over the closed rectangle [mm].

        On a span between knots a spline stays below the largest of its 4 × 4 B-spline
        coefficients, so spans that cannot exceed the best sample are discarded; the others are
        sampled, and the best points refined by Newton's method within the rectangle.
        """
        points = np.stack(self._starts(), axis=1)
        x, y, z = max((*points, *self._climbed(points[:, :2])), key=lambda point: float(point[2]))
        return float(x) - self._corner[0], float(y) - self._corner[1], float(z) + self._lowest

    def mean_squares(self) -> list[float]:
        """Return <h²> [mm²], <h_x²>, <h_y²> [-], <h_xx²>, <h_yy²> and <(∇²h)²> [1/mm²].

        They are means over the rectangle, exact but for rounding, as products of B-splines are
        integrated by four Gauss points a span. Heights count from their mean.
        """
        axes = [[self._b_splines_at(axis, order) for order in range(3)] for axis in (0, 1)]

        def mean_product(one: tuple[int, int], other: tuple[int, int]) -> float:
            products = self._derived_coefficients(other)
            for splines, first, second in zip(axes, one, other, strict=True):
                (left, weights), (right, _) = splines[first], splines[second]
                products = (left.multiply(weights[:, None]).T @ right @ products).T
            return float(np.vdot(self._derived_coefficients(one), products))

        (along, one_x), (across, one_y) = axes[0][0], axes[1][0]
        level = float(one_x @ along @ self._derived_coefficients((0, 0)) @ across.T @ one_y)
        squares = [mean_product(one, one) for one in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2))]
        bends = squares[3] + squares[4] + 2.0 * mean_product((2, 0), (0, 2))
        return [squares[0] - level**2, *squares[1:], bends]

    def _derived_coefficients(self, order: tuple[int, int]) -> Array:
        """Return the B-spline coefficients of a derivative, shape (n, m)."""
        spline = self._derivative(*order)
        shape = [len(knots) - 4 + d for knots, d in zip(spline.get_knots(), order, strict=True)]
        return np.asarray(spline.get_coeffs().reshape(shape))

    def _b_splines_at(self, axis: int, order: int) -> tuple[Any, Array]:
        """Return the B-splines of a derivative along an axis at Gauss points, and their weights.

        Returns:
            A sparse matrix, whose rows are points; shares of the points in a mean, shape (points,).
        """
        _, ends = self._spans(axis)
        places, weights = np.polynomial.legendre.leggauss(4)
        half = 0.5 * np.diff(ends)
        at = (ends.mean(axis=1)[:, None] + half * places).ravel()
        knots = self._spline.get_knots()[axis]
        columns, values = _b_splines(knots[order : len(knots) - order], 3 - order, at)
        rows = np.repeat(np.arange(len(at)), columns.shape[1])
        shape = len(at), len(knots) - 4 - order
        matrix = scipy.sparse.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=shape)
        return matrix, (half * weights).ravel() / self.lengths[axis]

    def _derivative(self, dx: int, dy: int) -> Any:
        """Return a derivative as a spline of its own, made once: evaluation would remake it."""
        if (dx, dy) not in self._derivatives:
            whole = self._spline
            self._derivatives[dx, dy] = whole.partial_derivative(dx, dy) if dx or dy else whole
        return self._derivatives[dx, dy]

    def _inside(self, coordinate: ArrayLike, axis: int) -> Array:
        value = np.asarray(coordinate, dtype=np.float64)
        length = self.lengths[axis]
        if self.periodic:
            return np.mod(value, length) + self._corner[axis]
        outside = ~((value >= 0.0) & (value <= length))
        if outside.any():
            raise InputError(
                f"{int(outside.sum())} points lie outside the surface",
                value=float(value[outside].flat[0]),
                allowed=f"0 ≤ {'xy'[axis]} ≤ {length} mm",
            )
        return value + self._corner[axis]

    def _starts(self) -> tuple[Array, Array, Array]:
        """Return the highest points of a fine sampling of the spans that can hold the maximum."""
        (_, x), (_, y) = map(self._spans, range(2))
        bound = self._span_bounds()
        floor = float(self._spline(0.5 * (x[:, 0] + x[:, 1]), 0.5 * (y[:, 0] + y[:, 1])).max())
        spans = np.flatnonzero(bound >= floor)
        most = 20_000  # spans that are sampled, those of the highest bounds
        if len(spans) > most:
            spans = spans[np.argsort(bound.flat[spans])[-most:]]
        ix, iy = np.unravel_index(spans, bound.shape)
        u, v = (part.ravel() for part in np.mgrid[0.0:1.0:5j, 0.0:1.0:5j])
        px = x[ix, :1] + u * np.diff(x[ix])
        py = y[iy, :1] + v * np.diff(y[iy])
        z = at_points(self._spline, px, py)
        inner = np.argmax(z, axis=1)
        rows = np.argsort(z.max(axis=1))[-8:]
        return px[rows, inner[rows]], py[rows, inner[rows]], z[rows, inner[rows]]

    def _box(self, axis: int) -> tuple[float, float]:
        """Return where the rectangle begins and ends in the spline's own coordinate [mm]."""
        return self._corner[axis], self._corner[axis] + self.lengths[axis]

    def _spans(self, axis: int) -> tuple[slice, Array]:
        """Return the spans that reach into the rectangle, and their ends within it, (n, 2) [mm]."""
        knots, (low, high) = self._spline.get_knots()[axis][3:-3], self._box(axis)
        first = max(int(np.searchsorted(knots, low, side="right")) - 1, 0)
        last = min(int(np.searchsorted(knots, high, side="left")), len(knots) - 1)
        ends = np.clip(knots[first : last + 1], low, high)
        return slice(first, last), np.stack([ends[:-1], ends[1:]], axis=1)

    def _coefficients(self) -> Array:
        """Return the B-spline coefficients that the rectangle's spans depend on [mm]."""
        shape = [len(knots) - 4 for knots in self._spline.get_knots()]
        x, y = (slice(part.start, part.stop + 3) for part, _ in map(self._spans, range(2)))
        return np.asarray(self._spline.get_coeffs().reshape(shape)[x, y])

    def _span_bounds(self) -> Array:
        """Return an upper bound of the spline on every span [mm]."""
        rows = self._coefficients()
        nx, ny = rows.shape[0] - 3, rows.shape[1] - 3
        strips = np.maximum.reduce([rows[k : nx + k] for k in range(4)])
        return np.asarray(np.maximum.reduce([strips[:, k : ny + k] for k in range(4)]))

    def _climbed(self, points: Array) -> Array:
        """Return local maxima (x, y, z) reached from points without leaving the rectangle.

        Newton's method with the curvatures' sizes, so that every step leads up; steps that go too
        far are halved.

        Args:
            points: Where to begin, shape (n, 2) [mm].
        """
        spacing, share = np.array(self._spacing), np.ones((len(points), 1))
        low, high = np.transpose([self._box(axis) for axis in range(2)])
        points, heights = points.copy(), at_points(self._spline, *points.T)
        for _ in range(_MOST_CLIMBS):
            step = np.clip(self._newton_step(points, low, high), -1.0, 1.0)
            trial = np.clip(points + share * step * spacing, low, high)
            reached = at_points(self._spline, *trial.T)
            higher = reached > heights
            points[higher], heights[higher] = trial[higher], reached[higher]
            share = np.where(higher[:, None], np.minimum(2.0 * share, 1.0), 0.5 * share)
            if np.abs(share * step).max() <= _CLIMBED:
                break
        return np.column_stack((points, heights))

    def _newton_step(self, points: Array, low: Array, high: Array) -> Array:
        """Return steps up from points, in cells, which end at sides that are in the way, (n, 2)."""
        spacing, orders = np.array(self._spacing), ((2, 0), (1, 1), (0, 2))
        slope = np.stack(
            [at_points(self._derivative(*d), *points.T) for d in ((1, 0), (0, 1))], axis=1
        )
        slope *= spacing
        xx, xy, yy = (at_points(self._derivative(*d), *points.T) for d in orders)
        at_side = np.where(slope > 0.0, points >= high, points <= low)
        slope[at_side] = 0.0
        xy = np.where(at_side.any(axis=1), 0.0, xy)
        bends = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2) * np.outer(spacing, spacing)
        sizes, axes = np.linalg.eigh(bends)
        sizes = np.maximum(np.abs(sizes), np.finfo(float).tiny)
        along = np.einsum("nij,ni->nj", axes, slope) / sizes
        return np.einsum("nij,nj->ni", axes, along)


def at_points(spline: Any, x: ArrayLike, y: ArrayLike) -> Array:
    """Evaluate a spline at scattered points.

    FITPACK looks for the span of every point from the first knot on: 1000 points on 4 × 200 000
    knots took 70 ms. Of so many knots the B-splines around a point are summed here, in 2 ms.

    Args:
        spline: The spline.
        x: Abscissae [mm]; broadcast against ``y``.
        y: Ordinates [mm].

    Returns:
        Values of the broadcast shape.
    """
    knots = spline.get_knots()
    if max(map(len, knots)) <= 2000:
        return np.asarray(spline(x, y, grid=False))
    axes, (px, py) = list(zip(knots, spline.degrees, strict=True)), np.broadcast_arrays(x, y)
    whole = spline.get_coeffs().reshape([len(ticks) - degree - 1 for ticks, degree in axes])
    values = np.empty(px.size)
    for some in blocks(px.size, 2**18):  # blocks bound the memory
        (i, u), (j, v) = (
            _b_splines(*axis, np.ravel(place)[some])
            for axis, place in zip(axes, (px, py), strict=True)
        )
        values[some] = np.einsum("ni,nij,nj->n", u, whole[i[:, :, None], j[:, None]], v)
    return values.reshape(px.shape)


def _b_splines(knots: Array, degree: int, at: Array) -> tuple[Indices, Array]:
    """Return the B-splines that are not zero at points, and their values, shape (n, degree + 1).

    Source:
        De Boor 1978, A Practical Guide to Splines, ch. X.
    """
    span = np.clip(np.searchsorted(knots, at, side="right") - 1, degree, len(knots) - degree - 2)
    values = np.ones((len(at), 1))
    for order in range(1, degree + 1):
        above = span[:, None] + np.arange(1, order + 1)
        high, low = knots[above], knots[above - order]
        parts = values / (high - low)
        values = np.pad(parts * (high - at[:, None]), ((0, 0), (0, 1)))
        values[:, 1:] += parts * (at[:, None] - low)
    return span[:, None] + np.arange(-degree, 1), values


def bordered(samples: Array) -> Array:
    """Return samples with a row of heights on every border, shape (nx + 2, ny + 2).

    A corner is continued along both sides, and gets the mean of the two.
    """
    along, across = _on_borders(samples), _on_borders(samples.T).T
    return np.asarray(0.5 * (_on_borders(along.T).T + _on_borders(across)))


def _on_borders(samples: Array) -> Array:
    """Return samples with a row before the first and one behind the last, half a cell away."""
    return np.vstack([_on_border(samples), samples, _on_border(samples[::-1])])


def _on_border(rows: Array) -> Array:
    """Return the heights on the border half a cell before the first of some rows, shape (1, m).

    They are those of the cubics through four heights, within bounds: they rise no higher than the
    second height and the straight line through the first two, so that no ridge is invented, and
    fall by no more than the four heights differ. The straight line is never in the way of heights
    that curve downwards, as those of summits do; where they curve upwards it is right to second
    order. On plateau-honed surfaces of 8 heights per wave the cubics alone rise 0.2 to 0.3 µm above
    the plateau, and straight lines alone 0.5 µm.
    """
    weights = np.array([35.0, -35.0, 21.0, -5.0]) / 16.0  # of the cubic's value there
    cubic = np.tensordot(weights, rows[:4], axes=1)[None]
    highest = np.maximum(rows[1:2], 1.5 * rows[:1] - 0.5 * rows[1:2])
    lowest = rows[:1] - np.ptp(rows[:4], axis=0)
    return np.clip(cubic, lowest, highest)


def _is_lattice(x: Array, y: Array) -> bool:
    """Tell whether coordinates are those of a lattice, along its axes and rising."""
    if not (x.ndim == y.ndim == 2 and x.shape[1] == y.shape[0] == 1):
        return False
    return bool((np.diff(x[:, 0]) > 0.0).all() and (np.diff(y[0]) > 0.0).all())
