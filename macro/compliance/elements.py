"""Elements of a block that are products of functions along its axes, and their stiffness.

Elements of high order are Legendre polynomials along every axis, graded in depth; `nodal` are those
of hexahedra.

On an element, t from −1 to 1, the shape functions are (1 ∓ t)/2 and
(P_k − P_{k−2}) / √(2(2k − 1)) for k = 2 … p (Szabó & Babuška 1991, ch. 3). The slopes of the latter
are orthogonal, so that all matrices are nearly diagonal. Across the top there is one element, with
1 and t in place of the first two: its functions are even and odd in turn, as the modes are.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy import linalg

from patchlaw.geometry import Material
from patchlaw.geometry.face_frame import gauss_rule, mode_values
from patchlaw.support import Array, Indices, NotConverged

_MORE = 6
"""Degree across the top beyond the number of modes. With 4, 6 and 8 the compliance of a free cube
was too small by 0.0024, 0.0011 and 0.0009 of its mean, summed over 8 × 8 modes; nearly all of it in
the finest modes."""

_TOP = 2.4
"""Height of the topmost element, relative to the shorter side of the top over the number of
modes."""

_LOW = 0.05
"""Height of the lowest element, relative to the block's height or width; displacements are singular
at the edges of the clamped bottom. With 0.15 the mean compliance of a cube was too small by 1.9e-4
at ν = 0.3 and 1.3e-3 at 0.45, with 0.05 by 0.9e-4 and 4.9e-4."""

_END = 0.75
"""Distance from the clamped bottom within which a tall block needs finer elements, in widths."""

_AT_TOP, _BETWEEN, _AT_BOTTOM = 9, 6, 4
"""Degrees along z."""


class Line(NamedTuple):
    """Shape functions along one axis, at the points of Gauss' rule on every element.

    Attributes:
        weights: Weights of the points, shape (m,) [mm].
        values: Values of n functions at the points, shape (n, m).
        slopes: Their slopes, shape (n, m) [1/mm].
        last: Their values at the last point of the line, shape (n,).
        modes: Integrals of modes times the functions, shape (modes, n) [mm]; none along z.
        mode_slopes: Integrals of the modes times the slopes of the functions, shape (modes, n).
    """

    weights: Array
    values: Array
    slopes: Array
    last: Array
    modes: Array
    mode_slopes: Array

    def of_parity(self, odd: int) -> Line:
        """Return the even (0) or the odd (1) functions of a line across the top."""
        return self.combined(np.eye(len(self.values))[:, odd::2])

    def held(self) -> Line:
        """Return the functions of one parity that vanish at both ends."""
        return self.combined(np.eye(len(self.values))[:, self.last == 0.0])

    def combined(self, weights: Array) -> Line:
        """Return other functions, sums of these.

        Args:
            weights: Weights of the functions in every sum, shape (n, sums).
        """
        values, slopes, last = (weights.T @ part for part in (self.values, self.slopes, self.last))
        modes, mode_slopes = self.modes @ weights, self.mode_slopes @ weights
        return Line(self.weights, values, slopes, last, modes, mode_slopes)

    def diagonalised(self) -> tuple[Line, Array]:
        """Return functions that are orthonormal, as are their slopes up to length, and its square.

        Returns:
            Functions f with ∫ f_i f_j = δ_ij and ∫ f_i' f_j' = κ_i δ_ij, and κ, shape (n,) [1/mm²].
        """
        if not len(self.values):
            return self, np.zeros(0)
        squares = [(part * self.weights) @ part.T for part in (self.slopes, self.values)]
        stiffness, vectors = linalg.eigh(*squares)
        return self.combined(vectors), np.maximum(stiffness, 0.0)


def across(length: float, degree: int, count: int) -> Line:
    """Return the functions of one element across the whole top, even and odd in turn.

    Args:
        length: Length of the top [mm].
        degree: Degree of the element, larger than the number of modes.
        count: Number of Legendre modes to integrate.
    """
    t, weights = gauss_rule(degree + 1)
    half = 0.5 * length
    values, slopes = _shape_functions(t, degree)
    values[:2], slopes[:2] = [np.ones_like(t), t], [np.zeros_like(t), np.ones_like(t)]
    weights, slopes = half * weights, slopes / half
    modes = mode_values(half * (1.0 + t), length, count) * weights
    odd = np.add.outer(np.arange(count), np.arange(degree + 1)) % 2  # of the product with values
    integrals = np.where(odd, 0.0, modes @ values.T), np.where(odd, modes @ slopes.T, 0.0)
    return Line(weights, values, slopes, (np.arange(degree + 1) < 2) * 1.0, *integrals)


def upwards(ticks: Array, degrees: Sequence[int]) -> Line:
    """Return the functions of elements along z, which vanish at the first tick.

    Args:
        ticks: Borders of the elements, ascending, shape (n + 1,) [mm].
        degrees: Degree of every element, at least 1.
    """
    t, weights = gauss_rule(max(degrees) + 1)
    first = np.cumsum([0, *degrees])  # of every element: the function that is 1 at its upper end
    values, slopes = np.zeros((2, first[-1], len(degrees), len(t)))
    halves = 0.5 * np.diff(ticks)
    for element, (degree, half) in enumerate(zip(degrees, halves, strict=True)):
        shapes, rises = _shape_functions(t, degree)
        own = slice(first[element], first[element + 1])
        values[own, element], slopes[own, element] = shapes[1:], rises[1:] / half
        if element:
            below = first[element - 1]
            values[below, element], slopes[below, element] = shapes[0], rises[0] / half
    flat, none = (len(values), -1), np.empty((0, len(values)))
    return Line(
        np.outer(halves, weights).ravel(),
        values.reshape(flat),
        slopes.reshape(flat),
        (np.arange(len(values)) == first[-2]) * 1.0,
        none,
        none,
    )


def nodal(ticks: Array, degree: int, borders: Array) -> Line:
    """Return the functions of elements of one degree across a top, even and odd in turn.

    Their products are those of hexahedra. Modes are 1 between two borders and 0 elsewhere.

    Args:
        ticks: Borders of the elements, ascending, those of each half mirrored, shape (n + 1,) [mm].
        degree: Degree of the elements, 1 or 2.
        borders: Borders of the modes, ascending, within the ticks, shape (modes + 1,) [mm].
    """
    pieces = np.union1d(ticks, np.clip(borders, ticks[0], ticks[-1]))
    halves, middles = 0.5 * np.diff(pieces), 0.5 * (pieces[1:] + pieces[:-1])
    points, weights = gauss_rule(degree + 1)
    element = np.searchsorted(ticks, middles) - 1
    start, width = ticks[element][:, None], np.diff(ticks)[element][:, None]
    place = (middles[:, None] + np.outer(halves, points) - start) / width  # 0 to 1 in the element
    nodes = np.arange(degree + 1) / degree
    values, slopes = np.zeros((2, degree * (len(ticks) - 1) + 1, *place.shape))
    for k, node in enumerate(nodes):
        shape = np.poly1d(np.delete(nodes, k), r=True)
        shape /= shape(node)
        at = degree * element + k, np.arange(len(element))
        values[at], slopes[at] = shape(place), shape.deriv()(place) / width
    count, last = len(values), np.eye(1, len(values), len(values) - 1)[0]
    own = np.searchsorted(borders, middles) - 1 == np.arange(len(borders) - 1)[:, None]
    areas = np.repeat(own, degree + 1, axis=1) * np.outer(halves, weights).ravel()
    flat = (count, -1)
    values, slopes = values.reshape(flat), slopes.reshape(flat)
    line = Line(
        np.outer(halves, weights).ravel(), values, slopes, last, areas @ values.T, areas @ slopes.T
    )
    mirrored = np.zeros((count, count))
    for k in range(count):
        sign, pair = 1.0 - 2.0 * (k % 2), k // 2
        mirrored[pair, k] = sign
        mirrored[count - 1 - pair, k] = 1.0
    return line.combined(mirrored)


def _shape_functions(t: Array, degree: int) -> tuple[Array, Array]:
    """Return (1 − t)/2, (1 + t)/2 and the functions of degree 2 and more at t, and their slopes."""
    polynomials = legendre.legvander(t, max(degree, 1)).T
    k = np.arange(2, degree + 1)[:, None]
    rest = (polynomials[2:] - polynomials[:-2]) / np.sqrt(2.0 * (2.0 * k - 1.0))
    slopes = np.sqrt(k - 0.5) * polynomials[1:-1]
    ends, even = np.stack([1.0 - t, 1.0 + t]) / 2.0, np.full_like(t, 0.5)
    return np.concatenate([ends, rest]), np.concatenate([[-even, even], slopes])


def block_lines(lengths: tuple[float, float], height: float, count: int) -> tuple[Line, Line, Line]:
    """Return functions for modes of pressure: one element across the top, more along z.

    Args:
        lengths: Sides of the top [mm].
        height: Height of the block [mm].
        count: Modes along a side of the top.

    Returns:
        Functions along x, y and z.
    """
    x, y = (across(length, count + _MORE, count) for length in lengths)
    ticks = levels(lengths, height, count)
    degrees = [_AT_BOTTOM, *(_BETWEEN,) * (len(ticks) - 3), _AT_TOP][-(len(ticks) - 1) :]
    return x, y, upwards(ticks, degrees)


def levels(lengths: tuple[float, float], height: float, count: int) -> Array:
    """Return the borders of the elements along z, ascending [mm].

    Args:
        lengths: Sides of the top [mm].
        height: Height of the block [mm].
        count: Modes along a side of the top.
    """
    width, step = max(lengths), _TOP * min(lengths) / count
    low = height - _LOW * min(height, width)
    depths = [0.0]
    while step < 0.6 * low and depths[-1] < 0.5 * width:
        depths.append(step)
        step *= 4.0
    if low - depths[-1] > 2.0 * _END * width:
        depths.append(low - _END * width)
    if len(depths) > 1 or height > step:
        depths.append(low)
    return -np.array([*depths, height])[::-1]


_RESIDUAL = 1e-11
"""Residual relative to the load, in the norm of the preconditioned system. On the paper's cube
displacements of patches were then right to 7e-13 of the largest one; with 1e-9 to 8e-11."""
_MOST_ITERATIONS = 2000
_BATCH = 100_000
"""Unknowns times loads that are solved for together, which fit into the caches of a core."""


class ProductStiffness:
    """The stiffness of a block on products of functions, solved by their eigenbases.

    The stiffness of one displacement component is a sum of products of matrices along the axes, so
    that a generalised eigenproblem along every axis makes it diagonal (fast diagonalisation: Lynch,
    Rice & Thomas 1964, doi 10.1007/BF01386067). Only what couples the components is left. Conjugate
    gradients solve for it with a symmetric Gauss–Seidel step over the three components as
    preconditioner, which costs no more than the product (Eisenstat 1981, doi 10.1137/0902001). The
    diagonal part is spectrally equivalent to the whole by Korn's inequality: iterations depend on
    the shape of the block and on Poisson's ratio, not on elements. To a residual of 1e-10 19 were
    counted on a free cube with ν = 0.15, 26 on a block three times as tall as wide with 0.3, and 24
    on one of 0.3 of its width with 0.45. Near incompressibility they grow as the root of λ/μ: under
    one of 16 patches 18, 28, 60 and 145 with ν = 0.3, 0.45, 0.49 and 0.499 on a cube of 20³
    hexahedra. No matrix is assembled.

    Args:
        lines: By component of the displacement its functions along x, y and z.
        material: Elastic constants.

    Attributes:
        lines: The same functions' sums that make the stiffness of each component diagonal; what is
            solved for are their coefficients.
    """

    def __init__(self, lines: Sequence[Sequence[Line]], material: Material) -> None:
        diagonal = [[line.diagonalised() for line in component] for component in lines]
        self.lines = [[line for line, _ in component] for component in diagonal]
        self._sizes = [tuple(len(square) for _, square in component) for component in diagonal]
        self._splits = np.cumsum([math.prod(size) for size in self._sizes])
        self._lame, self._shear = material.lame
        squares = [np.ix_(*(square for _, square in component)) for component in diagonal]
        self._stretched = [
            [self._modulus(i, axis) * square for axis, square in enumerate(component)]
            for i, component in enumerate(squares)
        ]
        self._scale = [1.0 / np.sqrt(sum(component)) for component in self._stretched]
        self._rates = {(i, j): self._rates_of(i, j) for i in range(3) for j in range(3) if i != j}

    def solve(self, loads: Mapping[int, Array]) -> tuple[list[Array], Array]:
        """Solve for the displacements by loads on the last points along z.

        Args:
            loads: By component forces on products of its functions along x and y, (m, nx, ny) [N].

        Returns:
            The displacements of these points by component, shape (nx, ny, all loads), and the
            coefficients of all functions, shape (unknowns, all loads).

        Raises:
            NotConverged: When the iteration does not end.
        """
        _, solved = self._displaced_by(loads, _RESIDUAL)
        tops = [
            np.einsum("abcm,c->abm", part, component[2].last)
            for part, component in zip(self._parts(solved), self.lines, strict=True)
        ]
        return tops, solved

    def works(self, load: Array) -> Array:
        """Return the works of loads along z on what each of them displaces, (m, m) [N mm].

        From displacements that leave a residual they follow to its square, as the stiffness is
        symmetric: half the iterations will do.

        Args:
            load: Forces on products of functions along x and y on the last points, (m, nx, ny) [N].

        Raises:
            NotConverged: When the iteration does not end.
        """
        forces, solved = self._displaced_by({2: load}, math.sqrt(_RESIDUAL))
        half = solved.T @ (forces - 0.5 * self._forces(solved))
        return np.asarray(half + half.T)

    def _displaced_by(self, loads: Mapping[int, Array], residual: float) -> tuple[Array, Array]:
        """Return forces on all functions by loads, and their coefficients, (unknowns, m) both.

        Args:
            loads: As for `solve`.
            residual: Residual that is left, see `_RESIDUAL`.
        """
        twins = self._mirror_images(loads)
        count, unknowns, first = len(twins), int(self._splits[-1]), 0
        forces = np.zeros((unknowns, count))
        for axis, load in loads.items():
            own, last = self._parts(forces)[axis], self.lines[axis][2].last
            along_top = np.moveaxis(load, 0, -1)[:, :, None]
            own[..., first : first + len(load)] = along_top * last[:, None]
            first += len(load)
        alone, place = np.unique(twins, return_inverse=True)
        parts = -(-len(alone) * unknowns // _BATCH)
        split = np.array_split(forces[:, alone], parts, axis=1)
        solved = np.concatenate([self._solved(part, residual) for part in split], axis=1)[:, place]
        if len(mirrored := np.flatnonzero(twins != np.arange(count))):
            u, v, w = (part[..., mirrored].swapaxes(0, 1) for part in self._parts(solved))
            for part, image in zip(self._parts(solved), (v, u, w), strict=True):
                part[..., mirrored] = image
        return forces, solved

    def _mirror_images(self, loads: Mapping[int, Array]) -> Indices:
        """Return for each load the first one that is the same with x and y exchanged, or itself.

        On a square, loads along z and what they displace can be exchanged so.
        """
        found = np.arange(sum(map(len, loads.values())))
        (ux, uy, _), (vx, vy, _), (wx, wy, _) = self.lines
        pairs = (ux, vy), (uy, vx), (wx, wy)
        alike = all(
            np.array_equal(a, b) for one, other in pairs for a, b in zip(one, other, strict=True)
        )
        if set(loads) == {2} and alike:
            first: dict[bytes, int] = {}
            for index, load in enumerate(loads[2]):
                found[index] = first.get(load.T.tobytes(), index)
                first.setdefault(load.tobytes(), index)
        return found

    def growth(self, solved: Array) -> Array:
        """Return by how much the stiffness changes when all functions stretch along z.

        Args:
            solved: Coefficients, shape (unknowns, m).

        Returns:
            Derivative of the work of the stiffness on every pair of displacements with respect to
            the logarithm of the height, shape (m, m).
        """
        # integrals over z grow as the height, and slopes along z as its inverse
        return np.asarray(solved.T @ self._forces(solved, (1.0, 0.0, -1.0)))

    def _forces(self, solved: Array, by_slopes: Sequence[float] = (1.0, 1.0, 1.0)) -> Array:
        """Return the forces that displace, or sums of their parts, shape (unknowns, m).

        Args:
            solved: Coefficients of the displacements, shape (unknowns, m).
            by_slopes: Factors on what has no slope along z, one, and two.
        """
        parts, forces = self._parts(solved), np.empty_like(solved)
        none, one, two = by_slopes
        for i, (part, force) in enumerate(zip(parts, self._parts(forces), strict=True)):
            x, y, z = self._stretched[i]
            force[:] = (none * (x + y) + two * z)[..., None] * part
            for j in {0, 1, 2} - {i}:
                if factor := one if 2 in (i, j) else none:
                    force += factor * self._coupled(i, j, parts[j])
        return forces

    def _modulus(self, component: int, axis: int) -> float:
        return self._lame + 2.0 * self._shear if axis == component else self._shear

    def _parts(self, whole: Array) -> list[Array]:
        """Return views of the components' coefficients, shape (nx, ny, nz, m) each."""
        parts = np.split(whole, self._splits[:2])
        count = whole.shape[1]
        return [part.reshape(*size, count) for part, size in zip(parts, self._sizes, strict=True)]

    def _rates_of(self, row: int, column: int) -> list[tuple[Array, Array]]:
        """Return what couples two components: matrices along the row's axis and the column's."""
        found = []
        for axis in (row, column):
            one, other = self.lines[row][axis], self.lines[column][axis]
            found.append(
                ((one.slopes * one.weights) @ other.values.T,
                 (one.values * one.weights) @ other.slopes.T)
            )  # fmt: skip
        (slope_in, in_slope), (slope_out, out_slope) = found
        return [(self._lame * slope_in, out_slope), (self._shear * in_slope, slope_out)]

    def _coupled(self, row: int, column: int, part: Array) -> Array:
        """Return the forces on a component by the displacements of another."""
        one, other = (
            _along(column, _along(row, part, inner), outer)
            for inner, outer in self._rates[row, column]
        )
        one += other
        return one

    def _swept(self, right: Array, order: Sequence[int]) -> Array:
        """Solve with the part of the stiffness that couples components with those before them."""
        done = np.empty_like(right)
        parts, given = self._parts(done), self._parts(right)
        scaled: dict[int, Array] = {}
        for i in order:
            scale, own = self._scale[i][..., None], parts[i]
            own[:] = given[i]
            for j, part in scaled.items():
                force = self._coupled(i, j, part)
                force *= scale
                own -= force
            if len(scaled) < 2:
                scaled[i] = scale * own
        return done

    def _solved(self, forces: Array, left: float) -> Array:
        """Solve for the coefficients by forces, shape (unknowns, m) both, to a residual."""
        forwards, backwards = range(3), range(2, -1, -1)
        scale = np.concatenate([part.ravel() for part in self._scale])[:, None]
        residual = self._swept(forces * scale, forwards)
        solution, way = np.zeros_like(residual), residual.copy()
        square = np.einsum("nm,nm->m", residual, residual)
        goal = left**2 * square
        for _ in range(_MOST_ITERATIONS):
            if np.all(square <= goal):
                return scale * self._swept(solution, backwards)
            before = self._swept(way, backwards)
            product = self._swept(way - before, forwards)
            product += before
            share = _ratio(square, np.einsum("nm,nm->m", way, product))
            solution += np.multiply(way, share, out=before)
            residual -= np.multiply(product, share, out=product)
            last, square = square, np.einsum("nm,nm->m", residual, residual)
            way *= _ratio(square, last)
            way += residual
        raise NotConverged(
            "the elastic block",
            reason="DIVERGED_MAX_IT",
            iterations=_MOST_ITERATIONS,
            remedy="a smaller Poisson's ratio, or a block that is less tall or flat",
        )


def _ratio(above: Array, below: Array) -> Array:
    """Return quotients, 0 where a load is solved for to the last digit."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0.0)


def _along(axis: int, fields: Array, matrix: Array) -> Array:
    """Multiply fields (nx, ny, nz, m) with a matrix along one of their three axes."""
    before, after = fields.shape[:axis], fields.shape[axis + 1 :]
    if after == (1,):  # one large product in place of many small ones
        return np.asarray(fields[..., 0] @ matrix.T)[..., None]
    columns = fields.reshape(*before, fields.shape[axis], math.prod(after))
    return np.asarray(matrix @ columns).reshape(*before, len(matrix), *after)
