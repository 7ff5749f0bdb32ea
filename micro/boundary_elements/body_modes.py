"""Compliance and surface stresses in smooth modes: half-space, free sides, and a finite body.

Modes are products of Legendre modes along x and y of a rectangle.

With A(s) = ∫ φ_k(x) φ_k'(x + s) dx, and B likewise along y, the moments of a displacement with the
kernel g(s, t) are ∫∫ A B g. Kernels of the half-space are homogeneous: on the triangles s Ly > t Lx
and s Ly < t Lx, with s the length along one and t = s v along the other, they leave polynomials of
s and smooth functions of v, to which Gauss' rules converge at once.

The stresses in the surface are σ_αβ = −2ν p δ_αβ − (1 − 2ν) ∂_α ∂_β φ, with φ the convolution of p
with ln ρ/2π. Integrated by parts once, the moments of ∂_α ∂_β φ are −∫∫ A' B ∂_β ln ρ/2π.

What free sides add is a sum of waves along them, whose means with the modes are Bessel functions,
and across them of values at nodes of the distance from the side.

What a finite body adds to the half-space is smooth.
Pressures p have the moments b_n = ∫ p φ_n dA with the modes φ_n. They displace by Σ φ_m D_mn b_n,
and add the stresses Σ φ_m S_mn b_n in the surface. Modes are products of Legendre modes along x and
y (`geometry.face_frame`), so that all evaluations are thin products along the axes: mode
k K + l varies as mode k along x and l along y. Matrices have the shape (K², K²). Those of tractions
in all directions, along x, y and into the body, have the shape (3, 3, K², K²).

Theory: docs/theory.md, sections 4, 5, 6 and 15.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import (
    gauss_rule,
    mode_means,
    mode_slopes,
    mode_values,
    modes_within,
)
from patchlaw.micro.boundary_elements.free_sides import (
    FreeSides,
    distance_nodes,
    gauss_points,
    values_at,
)
from patchlaw.micro.boundary_elements.grid_compliance import CellGrid
from patchlaw.support import (
    Array,
    Indices,
    InputError,
    Lengths,
    blocks,
    cached_where_small,
    check_fields,
)

Part = Callable[[Array, float, int], Array]
"""Function of shifts, the length and the number of modes, with values of shape (shifts, K, K)."""

# matrices of few modes, of 1.3 or 3.8 MB, are cached
_of_few_modes = cached_where_small(lambda *arguments: arguments[-1] <= 20, most=8)


@_of_few_modes
def half_space_modes(lengths: tuple[float, float], count: int) -> Array:
    """Return the displacements into the half-space by modes of pressure, in modes, for E* = 1.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m(x) φ_n(x') / (π |x − x'|) dA dA', symmetric, shape (K², K²) [1/mm].
    """
    matrix = direction_modes(lengths, (0, 0), count)
    return np.asarray(0.5 * (matrix + matrix.T))


@_of_few_modes
def direction_modes(lengths: tuple[float, float], powers: tuple[int, int], count: int) -> Array:
    """Return what kernels of a direction displace by modes, in modes.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        powers: Powers a and b of the kernel cos^a sin^b / (π ρ), with ρ and its direction from the
            load to the point.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m(x) φ_n(x') cos^a sin^b / (π ρ) dA dA', shape (K², K²) [1/mm].
    """
    signs = (-1.0) ** powers[0], (-1.0) ** powers[1]
    parts = _products, _products

    def weight(cos: Array, sin: Array) -> Array:
        return signs[0] * signs[1] * 4.0 / np.pi * cos ** powers[0] * sin ** powers[1]

    return _integrated(lengths, count, parts, signs, weight)


@_of_few_modes
def half_space_stress_modes(
    lengths: tuple[float, float], poisson_ratio: float, count: int
) -> Array:
    """Return the stresses in the half-space's surface by modes of pressure, in modes.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        poisson_ratio: ν.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫ φ_m σ_αβ[φ_n] dA of xx, yy and xy, shape (3, K², K²) [1/mm²].
    """
    side = 1.0 - 2.0 * poisson_ratio
    parts = _product_slopes, _products
    xx = -2.0 / np.pi * _integrated(lengths, count, parts, (1.0, 1.0), lambda x, _: x)
    xy = -2.0 / np.pi * _integrated(lengths, count, parts, (-1.0, -1.0), lambda _, y: y)
    pressure = np.eye(count**2) / (lengths[0] * lengths[1])
    straight = -2.0 * poisson_ratio * pressure - side * xx
    return np.stack([straight, -(1.0 + 2.0 * poisson_ratio) * pressure - straight, -side * xy])


def _integrated(
    lengths: tuple[float, float],
    count: int,
    parts: tuple[Part, Part],
    signs: tuple[float, float],
    weight: Callable[[Array, Array], Array],
) -> Array:
    """Integrate over a quarter of all shifts between two points of the rectangle.

    Args:
        lengths: Sides of the rectangle [mm].
        count: Modes along a side.
        parts: Factors that depend on the shift along x, and along y.
        signs: 1 for the part along x that keeps its value with the sign of the shift, −1 for the
            one that changes it; the same along y.
        weight: Function of the shift's direction (cos, sin), times 1/ρ.

    Returns:
        Shape (K², K²), over the square of the area.
    """
    total = np.zeros(4 * (count,))
    for along, across, flip in ((0, 1, False), (1, 0, True)):
        # s = L u, t = s v, ρ = s √(1 + v²), ds dt / ρ = ds dv / √(1 + v²) = ds dw;
        # the integrand is of degree 4 K − 2 in s
        steep = np.arcsinh(lengths[across] / lengths[along])
        s, weights = gauss_points(np.array([0.0, lengths[along]]), 2 * count)
        # with v = sinh w so many points leave 1e-11
        w, others = gauss_points(np.array([0.0, steep]), count + 12)
        direction = 1.0 / np.cosh(w), np.tanh(w)
        others = others * weight(*(reversed(direction) if flip else direction))
        first = _part(parts[along](s, lengths[along], count), signs[along]) * weights[:, None, None]
        t = np.multiply.outer(s, np.sinh(w))
        second = _part(parts[across](t.ravel(), lengths[across], count), signs[across])
        second = np.einsum("w,swkl->skl", others, second.reshape(*t.shape, count, count))
        part = np.tensordot(first, second, axes=(0, 0))  # k, k', l, l'
        total += part.transpose(2, 0, 3, 1) if flip else part.transpose(0, 2, 1, 3)
    area = lengths[0] * lengths[1]
    return np.asarray(total.reshape(count**2, count**2) / area**2)


def _part(products: Array, sign: float) -> Array:
    """Return the even part of products with the sign of the shift, or the odd one with −1."""
    return np.asarray(0.5 * (products + sign * products.transpose(0, 2, 1)))


def _products(shifts: Array, length: float, count: int) -> Array:
    """Return ∫ φ_k(x) φ_l(x + s) dx, shape (shifts, K, K) [mm]."""
    return _overlaps(shifts, length, mode_values, count)


def _product_slopes(shifts: Array, length: float, count: int) -> Array:
    """Return the derivatives of `_products` to the shift, shape (shifts, K, K)."""
    ends = mode_values(length - shifts, length, count).T[:, :, None]
    last = mode_values(np.array([length]), length, count)[:, 0]
    return _overlaps(shifts, length, mode_slopes, count) - ends * last


def _overlaps(
    shifts: Array, length: float, there: Callable[[Array, float, int], Array], count: int
) -> Array:
    """Return ∫ φ_k(x) ψ_l(x + s) dx where both are on the interval, shape (shifts, K, K)."""
    nodes, weights = gauss_rule(count)
    half = 0.5 * (length - shifts)[:, None]
    x = half * (1.0 + nodes)
    shape = count, len(shifts), count
    first = mode_values(x.ravel(), length, count).reshape(shape).transpose(1, 0, 2)
    second = there((x + shifts[:, None]).ravel(), length, count).reshape(shape)
    return np.asarray((first * (half * weights)[:, None]) @ second.transpose(1, 2, 0))


@_of_few_modes
def side_modes(sides: FreeSides, count: int) -> Array:
    """Return the displacements that free sides add by modes of pressure, in modes, for E* = 1.

    Args:
        sides: The free sides.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m S φ_n dA dA', symmetric, shape (K², K²) [1/mm].
    """
    matrix = _of_sides(sides, count, stress=False)[0]
    return np.asarray(0.5 * (matrix + matrix.T))


@_of_few_modes
def side_stress_modes(sides: FreeSides, count: int) -> Array:
    """Return the stresses in the surface that free sides add by modes of pressure, in modes.

    Args:
        sides: The free sides.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫ φ_m σ_αβ[φ_n] dA of xx, yy and xy, shape (3, K², K²) [1/mm²].
    """
    return _of_sides(sides, count, stress=True)


def _of_sides(sides: FreeSides, count: int, *, stress: bool) -> Array:
    """Return the displacements, or the stresses xx, yy and xy, by all sides in modes."""
    width, height = sides.lengths
    across_x = _by_two(sides, 0, count, stress=stress)
    alike = width == height and sides.pair(0) == sides.pair(1)
    across_y = across_x if alike else _by_two(sides, 1, count, stress=stress)
    turned = (across_y[[1, 0, 2]] if stress else across_y).transpose(0, 3, 1, 4, 2)
    total = across_x.transpose(0, 1, 3, 2, 4) + turned
    return np.asarray(total.reshape(len(total), count**2, count**2) / (width * height) ** 2)


def _by_two(sides: FreeSides, axis: int, count: int, *, stress: bool) -> Array:
    """Return what two opposite sides add, by modes across them and along.

    Returns:
        Displacements, or the stresses normal to the sides, along them and in shear, in front; shape
        (1 or 3, k, k', l, l').
    """
    # waves are left out as the cube of their length
    length, waves = sides.lengths[axis], np.arange(8 * count)
    nodes = distance_nodes(length / 1024.0 / count**2, length)
    loads = _integrals(nodes, length, count)
    if stress:
        kernels = sides.stresses(axis, nodes, waves)
    else:
        kernels = sides.compliance(axis, nodes, waves)[None]
    lines = zip(loads @ kernels @ loads.T, (1.0, 1.0, -1.0), strict=False)
    return np.stack([_along(sides, axis, part, far) for part, far in lines])


def _along(sides: FreeSides, axis: int, lines: Array, far: float) -> Array:
    """Sum waves along two opposite sides.

    Args:
        sides: The free sides.
        axis: 0 for sides across x, 1 across y.
        lines: By waves, modes across the sides and modes of loads across them, shape (w, k, k').
        far: 1 for what the opposite side does as this one; −1 for shear, which changes its sign
            there, and is a sine where the load is a cosine, and −cos where it is a sine.

    Returns:
        Shape (k, k', l, l').
    """
    length, count = sides.lengths[1 - axis], lines.shape[1]
    waves = np.arange(len(lines))
    # cosine series of period 2 L, of which the load takes one half
    lines = lines * np.where(waves == 0, 0.5, 1.0)[:, None, None] / length
    parity = np.arange(count) % 2
    low, high = sides.pair(axis)
    lines *= float(low) + high * far * np.where(parity[:, None] == parity, 1.0, -1.0)
    cosines, sines = _waves(waves, count) * length
    seen = (cosines, sines) if far > 0.0 else (sines, -cosines)
    both = sum(
        np.einsum("kw,lw->wkl", one, load) for one, load in zip(seen, (cosines, sines), strict=True)
    )
    return np.tensordot(lines, both, axes=(0, 0))


def _waves(waves: Indices, count: int) -> Array:
    """Return means of the modes times cos and sin πw(x/L − 1/2), shape (2, K, waves).

    ∫ P_k(t) exp(i z t) dt = 2 iᵏ j_k(z).
    """
    k = np.arange(count)[:, None]
    bessel = np.sqrt(2.0 * k + 1.0) * scipy.special.spherical_jn(k, 0.5 * np.pi * waves)
    phase = 1j**k
    return np.stack([bessel * phase.real, bessel * phase.imag])


def _integrals(nodes: Array, length: float, count: int) -> Array:
    """Return the integrals of modes times the interpolation from nodes, shape (K, nodes) [mm]."""
    ticks = np.concatenate([[0.0], nodes[nodes < length], [length]])
    x, weights = gauss_points(ticks, count // 2 + 4)
    modes = mode_values(x, length, count) * weights
    return np.asarray((values_at(nodes, x).T @ modes.T).T)


_ROWS = 256
"""Rows of a matrix that are made at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class FaceModes:
    """Compliance of the top of a body in its Legendre modes.

    Args:
        lengths: Sides (Lx, Ly) of the top [mm].
        matrix: Displacements in modes by the moments of pressures or tractions, symmetric [mm/N].
        origin: Corner of the top, where the contact face does not start with it [mm].
        rough: The same off by the error of the elements; NaN where that is not known, None where
            there is none.

    Attributes:
        directions: Shape of the directions of displacements and of tractions; none of pressures.

    Raises:
        InputError: When a length is not positive, or the matrix not one of K² modes, not finite or
            not symmetric.
    """

    directions: ClassVar[tuple[int, ...]] = ()

    lengths: Lengths
    matrix: Array
    origin: tuple[float, float] = (0.0, 0.0)
    rough: Array | None = None

    def __post_init__(self) -> None:
        matrix = np.asarray(self.matrix, float)
        object.__setattr__(self, "matrix", matrix)
        check_fields(self)
        count = round(matrix.shape[-1] ** 0.5) if matrix.ndim else 0
        if not count or matrix.shape != (*self.directions, count**2, count**2):
            shape = ", ".join([*map(str, self.directions), "K²", "K²"])
            problem = "the compliance is not one of K × K modes"
            raise InputError(problem, value=matrix.shape, allowed=f"({shape}), K ≥ 1")
        apart = float(np.abs(matrix - _transposed(matrix)).max())
        if not apart <= 1e-9 * float(np.abs(matrix).max()):
            problem = "the compliance is not finite and symmetric"
            raise InputError(problem, value=apart, allowed="D = Dᵀ")

    @property
    def count(self) -> int:
        """Modes K along a side."""
        return _count(self.matrix)

    def fewer(self, count: int) -> Self:
        """Return the compliance of the first modes alone, which shows how well K modes resolve it.

        Args:
            count: Modes along a side, at most K.
        """
        if not 1 <= count <= self.count:
            allowed = f"1 … {self.count}"
            raise InputError("so many modes are not there", value=count, allowed=allowed)
        first = _by_modes(self.matrix)[..., :count, :count, :count, :count]
        return type(self)(self.lengths, _of_modes(first), self.origin)

    def off_by_error(self) -> Self | None:
        """Return the compliance off by the error of its elements; None where that is not known."""
        if self.rough is None:
            return self
        known = bool(np.isfinite(self.rough).all())
        return type(self)(self.lengths, self.rough, self.origin) if known else None

    def within(self, lengths: tuple[float, float]) -> Self:
        """Return the compliance of a rectangle of the top, in modes of its own.

        Args:
            lengths: Sides of the rectangle, whose corner is the origin of the coordinates [mm].
        """
        if lengths == self.lengths and self.origin == (0.0, 0.0):
            return self
        change = modes_within(lengths, self.lengths, self.origin, self.count)

        def changed(matrix: Array) -> Array:
            found = change @ matrix @ change.T
            return np.asarray(0.5 * (found + _transposed(found)))

        rough = None if self.rough is None else changed(self.rough)
        return type(self)(lengths, changed(self.matrix), rough=rough)

    def plus(self, other: Self) -> Self:
        """Return the compliance of this body and of another one on the same rectangle.

        Args:
            other: That of the other body, whose modes may be more or fewer.
        """
        rough = None
        if self.rough is not None or other.rough is not None:
            parts = (one.matrix if one.rough is None else one.rough for one in (self, other))
            rough = _sum(*parts)
        return type(self)(self.lengths, _sum(self.matrix, other.matrix), self.origin, rough)

    def placed(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Return places counted from the corner of the top [mm]."""
        return np.asarray(x, float) - self.origin[0], np.asarray(y, float) - self.origin[1]

    def means(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the means of the modes over cells, shapes (K, nx) and (K, ny).

        Args:
            x: Borders of the cells along x, counted from the corner of the top, (nx + 1,) [mm].
            y: Borders along y, shape (ny + 1,) [mm].
        """
        length_x, length_y = self.lengths
        return mode_means(x, length_x, self.count), mode_means(y, length_y, self.count)


def _count(matrix: Array) -> int:
    """Return the number of modes along a side."""
    return round(matrix.shape[-1] ** 0.5)


def _transposed(matrix: Array) -> Array:
    """Return a compliance with displacements and tractions exchanged."""
    swapped = matrix.swapaxes(-1, -2)
    return swapped if matrix.ndim == 2 else swapped.swapaxes(0, 1)


def _sum(one: Array, other: Array) -> Array:
    """Return the sum of two compliances, of which one may have fewer modes."""
    count = max(map(_count, (one, other)))
    total = np.zeros((*one.shape[:-2], *4 * (count,)))
    for part in (one, other):
        few = _count(part)
        total[..., :few, :few, :few, :few] += _by_modes(part)
    return _of_modes(total)


def _by_modes(matrix: Array) -> Array:
    """Return a compliance with an axis for the modes along each side."""
    return matrix.reshape(*matrix.shape[:-2], *4 * (_count(matrix),))


def _of_modes(by_modes: Array) -> Array:
    """Return the compliance of which `_by_modes` makes this."""
    count = by_modes.shape[-1]
    return by_modes.reshape(*by_modes.shape[:-4], *2 * (count**2,))


@dataclass(frozen=True, slots=True, eq=False)
class BodyModes(FaceModes):
    """Compliance D of the top of a body under pressures, in its Legendre modes; see `FaceModes`."""

    lifts: ClassVar[bool] = True

    def on(self, borders_x: ArrayLike, borders_y: ArrayLike) -> ModesOnCells:
        """Return the compliance of cells of pressure, by means over the cells.

        Args:
            borders_x: Borders of the cells along x, ascending within the top, (nx + 1,) [mm].
            borders_y: Borders along y, shape (ny + 1,) [mm].
        """
        x, y = self.placed(borders_x, borders_y)
        return ModesOnCells(self.matrix, *self.means(x, y), np.diff(x), np.diff(y))

    def on_cells(self, cells: CellGrid) -> ModesOnCells:
        """Return the compliance of equal cells of pressure, see `on`."""
        return self.on(*cells.borders)

    def patch_compliance(self, patches: PatchGrid) -> Array:
        """Return the mean over patch i by unit pressure on patch j, shape (N, N) [mm/MPa].

        Args:
            patches: N patches within the face.
        """
        cells = self.on(patches.borders_x, patches.borders_y)
        modes = np.kron(cells.means_x, cells.means_y)
        return np.asarray(modes.T @ self.matrix @ modes * patches.areas)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyPoints:
    """Compliance of a body between n points of its contact face.

    Args:
        body: The compliance in modes.
        values: Modes at the points, shape (K², n).
    """

    body: BodyModes
    values: Array

    @classmethod
    def at(cls, body: BodyModes, x: Array, y: Array) -> Self:
        """Evaluate the modes at points.

        Args:
            body: The compliance in modes.
            x: Abscissae, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
        """
        along_x, along_y = (
            mode_values(place - corner, length, body.count)
            for place, corner, length in zip((x, y), body.origin, body.lengths, strict=True)
        )
        return cls(body=body, values=(along_x[:, None] * along_y).reshape(len(body.matrix), -1))

    def among(self, index: Indices) -> Self:
        """Return the compliance between some of the points."""
        return replace(self, values=self.values[:, index])

    def displacement(self, force: Array) -> Array:
        """Return the displacements of the points by forces on them, shape (n,) [mm].

        Args:
            force: Forces, shape (n,) [N].
        """
        return np.asarray(self.values.T @ (self.body.matrix @ (self.values @ force)))

    def by(self, loaded: BodyPoints) -> Array:
        """Return the displacements of the points by unit forces on m others, (n, m) [mm/N].

        Args:
            loaded: The points that the forces act on, on the same body.
        """
        return np.asarray(self.values.T @ (self.body.matrix @ loaded.values))

    def patch_means(self, patches: PatchGrid, force: Array) -> Array:
        """Return the mean displacements of patches, shape (N,) [mm].

        Args:
            patches: N patches within the face.
            force: Forces on the points, shape (n,) [N].
        """
        cells = self.body.on(patches.borders_x, patches.borders_y)
        amplitudes = (self.body.matrix @ (self.values @ force)).reshape(self.body.count, -1)
        return np.asarray((cells.means_x.T @ amplitudes @ cells.means_y).ravel())


@dataclass(frozen=True, slots=True, eq=False)
class ModesOnCells:
    """A compliance in modes, or stresses in modes, on the cells of a grid.

    Pressures are uniform on cells. Displacements are means over the cells, which makes the
    compliance symmetric for equal cells.

    Args:
        matrix: D, shape (K², K²) [mm/N]; or several such matrices, shape (n, K², K²).
        means_x: Means of the modes along x over the cells, shape (K, nx).
        means_y: Means along y, shape (K, ny).
        widths_x: Widths of the cells along x, shape (nx,) [mm].
        widths_y: Widths along y, shape (ny,) [mm].
    """

    matrix: Array
    means_x: Array
    means_y: Array
    widths_x: Array
    widths_y: Array

    def displacement(self, pressure: Array) -> Array:
        """Return the displacements of all cells by pressures on them.

        Args:
            pressure: The pressures, shape (nx, ny) [MPa].

        Returns:
            Shape (nx, ny) [mm]; one after the other for several matrices.
        """
        moments = (self.means_x * self.widths_x) @ pressure @ (self.means_y * self.widths_y).T
        amplitudes = self.matrix @ moments.ravel()
        amplitudes = amplitudes.reshape(*self.matrix.shape[:-2], *moments.shape)
        return np.asarray(self.means_x.T @ amplitudes @ self.means_y)

    def add_between(self, total: Array, row: Indices, column: Indices) -> None:
        """Add the displacements of n cells by unit pressures on them.

        Args:
            total: What they are added to, shape (n, n) [mm].
            row: Rows of the cells.
            column: Their columns.
        """
        modes, moved = self._modes_of(row, column), self.matrix @ self._loads_of(row, column)
        for some in blocks(len(row), _ROWS):
            total[some] += modes[:, some].T @ moved

    def on_patches(self, along: tuple[Array, Array], row: Indices, column: Indices) -> Array:
        """Return the displacements of patches by pressures on n cells; see `ComplianceTerm`."""
        modes = np.kron(self.means_x @ along[0].T, self.means_y @ along[1].T)
        return np.asarray(modes.T @ (self.matrix @ self._loads_of(row, column)))

    def _modes_of(self, row: Indices, column: Indices) -> Array:
        """Return the modes' means over n cells, shape (K², n)."""
        modes = self.means_x[:, None, row] * self.means_y[:, column]
        return modes.reshape(len(self.matrix), -1)

    def _loads_of(self, row: Indices, column: Indices) -> Array:
        """Return the modes' moments by unit pressures on n cells, shape (K², n)."""
        return self._modes_of(row, column) * (self.widths_x[row] * self.widths_y[column])

    def among(self, rows: Indices, columns: Indices) -> ModesOnCells:
        """Return the cells where some rows and columns of the grid cross.

        Args:
            rows: Indices of the rows, shape (r,).
            columns: Indices of the columns, shape (c,).
        """
        x, y = self.means_x[:, rows], self.means_y[:, columns]
        return ModesOnCells(self.matrix, x, y, self.widths_x[rows], self.widths_y[columns])

    @property
    def single(self) -> ModesOnCells:
        """Itself: a few modes take no time, in whichever precision the pressures are."""
        return self


class BodyStresses:
    """Stresses in its top that a finite body adds to those of the half-space, as means over cells.

    Args:
        lengths: Sides (Lx, Ly) of the top [mm].
        grid: Cells (nx, ny), which fill the top but a margin all around.
        matrix: S of σ_xx, σ_yy and σ_xy; mode k K + l varies as mode k along x and l along y, shape
            (3, K², K²) [1/mm²].
        margin: Width of the margin [mm].

    Raises:
        InputError: When the matrix is not one of K² modes, or not finite.
    """

    def __init__(
        self,
        lengths: tuple[float, float],
        grid: tuple[int, int],
        matrix: Array,
        margin: float = 0.0,
    ) -> None:
        count = round(matrix.shape[-1] ** 0.5)
        if not count or matrix.shape != (3, count**2, count**2) or not np.isfinite(matrix).all():
            problem = "the stresses are not those of K × K modes"
            raise InputError(problem, value=matrix.shape, allowed="finite, (3, K², K²), K ≥ 1")
        x, y = (
            np.linspace(margin, length - margin, cells + 1)
            for length, cells in zip(lengths, grid, strict=True)
        )
        means = mode_means(x, lengths[0], count), mode_means(y, lengths[1], count)
        self._on_cells = ModesOnCells(matrix, *means, np.diff(x), np.diff(y))

    def stresses(self, pressure: Array) -> Array:
        """Return σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny) [MPa].

        Args:
            pressure: On all cells, shape (nx, ny) [MPa].
        """
        return self._on_cells.displacement(pressure)

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`.

        Args:
            fields: Weights of σ_xx, σ_yy and σ_xy on the cells, in b ways, (b, 3, nx, ny).

        Returns:
            Weights of the pressures, shape (b, nx, ny).
        """
        on = self._on_cells
        amplitudes = on.means_x @ fields @ on.means_y.T
        moments = np.tensordot(amplitudes.reshape(len(fields), 3, -1), on.matrix, axes=2)
        loads_x, loads_y = on.means_x * on.widths_x, on.means_y * on.widths_y
        return np.asarray(loads_x.T @ moments.reshape(-1, *amplitudes.shape[2:]) @ loads_y)


def half_space_traction_modes(
    lengths: tuple[float, float], poisson_ratio: float, count: int
) -> Array:
    """Return the displacements of a half-space by modes of traction, in modes, for E* = 1.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        poisson_ratio: ν.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        Displacements along x, y and into the body by tractions likewise, shape (3, 3, K², K²)
        [1/mm]. Those into the body by pressures are left 0: `half_space_modes` has them.

    Source:
        Johnson, Contact Mechanics (1985), eqs. 3.19 and 3.75.
    """
    kappa = poisson_ratio / (1.0 - poisson_ratio)
    beta = (1.0 - 2.0 * poisson_ratio) / (2.0 * (1.0 - poisson_ratio))
    total = np.zeros((3, 3, count**2, count**2))
    normal = half_space_modes(lengths, count)

    def modes(powers: tuple[int, int]) -> Array:
        return direction_modes(lengths, powers, count)

    total[0, 0] = normal + kappa * modes((2, 0))
    total[1, 1] = normal + kappa * modes((0, 2))
    total[0, 1] = total[1, 0] = kappa * modes((1, 1))
    total[2, 0], total[2, 1] = beta * modes((1, 0)), beta * modes((0, 1))
    total[0, 2], total[1, 2] = -total[2, 0], -total[2, 1]
    return total


@dataclass(frozen=True, slots=True, eq=False)
class TractionModes(FaceModes):
    """Compliance of the top of a body under tractions, in its Legendre modes; see `FaceModes`.

    Its matrix has displacements along x, y and into the body by moments of tractions likewise, but
    for those into the body by pressures, which `BodyModes` has.
    """

    directions: ClassVar[tuple[int, ...]] = (3, 3)

    def on(self, borders_x: ArrayLike, borders_y: ArrayLike) -> TractionsOnCells:
        """Return the compliance of cells of uniform tractions, by means over the cells.

        Args:
            borders_x: Borders of the cells along x, ascending within the top, (nx + 1,) [mm].
            borders_y: Borders along y, shape (ny + 1,) [mm].
        """
        x, y = self.placed(borders_x, borders_y)
        area = (x[1] - x[0]) * (y[1] - y[0])
        return TractionsOnCells(self.matrix * area, *self.means(x, y))


@dataclass(frozen=True, slots=True, eq=False)
class TractionsOnCells:
    """A compliance under tractions, in modes, on equal cells of a grid.

    Args:
        matrix: Displacements in modes by tractions on cells, shape (3, 3, K², K²) [mm/MPa].
        means_x: Means of the modes along x over the cells, shape (K, nx).
        means_y: Means along y, shape (K, ny).
    """

    matrix: Array
    means_x: Array
    means_y: Array

    def displacement(self, tractions: Array) -> Array:
        """Return the displacements along the surface by tractions along it, shape (2, nx, ny) [mm].

        Args:
            tractions: The tractions, shape (2, nx, ny) [MPa].
        """
        return self._by(tractions, slice(0, 2), slice(0, 2))

    def sideways(self, pressure: Array) -> Array:
        """Return the displacements along the surface by pressures (nx, ny), (2, nx, ny) [mm]."""
        return self._by(pressure[None], slice(0, 2), slice(2, 3))

    def across(self, tractions: Array) -> Array:
        """Return the displacements into the body by tractions (2, nx, ny), shape (nx, ny) [mm]."""
        return self._by(tractions, slice(2, 3), slice(0, 2))[0]

    def among(self, rows: Indices, columns: Indices) -> TractionsOnCells:
        """Return the cells where some rows and columns of the grid cross.

        Args:
            rows: Indices of the rows, shape (r,).
            columns: Indices of the columns, shape (c,).
        """
        return TractionsOnCells(self.matrix, self.means_x[:, rows], self.means_y[:, columns])

    def _by(self, loads: Array, seen: slice, by: slice) -> Array:
        moments = self.means_x @ loads @ self.means_y.T
        flat = moments.reshape(len(loads), -1)
        amplitudes = np.einsum("abmn,bn->am", self.matrix[seen, by], flat, optimize=True)
        amplitudes = amplitudes.reshape(-1, *moments.shape[1:])
        return np.asarray(self.means_x.T @ amplitudes @ self.means_y)
