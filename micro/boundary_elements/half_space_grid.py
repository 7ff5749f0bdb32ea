"""The half-space on a grid of cells, by fast Fourier transforms; kernels are for E* = 1.

Pressures are uniform on the cells, and displacements are those of the cells' centres: their
convolution with Love's rectangle. On a periodic grid each wave has its own compliance 2/|q|.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from patchlaw.micro.closed_forms import corner_integral
from patchlaw.support import BLOCK, Array, Indices, blocks, cores, in_threads, largest, on_rows

Field = NDArray[Any]


def love_kernel(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the displacement at cell (i, j) by uniform unit pressure on cell (0, 0).

    Love's rectangle at the cell centres, L((i dx, j dy))/π: differences of one corner integral on
    the lattice of cell corners. The relative error grows as 1e-16 (distance / cell)².

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        Shape (nx, ny) [mm]; even in both distances.

    Source:
        Love 1929; Johnson 1985, eq. 3.25.
    """
    x, y = ((np.arange(n + 1) - 0.5) * step for n, step in zip(grid, spacing, strict=True))
    found = np.empty(grid)

    def work(rows: slice) -> None:
        terms = corner_integral(x[rows.start : rows.stop + 1, None], y)
        np.divide(np.diff(np.diff(terms, axis=0), axis=1), np.pi, out=found[rows])

    on_rows(work, (grid[0], 4 * grid[1]))  # what it is made of stays in the cache
    return found


def padded_spectrum(padded: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the transform of Love's kernel on a padded grid, where convolution is not circular.

    The padding holds the kernel too, though no pressure acts there: the spectrum of a kernel
    without steps is positive. The kernel is even, so that cosines of a quarter of it are enough.

    Args:
        padded: Cells (mx, my) of the padded grid, even, at least twice the loaded ones.
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        Real quarter spectrum, shape (mx // 2 + 1, my // 2 + 1) [mm].
    """
    kernel = love_kernel((padded[0] // 2 + 1, padded[1] // 2 + 1), spacing)
    return np.asarray(fft.dctn(kernel, type=1, overwrite_x=True, workers=cores()))


def periodic_spectrum(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the periodic Green's function 2/|q| at the wave vectors q of a grid.

    The mean displacement of a periodic half-space is not determined. It is set to 0, so that
    displacements count from the mean of the displaced surface.

    Args:
        grid: Numbers of cells (nx, ny) of a period.
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        Real quarter spectrum, shape (nx // 2 + 1, ny // 2 + 1) [mm].

    Source:
        Johnson 1985, eq. 13.7; Stanley & Kato 1997, doi 10.1115/1.2833523.
    """
    qx = 2.0 * np.pi * fft.rfftfreq(grid[0], spacing[0])
    qy = 2.0 * np.pi * fft.rfftfreq(grid[1], spacing[1])
    q = np.hypot(qx[:, None], qy)
    return np.divide(2.0, q, out=np.zeros_like(q), where=q > 0.0)


_MANY = 2**14
"""Cells of a grid from which on an accurate inverse pays. With it solutions took 0.9 times the core
time on 128² cells, and as long on 64²."""


_SQUARE = 64
"""Rows of a matrix that are made at a time, so that what they are made of stays in the cache."""


class Cells(NamedTuple):
    """Some cells of a grid.

    Attributes:
        flat: Their flat indices, ascending, shape (n,).
        rows: Ascending indices of the rows that they lie in, shape (r,), with others between.
        row: Where among these rows each cell lies, shape (n,).
        column: Its column, shape (n,).
    """

    flat: Indices
    rows: Indices
    row: Indices
    column: Indices

    @classmethod
    def of(cls, flat: Indices, grid: tuple[int, ...]) -> Cells:
        """Return cells of a grid (nx, ny) by their flat indices, ascending."""
        row = flat // grid[1]
        column = flat - row * grid[1]  # faster than with the remainder
        used, order = np.zeros(grid[0], bool), np.zeros(grid[0], np.intp)
        used[row] = True
        rows = np.flatnonzero(used)
        # nearly all rows between the first and the last cell: a range is copied faster than rows
        if rows.size > 0.8 * (rows[-1] - rows[0] + 1 if rows.size else 1):
            rows = np.arange(rows[0], rows[-1] + 1)
        order[rows] = np.arange(len(rows))
        return cls(flat, rows, order[row], column)


class Displaced(NamedTuple):
    """Displacements of all cells by pressures on some.

    Attributes:
        field: The displacements over a factor, shape (nx, ny); the next product overwrites them.
        factor: The factor [mm].
        own: Displacements of the loaded cells, shape (n,) [mm].
        error: What rounding makes of the field.
    """

    field: Any
    factor: float
    own: Array
    error: float

    def times(self, part: float) -> Displaced:
        """Return the displacements by a part of the pressures."""
        if part == 1.0:
            return self
        return Displaced(self.field, part * self.factor, part * self.own, part * self.error)


class Convolution:
    """Multiplication by a real spectrum, in the precision of that spectrum, on all cores.

    It is that of one field by an even kernel, or of two by a symmetric matrix of kernels, of which
    those on the diagonal are even. Rows are transformed block by block into one complex array. Its
    columns are then transformed, multiplied and transformed back, a few at a time, so that all that
    happens to a column happens in the cache. Rows that are empty, or not wanted, and the padding
    are never stored. The result does not depend on the number of threads.

    Args:
        spectrum: Real quarter spectrum of the kernel, shape (mx // 2 + 1, my // 2 + 1); or those of
            xx, yy and xy, of which the last one changes its sign with each wave number.
        grid: Cells (nx, ny) of the fields.
        padded: Cells (mx, my) of the grid on which the convolution is circular.
        work: Complex array of nx (my // 2 + 1) numbers at least for each field; overwritten by
            every call.
    """

    def __init__(
        self, spectrum: Field, grid: tuple[int, int], padded: tuple[int, int], work: Field
    ) -> None:
        self.grid, self.padded = grid, padded
        self._spectrum = spectrum
        self._fields = () if spectrum.ndim == 2 else (2,)
        self._work = work.ravel().view(np.result_type(spectrum.dtype, np.complex64))
        (mx, my), half = padded, spectrum.shape[-2]
        self._factors: Field | None = None  # of real and imaginary parts, where all fits in a block
        if not self._fields and mx * my * self._work.itemsize <= BLOCK:
            mirrored = np.concatenate([spectrum, spectrum[mx - half : 0 : -1]])
            self._factors = np.repeat(mirrored, 2, axis=1)

    def __call__(self, field: Field, rows: Indices | None = None) -> Field:
        """Convolve a field in place, or two of them.

        Args:
            field: Values on the cells of some rows of the grid, shape (r, ny) or (2, r, ny);
                overwritten.
            rows: Indices of these rows, shape (r,), zeros being on all others; all rows of the
                grid when not given.

        Returns:
            ``field``, holding the result on the same rows.
        """
        (mx, my), count = self.padded, field.shape[-2]
        loaded: Any = slice(0, count)
        if rows is not None:
            dense = rows.size and rows[-1] - rows[0] + 1 == rows.size
            loaded = slice(rows[0], rows[-1] + 1) if dense else rows
        if self._factors is not None:
            columns = self._along_columns(fft.rfft(field, n=my, axis=1), slice(None), loaded)
            field[:] = fft.irfft(columns, n=my, axis=1)[:, : self.grid[1]]
            return field
        work = self._rows(count)

        def along_rows(here: slice) -> None:
            work[..., here, :] = fft.rfft(field[..., here, :], n=my)

        def along_columns(here: slice) -> None:
            part = work[..., here]
            found = self._along_columns(part, here, loaded)
            if not np.may_share_memory(found, part):
                part[:] = found

        def back_along_rows(here: slice) -> None:
            field[..., here, :] = fft.irfft(work[..., here, :], n=my)[..., : self.grid[1]]

        size = work.itemsize * (4 if self._fields else 1)
        least = 4 if work.nbytes > BLOCK else 1  # starting threads takes longer than small fields
        in_threads(along_rows, blocks(count, 2 * BLOCK // (size * my), least))
        # of a row two lines of the cache at least
        in_threads(along_columns, blocks(work.shape[-1], max(BLOCK // mx, 128) // size, least))
        in_threads(back_along_rows, blocks(count, 2 * BLOCK // (size * my), least))
        return field

    def _along_columns(self, part: Field, here: slice, loaded: Any) -> Field:
        """Convolve columns of transformed rows.

        Args:
            part: The columns, shape (r, c) or (2, r, c).
            here: Which columns they are.
            loaded: Which rows of the padded grid these are.
        """
        mx, (count, width) = self.padded[0], part.shape[-2:]
        column = part  # transformed in place where no rows are missing
        if count < mx:
            column = np.zeros((*self._fields, mx, width), part.dtype)
            column[..., loaded, :] = part
        column = fft.fft(column, axis=-2, overwrite_x=True)
        if self._factors is not None:
            column.view(self._factors.dtype)[...] *= self._factors
        else:
            factors, half = self._spectrum[..., here], self._spectrum.shape[-2]
            beyond = factors[..., mx - half : 0 : -1, :]
            if self._fields:
                _multiply(column[:, :half], factors, np.add)
                _multiply(column[:, half:], beyond, np.subtract)
            else:
                column[:half] *= factors
                column[half:] *= beyond
        column = fft.ifft(column, axis=-2, overwrite_x=True)
        return column if count == mx else column[..., loaded, :]

    def on_cells(self, cells: Cells, values: Array) -> Array:
        """Convolve values on some cells, shape (n,) or (2, n); return those of the same cells."""
        scale = largest(values) or 1.0  # single precision ends at 1e-38
        field, flat, place = self._spread(len(cells.rows), cells.row, cells.column, values / scale)
        self(field, cells.rows)
        return np.multiply(flat[..., place], scale, dtype=float)

    def spread(self, cells: Cells, values: Array) -> tuple[Field, Field, Indices]:
        """Return a field of values on some cells and 0 on all others, and where these cells are.

        Args:
            cells: The cells.
            values: Shape (n,).

        Returns:
            The field, shape (nx, ny), which the next product overwrites; its memory, flat, and the
            indices of the cells in that.
        """
        return self._spread(self.grid[0], cells.rows[cells.row], cells.column, values)

    def _spread(
        self, rows: int, row: Indices, column: Indices, values: Array
    ) -> tuple[Field, Field, Indices]:
        """Return the same for a field of some rows, or two fields."""
        memory = self.memory(rows)
        field, flat = memory[..., : self.grid[1]], memory.reshape(*self._fields, -1)
        place = row * memory.shape[-1] + column
        field.fill(0.0)
        flat[..., place] = values
        return field, flat, place

    def memory(self, rows: int | None = None) -> Field:
        """Return memory for fields on some rows, or all, which the next product overwrites.

        Its first ny columns take a field: their rows are followed by those of their transforms,
        which take the place of the fields.
        """
        rows = self.grid[0] if rows is None else rows
        return self._rows(rows).view(self._work.real.dtype)

    def _rows(self, count: int) -> Field:
        """Return the memory of transformed rows, shape (count, my // 2 + 1), of each field."""
        shape = (*self._fields, count, self._spectrum.shape[-1])
        return self._work[: int(np.prod(shape))].reshape(shape)


def _multiply(columns: Field, matrix: Field, combine: np.ufunc) -> None:
    """Multiply two fields' waves by a symmetric matrix, in place.

    Args:
        columns: The waves, shape (2, m, c).
        matrix: Elements xx, yy and xy of the matrix, shape (3, m, c).
        combine: `numpy.add`, or `numpy.subtract` where xy has the other sign.
    """
    (x, y), (xx, yy, xy) = columns, matrix
    of_x, of_y = x * xy, y * xy
    x *= xx
    combine(x, of_y, out=x)
    y *= yy
    combine(y, of_x, out=y)


class HalfSpaceGrid:
    """Compliance of nx × ny cells of a half-space, and its approximate inverse.

    The inverse is that of the kernel on a period. Where pressures do not continue periodically, it
    is larger than the grid, so that images are far. See `micro.boundary_elements.inverse`.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether pressures continue periodically; a half-space that is loaded on the grid
            alone otherwise.
        modulus: Contact modulus E* [MPa].
        own: What each cell gives way by under its own pressure besides, on a period all of them
            [mm/MPa].

    Attributes:
        compliance: Product in double precision.
        rough_compliance: The same in single precision.
        inverse: Product with the inverse on the period, in single precision.
        accurate: Whether approximate inverses are to be accurate: on few cells that does not pay,
            nor where the shortest waves mostly give way by what each cell does alone.
    """

    def __init__(
        self,
        grid: tuple[int, int],
        spacing: tuple[float, float],
        *,
        periodic: bool,
        modulus: float = 1.0,
        own: float = 0.0,
    ) -> None:
        padded = period = grid
        if periodic:
            spectrum = periodic_spectrum(grid, spacing) / modulus + own
            waves = spectrum
        else:
            fast = fast_counts(grid)
            padded = 2 * fast[0], 2 * fast[1]
            spectrum = padded_spectrum(padded, spacing) / modulus + own
            period = apart(grid) if many(grid) else fast
            waves = periodic_spectrum(period, spacing) / modulus + own
        shortest = waves.min(initial=np.inf, where=waves > 0.0)
        self.accurate = bool(many(grid) and own <= 0.5 * shortest)
        # at the mean of a period, where the compliance vanishes, its largest value counts
        inverse = 1.0 / np.where(waves > 0.0, waves, waves.max() or 1.0)
        most = max(2 * grid[0] * (padded[1] // 2 + 1), period[0] * (period[1] // 2 + 1))
        work = np.empty((most + 1) // 2, complex)  # one for all: they take turns
        self.compliance = Convolution(spectrum, grid, padded, work)
        self.rough_compliance = Convolution(spectrum.astype(np.float32), grid, padded, work)
        self.inverse = Convolution(inverse.astype(np.float32), period, period, work)

    def add_between(self, total: Array, row: Indices, column: Indices) -> None:
        """Add the displacements of n cells by unit pressures on them.

        Args:
            total: What they are added to, shape (n, n) [mm/MPa].
            row: Rows of the cells.
            column: Their columns.
        """

        def block(some: slice, others: slice) -> Array:
            place = np.abs(row[some, None] - row[others])
            place *= self._kernel.shape[1]
            place += np.abs(column[some, None] - column[others])
            return self._kernel.take(place)

        add_symmetric(total, block)

    def on_patches(self, along: tuple[Array, Array], row: Indices, column: Indices) -> Array:
        """Return the displacements of patches by pressures on n cells; see `ComplianceTerm`."""
        around, count = even_around(self._kernel.T).T, len(self._kernel)
        rows = np.unique(row)
        lines = (along[0] @ around[count - 1 - one : 2 * count - 1 - one] for one in rows)
        return on_patches(lines, along[1], np.searchsorted(rows, row), column)

    @cached_property
    def _kernel(self) -> Array:
        """Displacement of all cells by unit pressure on the first one."""
        one = np.zeros(self.compliance.grid)
        one[0, 0] = 1.0
        return np.asarray(self.compliance(one))


def even_around(lines: Array) -> Array:
    """Return lines of n values at distances 0 … n − 1 with those at −(n − 1) … −1 before them."""
    return np.concatenate([lines[:, :0:-1], lines], axis=1)


def on_patches(lines: Iterable[Array], along: Array, place: Indices, cell: Indices) -> Array:
    """Return the displacements of patches by unit pressures on n cells of some rows, (N, n).

    Args:
        lines: For each row the displacements along it by unit pressure on its first cell, summed
            across Nx rows of patches; even in the distance, shape (Nx, ny) [mm].
        along: Shares of the cells of a row in the means over Ny patches, shape (Ny, ny).
        place: Which of the rows each cell is in, shape (n,).
        cell: Where it is in its row, shape (n,).
    """
    found: list[Array] = []
    for row, line in enumerate(lines):
        own = cell[place == row]
        windows = np.lib.stride_tricks.sliding_window_view(even_around(line), line.shape[1], axis=1)
        found.append(windows[:, line.shape[1] - 1 - own] @ along.T)
    order = np.argsort(np.argsort(place, kind="stable"), kind="stable")
    return np.concatenate(found, axis=1)[:, order].swapaxes(1, 2).reshape(-1, len(cell))


def add_symmetric(total: Array, block: Callable[[slice, slice], Array]) -> None:
    """Add a symmetric matrix by its blocks; large ones take less time so than in new memory.

    Args:
        total: What it is added to, shape (n, n).
        block: Returns the block of some rows and columns.
    """
    for rows in blocks(len(total), _SQUARE):
        part = block(rows, slice(0, rows.stop))
        total[rows, : rows.stop] += part
        total[: rows.start, rows] += part[:, : rows.start].T


def many(grid: tuple[int, int]) -> bool:
    """Return whether a grid has so many cells that an accurate inverse pays."""
    return grid[0] * grid[1] >= _MANY


def apart(grid: tuple[int, int]) -> tuple[int, int]:
    """Return a period around a grid that can be halved five times and has a fast transform."""
    x, y = (32 * int(fft.next_fast_len(-(-5 * n // 128))) for n in grid)
    return x, y


def fast_counts(counts: Iterable[int]) -> tuple[int, int]:
    """Return the next numbers of cells with a fast transform."""
    x, y = (int(fft.next_fast_len(count, real=True)) for count in counts)
    return x, y
