"""Linear elasticity of a block on products of functions along its axes, solved by their eigenbases.

The stiffness of one displacement component is a sum of products of matrices along the axes, so
that a generalised eigenproblem along every axis makes it diagonal (fast diagonalisation: Lynch,
Rice & Thomas 1964, doi 10.1007/BF01386067). Only what couples the components is left. Conjugate
gradients solve for it with a symmetric Gauss–Seidel step over the three components as
preconditioner, which costs no more than the product (Eisenstat 1981, doi 10.1137/0902001). The
diagonal part is spectrally equivalent to the whole by Korn's inequality: iterations depend on the
shape of the block and on Poisson's ratio, not on elements. To a residual of 1e-10 19 were counted
on a free cube with ν = 0.15, 26 on a block three times as tall as wide with 0.3, and 24 on one
of 0.3 of its width with 0.45. Near incompressibility they grow as the root of λ/μ: under one of 16
patches 18, 28, 60 and 145 with ν = 0.3, 0.45, 0.49 and 0.499 on a cube of 20³ hexahedra, 14, 25, 53
and 112 on one of a tenth of its width, 11, 20, 41 and 86 on one of a fiftieth. Fields of little
divergence are the slow ones, and they are many: solving for the 1500 lowest products exactly beside
the sweeps left 34 and 63 of 60 and 147. No matrix is assembled.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from patchlaw.geometry.materials import Material
from patchlaw.macro.compliance.elements import Line
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.errors import NotConverged

_RESIDUAL = 1e-11
"""Residual relative to the load, in the norm of the preconditioned system. On the paper's cube
displacements of patches were then right to 7e-13 of the largest one; with 1e-9 to 8e-11."""
_MOST_ITERATIONS = 2000
_BATCH = 50_000
"""Unknowns times loads that are solved for together, which fit into the caches of a core."""


class ProductStiffness:
    """The stiffness of a block on products of functions.

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
        solved = np.concatenate(
            [self._solved(part) for part in np.array_split(forces[:, alone], parts, axis=1)], axis=1
        )[:, place]
        if len(mirrored := np.flatnonzero(twins != np.arange(count))):
            u, v, w = (part[..., mirrored].swapaxes(0, 1) for part in self._parts(solved))
            for part, image in zip(self._parts(solved), (v, u, w), strict=True):
                part[..., mirrored] = image
        tops = [
            np.einsum("abcm,c->abm", part, component[2].last)
            for part, component in zip(self._parts(solved), self.lines, strict=True)
        ]
        return tops, solved

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
        parts, changed = self._parts(solved), np.empty_like(solved)
        for i, (part, change) in enumerate(zip(parts, self._parts(changed), strict=True)):
            x, y, z = self._stretched[i]
            change[:] = (x + y - z)[..., None] * part
            if i < 2:
                change += self._coupled(i, 1 - i, parts[1 - i])
        return np.asarray(solved.T @ changed)

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

    def _solved(self, forces: Array) -> Array:
        """Solve for the coefficients by forces, shape (unknowns, m) both."""
        forwards, backwards = range(3), range(2, -1, -1)
        scale = np.concatenate([part.ravel() for part in self._scale])[:, None]
        residual = self._swept(forces * scale, forwards)
        solution, way = np.zeros_like(residual), residual.copy()
        square = np.einsum("nm,nm->m", residual, residual)
        goal = _RESIDUAL**2 * square
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
