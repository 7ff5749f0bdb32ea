"""What the free sides of a block add on the cells of a grid: displacements, and surface stresses.

Pressures are uniform on the cells, and displacements and stresses are their means over them. Along
a side, Fourier's transform takes cells to waves, which do not mix. Across it, matrices take cells
to values at nodes of the distance from the side (`micro.boundary_elements.free_sides`). They have
few numbers a row that are not 0, and yet are two to four times as quick as sparse ones.

Theory: docs/theory.md, section 5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from patchlaw.micro.boundary_elements.free_sides import FreeSides, distance_nodes, means_over
from patchlaw.micro.boundary_elements.grid_compliance import CellGrid
from patchlaw.micro.boundary_elements.half_space_grid import add_symmetric, many, on_patches
from patchlaw.support import Array, Indices, blocks, in_threads

Waves = NDArray[np.complex128]

_LINES = 2**22
"""Numbers that the lines between rows of cells hold at most: all that are cached, 33 MB of 160²
cells, or at a time."""
_MANY = 2**16
"""Cells that gain by threads."""
_BLOCK = 2**17
"""Cells that a thread takes at a time: what it makes of them then stays in its cache."""
_SWAPPED = [1, 0, 2]
"""Of σ_xx, σ_yy, σ_xy, those normal to the sides across y, along them and in shear."""
_SHEAR = np.array([-1j, 1j])
"""Shear ~ sin by loads ~ cos; it changes its sign from a side to the opposite one."""


@dataclass(frozen=True, slots=True, eq=False)
class _SidePair:
    """Two opposite sides, and rows of cells along them, continued by zeros to twice the length.

    Args:
        means: Means over the rows' cells of values at the a nodes of either side, whose first is
            the mean over the outermost row of what varies there alone, shape (rows, 2 a).
        kernels: For each wave what loads at the nodes do at the nodes, (waves, a or 3 a, a).
        place: Places of the cells in a row, counted from the first of them, shape (cells,).
    """

    means: Array
    kernels: Array
    place: Indices

    @classmethod
    def of(cls, sides: FreeSides, axis: int, grid: tuple[int, int], *, stress: bool) -> Self:
        """Return two sides with all cells between them.

        Args:
            sides: The free sides.
            axis: 0 for the sides across x, 1 across y.
            grid: Cells (nx, ny) between the sides.
            stress: Whether the kernels are those of stresses, three below each other, or of
                displacements.
        """
        length, rows, cells = sides.lengths[axis], grid[axis], grid[1 - axis]
        step, period = length / rows, 2 * cells
        nodes = _nodes(length, rows, stress=stress)
        means, combined = _means(sides, axis, rows, nodes)
        of_waves = sides.stresses if stress else sides.compliance

        def summed(waves: Indices) -> Array:
            # waves on twice the length of a side that cells take for the same, some run backwards
            total: Any = 0.0
            for alias in (waves - period, waves, waves + period):
                of_nodes = of_waves(axis, nodes, np.abs(alias))
                of_nodes *= (step * np.sinc(alias / period) ** 2)[:, None, None]
                if stress:
                    of_nodes[2] *= np.sign(alias)[:, None, None]
                total = total + of_nodes
            parts = combined @ total @ combined.T
            return np.concatenate(parts, axis=1) if stress else parts

        few = np.array_split(np.arange(cells + 1), 1 + cells // 16)  # which stay in the cache
        return cls(means, np.concatenate([summed(some) for some in few]), np.arange(cells))

    def turned(self, sides: FreeSides, *, stress: bool) -> _SidePair:
        """Return the sides across y of a square from those across x: waves do the same there."""
        rows = len(self.place)
        means, _ = _means(sides, 1, rows, _nodes(sides.lengths[1], rows, stress=stress))
        if np.array_equal(means, self.means):
            return self
        return _SidePair(means, self.kernels, self.place)

    def among(self, rows: Indices, cells: Indices) -> _SidePair:
        """Return the same sides with some of these rows, and some of the cells of each."""
        place = self.place[cells]
        return _SidePair(self.means[rows], self.kernels, place - place[0])

    @property
    def single(self) -> _SidePair:
        """The same sides in single precision."""
        single: Any = np.float32
        return replace(self, means=self.means.astype(single), kernels=self.kernels.astype(single))

    def loaded(self, fields: Array) -> Waves:
        """Return the waves of loads at the nodes by fields, (b, f, rows, cells); see `waves_of`."""
        return self.waves_of(self.means.T @ fields)

    def waves_of(self, lines: Array) -> Waves:
        """Return waves of lines of loads at the nodes, shape (waves, f a, 2 b).

        Args:
            lines: The lines of b times f fields, of which kernels take f together, shape
                (b, f, 2 a, cells).
        """
        (count, parts, _, cells), last = lines.shape, self.place[-1] + 1
        by_cell = lines.reshape(count, parts, 2, -1, cells).transpose(4, 1, 3, 0, 2)
        placed = (np.empty if last == cells else np.zeros)((last, *by_cell.shape[1:]), lines.dtype)
        placed[self.place] = by_cell
        waves = fft.rfft(placed.reshape(last, -1), 2 * len(self.kernels) - 2, axis=0)
        return waves.reshape(len(self.kernels), -1, 2 * count)

    def on_cells(self, waves: Waves, parts: int = 1) -> Array:
        """Return means over the cells by values' waves, (waves, f a, 2 b): (b, f, rows, cells)."""
        return np.asarray(self.means @ self.lines_of(waves, parts))

    def lines_of(self, waves: Waves, parts: int = 1) -> Array:
        """Return lines of values at the nodes by waves, (waves, f a, 2 b): (b, f, 2 a, cells)."""
        count = waves.shape[2] // 2
        by_wave = waves.reshape(len(self.kernels), -1)
        lines = fft.irfft(by_wave, 2 * len(self.kernels) - 2, axis=0)[self.place]
        by_side = lines.reshape(len(self.place), parts, -1, count, 2).transpose(3, 1, 4, 2, 0)
        return by_side.reshape(count, parts, -1, len(self.place))

    def add_between(self, total: Array, row: Indices, cell: Indices) -> None:
        """Add the displacements of n cells by unit pressures on them, shape (n, n)."""
        if self.means.shape[0] ** 2 * len(self.kernels) <= _LINES:
            add_symmetric(total, partial(self._block, _all_lines(self), row, cell))
            return
        used, row = np.unique(row, return_inverse=True)
        step = max(1, _LINES // (len(used) * len(self.kernels)))
        for first in range(0, len(used), step):  # some rows at a time, for the memory
            some = np.flatnonzero((row >= first) & (row < first + step))
            lines = self.lines_between(self.means[used[first : first + step]], self.means[used])
            apart = np.abs(cell[some, None] - cell)
            total[some] += lines[row[some, None] - first, row, apart]

    @staticmethod
    def _block(lines: Array, row: Indices, cell: Indices, some: slice, others: slice) -> Array:
        """Return the displacements of some cells by pressures on others, by all lines."""
        place = row[some, None] * len(lines) + row[others]
        place *= lines.shape[2]
        place += np.abs(cell[some, None] - cell[others])
        return lines.take(place)

    def lines_between(self, rows: Array, others: Array) -> Array:
        """Return displacements along rows by a unit pressure in others, by their `means`.

        Returns:
            Shape (r, o, cells).
        """
        count = len(self.kernels)
        # waves are cosines: a product is quicker than their transform
        apart = np.arange(self.place[-1] + 1)
        cosines = np.cos(np.pi / (count - 1) * (np.multiply.outer(np.arange(count), apart)))
        cosines *= np.where(np.arange(count) % (count - 1), 1.0, 0.5)[:, None] / (count - 1)
        nodes = np.tensordot(self.kernels, cosines, (0, 0))  # from node to node
        loaded = [np.tensordot(one, nodes, 1) for one in np.split(rows, 2, axis=1)]
        return np.asarray(others @ np.concatenate(loaded, axis=1))

    def on_patches(self, across: Array, along: Array, row: Indices, cell: Indices) -> Array:
        """Return the displacements of Na × Nb patches by unit pressures on n cells, (Na, Nb, n).

        Args:
            across: Shares of the rows in the means over patches, shape (Na, rows).
            along: Shares of the cells of a row, shape (Nb, cells).
            row: Rows of the n cells.
            cell: Their places in the rows.
        """
        rows, place = np.unique(row, return_inverse=True)
        lines = self.lines_between(across @ self.means, self.means[rows]).swapaxes(0, 1)
        return on_patches(lines, along, place, cell).reshape(len(across), len(along), -1)

    def displaced(self, lines: Array) -> Array:
        """Return displacements at the nodes by lines of loads there, shape (2 a, cells)."""
        return self.lines_of(_multiplied(self.kernels, self.waves_of(lines[None, None])))[0, 0]

    def stresses(self, pressures: Array) -> Array:
        """Return stresses by b fields of pressures, shape (b, rows, cells).

        Returns:
            Those normal to the sides, along them and in shear, shape (b, 3, rows, cells).
        """
        waves = _multiplied(self.kernels, self.loaded(pressures[:, None]))
        _sheared(waves, _SHEAR)
        return self.on_cells(waves, 3)

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses` to b × 3 fields of cells, shape (b, rows, cells)."""
        waves = self.loaded(fields)
        _sheared(waves, _SHEAR.conj())
        return self.on_cells(_multiplied(self.kernels.transpose(0, 2, 1), waves))[:, 0]


@lru_cache(maxsize=8)
def _all_lines(pair: _SidePair) -> Array:
    """Return the lines between all rows, (rows, rows, cells); cached for other surfaces, too."""
    return pair.lines_between(pair.means, pair.means)


def _nodes(length: float, rows: int, *, stress: bool) -> Array:
    """Return distances from a side at which stresses or displacements are known [mm]."""
    # with 1/16 the mean stress over the cell in a corner of constant pressure errs by 8 % of the
    # largest one, with 1/256 by 0.4 %
    return distance_nodes(length / rows / (256.0 if stress else 16.0), length)


def _means(sides: FreeSides, axis: int, rows: int, nodes: Array) -> tuple[Array, Array]:
    """Return means over rows of cells of values near both sides, and the values by the nodes'.

    Nodes that matter in the outermost row alone do so by their mean, which is one value for all.

    Args:
        sides: The free sides.
        axis: 0 for the sides across x, 1 across y.
        rows: Number of rows.
        nodes: Distances of the nodes from a side [mm].

    Returns:
        Shapes (rows, 2 a) and (a, nodes).
    """
    length = sides.lengths[axis]
    lower = means_over(nodes, np.linspace(0.0, length, rows + 1))
    inner = lower[1:].any(axis=0)
    near = int(np.argmax(inner)) if inner.any() else len(nodes)
    combined = np.eye(len(nodes))[near - 1 :]
    combined[0, :near] = lower[0, :near]
    lower = np.hstack([np.eye(rows, 1), lower[:, near:]])
    low, high = (float(there) for there in sides.pair(axis))
    return np.hstack([low * lower, high * lower[::-1]]), combined


def _multiplied(kernels: Array, waves: Waves) -> Waves:
    """Multiply waves by real matrices, shapes (waves, m, n) and (waves, n, 2 b), contiguous."""
    return np.matmul(kernels, waves.view(kernels.dtype)).view(waves.dtype)


def _sheared(waves: Waves, factors: NDArray[np.complex128]) -> None:
    """Multiply the last of three parts of waves, shape (waves, 3 a, 2 b), by a factor a side."""
    last = waves[:, -(waves.shape[1] // 3) :]
    last *= np.tile(factors, waves.shape[2] // 2)


def _pairs(
    sides: FreeSides, spacing: tuple[float, float], *, stress: bool
) -> tuple[_SidePair, _SidePair]:
    """Return the sides across x and those across y, around cells that fill the rectangle."""
    nx, ny = (round(length / step) for length, step in zip(sides.lengths, spacing, strict=True))
    across_x = _SidePair.of(sides, 0, (nx, ny), stress=stress)
    if nx == ny and sides.lengths[0] == sides.lengths[1]:
        return across_x, across_x.turned(sides, stress=stress)
    return across_x, _SidePair.of(sides, 1, (nx, ny), stress=stress)


@dataclass(frozen=True, eq=False)
class SideCells:
    """Compliance that free sides add to the cells where rows and columns cross.

    Pressures and displacements have the precision of the sides.

    Args:
        across_x: The sides across x, with the rows.
        across_y: Those across y, with the columns.
    """

    across_x: _SidePair
    across_y: _SidePair

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        return self.across_x.means.shape[0], self.across_y.means.shape[0]

    def displacement(self, pressure: Array) -> Array:
        """Return the displacements of these cells by pressures on them, shape (r, c) [mm]."""
        rows, columns = pressure.shape
        across_x, across_y = self.across_x, self.across_y
        loads_x, loads_y = (
            np.empty((pair.means.shape[1], count), pressure.dtype)
            for pair, count in ((across_x, columns), (across_y, rows))
        )
        moved = np.empty_like(pressure)

        def load_x(here: slice) -> None:
            loads_x[:, here] = across_x.means.T @ pressure[:, here]

        def load_y(here: slice) -> None:
            loads_y[:, here] = across_y.means.T @ pressure[here].T

        def move(here: slice) -> None:
            by_y = lines_y[:, here].T @ across_y.means.T
            np.add(across_x.means[here] @ lines_x, by_y, out=moved[here])

        in_threads(load_x, blocks(columns, _BLOCK // rows))
        in_threads(load_y, parts := blocks(rows, _BLOCK // columns))
        lines_x, lines_y = across_x.displaced(loads_x), across_y.displaced(loads_y)
        in_threads(move, parts)
        return moved

    def add_between(self, total: Array, row: Indices, column: Indices) -> None:
        """Add the displacements of n cells by unit pressures on them, (n, n) [mm]."""
        self.across_x.add_between(total, row, column)
        self.across_y.add_between(total, column, row)

    def on_patches(self, along: tuple[Array, Array], row: Indices, column: Indices) -> Array:
        """Return the displacements of patches by pressures on n cells; see `ComplianceTerm`."""
        along_x, along_y = along
        by_y = self.across_y.on_patches(along_y, along_x, column, row).swapaxes(0, 1)
        by_x = self.across_x.on_patches(along_x, along_y, row, column)
        return np.asarray((by_x + by_y).reshape(-1, len(row)))

    def among(self, rows: Indices, columns: Indices) -> SideCells:
        """Return some of these rows and columns, by ascending indices among them."""
        return SideCells(self.across_x.among(rows, columns), self.across_y.among(columns, rows))

    @cached_property
    def single(self) -> SideCells:
        """The same in single precision."""
        return SideCells(self.across_x.single, self.across_y.single)


@dataclass(frozen=True, slots=True, eq=False)
class SideTerm:
    """Free sides as a term of the compliance of any cells between them.

    Args:
        sides: The free sides.
        modulus: Contact modulus E* [MPa].
    """

    lifts: ClassVar[bool] = False

    sides: FreeSides
    modulus: float = 1.0

    def on_cells(self, cells: CellGrid) -> SideCells | None:
        """Return what the sides add on some cells.

        Of coarser cells than those of the surface, none where they are few, which solutions start
        from quickly, or where they do not fill the rectangle between the sides.

        Args:
            cells: The cells.
        """
        rows, columns = (
            round(start / step) + np.arange(n)
            for start, step, n in zip(cells.corner, cells.spacing, cells.counts, strict=True)
        )
        last = rows[-1], columns[-1]
        if cells.coarse and not (many(cells.counts) and self._filled(cells.spacing, last)):
            return None
        sides = replace(self.sides, share=self.sides.share / self.modulus)
        every = side_cells(sides, cells.spacing)
        whole = cells.counts == every.counts
        return every if whole else every.among(rows, columns)

    def _filled(self, spacing: tuple[float, float], last: tuple[int, int]) -> bool:
        """Return whether cells fill the rectangle, of which one by its indices is to be part."""
        counts = np.divide(self.sides.lengths, spacing)
        whole = np.round(counts)
        return bool(np.allclose(counts, whole, rtol=1e-9) and np.all(np.less(last, whole)))


class SideStresses:
    """What free sides add to σ_xx, σ_yy and σ_xy in the surface, by pressures on its cells.

    Args:
        sides: The free sides.
        spacing: Sides (dx, dy) of a cell [mm]; the cells fill the rectangle between the sides.
    """

    def __init__(self, sides: FreeSides, spacing: tuple[float, float]) -> None:
        self._pairs = _pairs(sides, spacing, stress=True)

    def stresses(self, pressure: Array) -> Array:
        """Return σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny) [MPa].

        Args:
            pressure: On all cells of the grid, shape (nx, ny) [MPa].
        """
        x, y = self._of_both(_SidePair.stresses, pressure[None], pressure.T[None])
        return np.asarray(x[0] + y[0, _SWAPPED].transpose(0, 2, 1))

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`.

        Args:
            fields: Weights of σ_xx, σ_yy and σ_xy on the cells, in b ways, (b, 3, nx, ny).

        Returns:
            Weights of the pressures, shape (b, nx, ny).
        """
        turned = fields[:, _SWAPPED].transpose(0, 1, 3, 2)
        x, y = self._of_both(_SidePair.adjoint, fields, turned)
        return np.asarray(x + y.transpose(0, 2, 1))

    def _of_both(
        self, act: Callable[[_SidePair, Array], Array], of_x: Array, of_y: Array
    ) -> tuple[Array, Array]:
        """Return what the sides across x and those across y do with fields of cells."""
        across_x, across_y = self._pairs
        if of_x.shape[-2] * of_x.shape[-1] >= _MANY:  # which gain by threads
            works = [lambda: act(across_x, of_x), lambda: act(across_y, of_y)]
            one, other = in_threads(lambda work: work(), works)
        elif across_x is across_y:  # together
            one, other = np.split(act(across_x, np.concatenate([of_x, of_y])), 2)
        else:
            one, other = act(across_x, of_x), act(across_y, of_y)
        return one, other


@lru_cache(maxsize=8)
def side_cells(sides: FreeSides, spacing: tuple[float, float]) -> SideCells:
    """Return all cells between free sides, cached for the next surface between them.

    Args:
        sides: The free sides.
        spacing: Sides (dx, dy) of a cell [mm]; the cells fill the rectangle between the sides.
    """
    return SideCells(*_pairs(sides, spacing, stress=False))


side_stresses = lru_cache(maxsize=8)(SideStresses)
