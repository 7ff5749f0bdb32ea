"""The half-space under tangential tractions on a grid of cells, by fast Fourier transforms.

Tractions q are uniform on the cells, and tangential displacements u are those of their centres:

    u = (1/(π E*)) ∫ [1/ρ + κ d dᵀ/ρ³] q dA,    κ = ν/(1 − ν),

the point force of Cerruti integrated over cells. On a periodic grid each wave k has its own
compliance (2/|k|) (I + κ (I − k kᵀ/k²)). Kernels and spectra are for E* = 1. Two elastic bodies are
one of their E* and of the ν that weights theirs by 1/G.

Unlike bodies, and a rigid plane on an elastic one, differ in how far pressures pull their surfaces
sideways. With Dundurs' β the difference is

    u = −(β/(π E*)) ∫ p d/ρ² dA,    u_z = (β/(π E*)) ∫ q·d/ρ² dA.

Goodman's assumption neglects both, which separates the normal contact from shear (Goodman 1962).
Otherwise both problems are solved in turn until they agree (`micro.friction.coupled`). A finite
body adds a term to both.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy import fft

from patchlaw.geometry.materials import MaterialPair
from patchlaw.micro.boundary_elements.body_modes import TractionsOnCells
from patchlaw.micro.boundary_elements.half_space_grid import Cells, Field, apart, fast_counts
from patchlaw.micro.closed_forms.love import corner_parts
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.parallel import BLOCK, blocks, cores, in_threads

Pair = tuple[float, float]


def cerruti_kernels(grid: tuple[int, int], spacing: Pair, poisson_ratio: float) -> Array:
    """Return displacements at cell (i, j) by uniform unit tractions on cell (0, 0).

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        poisson_ratio: ν.

    Returns:
        Displacements along x by tractions along x, along y by y, and along x by y, shape
        (3, nx, ny) [mm]. The first two are even in both distances, the last one is odd.

    Source:
        Cerruti's point force: Johnson, Contact Mechanics (1985), eq. 3.75.
    """
    u, v = ((np.arange(n + 1) - 0.5) * step for n, step in zip(grid, spacing, strict=True))
    along_x, along_y = corner_parts(u[:, None], v)
    parts = np.stack([along_x, along_y, -np.hypot(u[:, None], v)])
    xx, yy, xy = np.diff(np.diff(parts, axis=1), axis=2) / np.pi
    ratio = poisson_ratio / (1.0 - poisson_ratio)
    return np.stack([xx + yy + ratio * xx, xx + yy + ratio * yy, ratio * xy])


def padded_spectra(padded: tuple[int, int], spacing: Pair, poisson_ratio: float) -> Array:
    """Return the transforms of Cerruti's kernels on a padded grid.

    Args:
        padded: Cells (mx, my) of the padded grid, even, at least twice the loaded ones.
        spacing: Sides (dx, dy) of a cell [mm].
        poisson_ratio: ν.

    Returns:
        Real quarter spectra of the kernels xx, yy and xy, shape (3, mx // 2 + 1, my // 2 + 1) [mm];
        the last one changes its sign with each wave number.
    """
    half = padded[0] // 2 + 1, padded[1] // 2 + 1
    kernels = cerruti_kernels(half, spacing, poisson_ratio)
    spectra = np.zeros_like(kernels)
    for kernel, spectrum in zip(kernels[:2], spectra, strict=False):
        spectrum[:] = fft.dctn(kernel, type=1, workers=cores())
    spectra[2, 1:-1, 1:-1] = -fft.dstn(kernels[2, 1:-1, 1:-1], type=1, workers=cores())
    return spectra


def periodic_spectra(grid: tuple[int, int], spacing: Pair, poisson_ratio: float) -> Array:
    """Return the periodic compliance at the wave vectors of a grid.

    The mean displacement is not determined. It is set to 0, as that under pressures is.

    Args:
        grid: Numbers of cells (nx, ny) of a period.
        spacing: Sides (dx, dy) of a cell [mm].
        poisson_ratio: ν.

    Returns:
        Real quarter spectra xx, yy and xy, shape (3, nx // 2 + 1, ny // 2 + 1) [mm].
    """
    kx = 2.0 * np.pi * fft.rfftfreq(grid[0], spacing[0])[:, None]
    ky = 2.0 * np.pi * fft.rfftfreq(grid[1], spacing[1])
    k, ratio = np.hypot(kx, ky), poisson_ratio / (1.0 - poisson_ratio)
    normal = np.divide(2.0, k, out=np.zeros_like(k), where=k > 0.0)
    across = ratio * np.divide(normal, k * k, out=np.zeros_like(k), where=k > 0.0)
    mixed = -across * kx * ky
    if grid[0] % 2 == 0:
        mixed[-1] = 0.0  # waves of two cells run either way
    if grid[1] % 2 == 0:
        mixed[:, -1] = 0.0
    return np.stack([normal + across * ky * ky, normal + across * kx * kx, mixed])


class TangentialConvolution:
    """Multiplication of two fields by a symmetric 2 × 2 spectrum, on all cores.

    Rows and columns are transformed as those of `half_space_grid.Convolution` are. The result does
    not depend on the number of threads.

    Args:
        spectra: Real quarter spectra xx, yy and xy, shape (3, mx // 2 + 1, my // 2 + 1); their
            precision is that of the products.
        grid: Cells (nx, ny) of the fields.
        padded: Cells (mx, my) of the grid on which the convolution is circular.
        work: Complex array of 2 nx (my // 2 + 1) numbers at least; overwritten by every call.
    """

    def __init__(
        self, spectra: Field, grid: tuple[int, int], padded: tuple[int, int], work: Field
    ) -> None:
        self.grid, self.padded, self._spectra = grid, padded, spectra
        self._work = work.ravel().view(np.result_type(spectra.dtype, np.complex64))

    def __call__(self, fields: Field, rows: Indices | None = None) -> Field:
        """Convolve two fields in place.

        Args:
            fields: Values on the cells of some rows of the grid, shape (2, r, ny); overwritten.
            rows: Indices of these rows, shape (r,), zeros being on all others; all rows of the
                grid when not given.

        Returns:
            ``fields``, holding the result on the same rows.
        """
        (mx, my), count, half = self.padded, fields.shape[1], self.padded[0] // 2 + 1
        work, waves = self._rows(count), self._spectra.shape[2]
        loaded: Any = slice(0, count)
        if rows is not None:
            dense = rows.size and rows[-1] - rows[0] + 1 == rows.size
            loaded = slice(rows[0], rows[-1] + 1) if dense else rows

        def along_rows(here: slice) -> None:
            work[:, here] = fft.rfft(fields[:, here], n=my, axis=2)

        def along_columns(here: slice) -> None:
            columns = np.zeros((2, mx, here.stop - here.start), work.dtype)
            columns[:, loaded] = work[:, :, here]
            columns = fft.fft(columns, axis=1, overwrite_x=True)
            part, beyond = self._spectra[:, :, here], slice(mx - half, 0, -1)
            _multiply(columns[:, :half], part, np.add)
            _multiply(columns[:, half:], part[:, beyond], np.subtract)
            work[:, :, here] = fft.ifft(columns, axis=1, overwrite_x=True)[:, loaded]

        def back_along_rows(here: slice) -> None:
            fields[:, here] = fft.irfft(work[:, here], n=my, axis=2)[:, :, : self.grid[1]]

        size = 4 * work.itemsize
        in_threads(along_rows, blocks(count, 2 * BLOCK // (size * my), 4))
        in_threads(along_columns, blocks(waves, max(BLOCK // mx, 128) // size, 4))
        in_threads(back_along_rows, blocks(count, 2 * BLOCK // (size * my), 4))
        return fields

    def on_cells(self, cells: Cells, values: Array) -> Array:
        """Convolve values on some cells, shape (2, n); return those of the same cells."""
        scale = float(np.abs(values).max(initial=0.0)) or 1.0  # single precision ends at 1e-38
        # the fields take the place of their own transforms, whose rows are at least as long
        memory = self._rows(len(cells.rows)).view(self._spectra.dtype)
        place = cells.row * memory.shape[2] + cells.column
        fields, flat = memory[:, :, : self.grid[1]], memory.reshape(2, -1)
        fields[:] = 0.0
        flat[0, place], flat[1, place] = values / scale
        self(fields, cells.rows)
        return np.stack([flat[0, place], flat[1, place]]).astype(np.float64) * scale

    def fields(self) -> Field:
        """Return memory for two fields on all cells, which the next product overwrites."""
        return self._rows(self.grid[0]).view(self._spectra.dtype)[:, :, : self.grid[1]]

    def _rows(self, count: int) -> Field:
        """Return the memory of transformed rows, shape (2, count, my // 2 + 1)."""
        waves = self._spectra.shape[2]
        return self._work[: 2 * count * waves].reshape(2, count, waves)


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


class TangentialGrid:
    """Tangential compliance of nx × ny cells of a half-space, and its inverse on a period.

    The period of the inverse is that of `micro.boundary_elements.half_space_grid`: where tractions
    do not continue periodically it is larger than the grid, so that images are far.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        poisson_ratio: ν.
        periodic: Whether tractions continue periodically; a half-space that is loaded on the grid
            alone otherwise.
        modulus: Contact modulus E* [MPa].

    Attributes:
        grid: Numbers of cells (nx, ny).
        self_compliance: Displacement of a cell by a unit traction on it alone, nearly [mm/MPa].
        inverse: Product with the inverse on the period, in single precision.
        products: Products with tractions so far; each is worth two with pressures.
    """

    def __init__(
        self,
        grid: tuple[int, int],
        spacing: Pair,
        *,
        poisson_ratio: float,
        periodic: bool,
        modulus: float = 1.0,
    ) -> None:
        self.grid, self.products = grid, 0
        padded = period = grid
        if periodic:
            spectra = waves = periodic_spectra(grid, spacing, poisson_ratio) / modulus
        else:
            fast = fast_counts(grid)
            padded, period = (2 * fast[0], 2 * fast[1]), apart(grid)
            spectra = padded_spectra(padded, spacing, poisson_ratio) / modulus
            waves = periodic_spectra(period, spacing, poisson_ratio) / modulus
        own = cerruti_kernels((1, 1), spacing, poisson_ratio)
        self.self_compliance = float(own[0, 0, 0]) / modulus
        most = max(grid[0] * (padded[1] // 2 + 1), period[0] * (period[1] // 2 + 1) // 2 + 1)
        work = np.empty(2 * most, complex)  # one for all: they take turns
        self._exact = TangentialConvolution(spectra, grid, padded, work)
        self._rough = TangentialConvolution(spectra.astype(np.float32), grid, padded, work)
        self.inverse = TangentialConvolution(_inverted(waves), period, period, work)

    def displacement(self, tractions: Array) -> Array:
        """Return the displacements of all cells by tractions, shape (2, nx, ny) [mm].

        Args:
            tractions: The tractions along x and y, shape (2, nx, ny).
        """
        self.products += 1
        return self._exact(tractions.copy())

    def displacement_of(self, cells: Cells, tractions: Array) -> Array:
        """Return the displacements of some cells by tractions on them, shape (2, n) [mm].

        Args:
            cells: The cells.
            tractions: The tractions on them, shape (2, n).
        """
        self.products += 1
        return self._exact.on_cells(cells, tractions)

    def roughly(self, cells: Cells, tractions: Array) -> Array:
        """Return the same in single precision."""
        self.products += 1
        return self._rough.on_cells(cells, tractions)


def _inverted(waves: Array) -> Field:
    """Return the inverse of periodic spectra, in single precision.

    At the mean of a period, where the compliance vanishes, its largest value counts.
    """
    xx, yy, xy = waves
    xx, yy = xx.copy(), yy.copy()
    xx[0, 0] = yy[0, 0] = waves[:2].max()
    return np.asarray(np.stack([yy, xx, -xy]) / (xx * yy - xy**2), np.float32)


class BodyGrid:
    """Tangential compliance of a grid of cells on a finite body; used as a `TangentialGrid`.

    Preconditioners take the half-space alone: what a body adds is smooth.

    Args:
        half_space: The half-space.
        body: What the body adds.
    """

    def __init__(self, half_space: TangentialGrid, body: TractionsOnCells) -> None:
        self._half_space, self._body = half_space, body
        self.grid, self.self_compliance = half_space.grid, half_space.self_compliance
        self.inverse = half_space.inverse
        self._last: tuple[Cells, TractionsOnCells, Indices, int] | None = None

    @property
    def products(self) -> int:
        """Products with tractions so far."""
        return self._half_space.products

    def displacement(self, tractions: Array) -> Array:
        """Return the displacements of all cells; see `TangentialGrid.displacement`."""
        return self._half_space.displacement(tractions) + self._body.displacement(tractions)

    def displacement_of(self, cells: Cells, tractions: Array) -> Array:
        """Return the displacements of some cells; see `TangentialGrid.displacement_of`."""
        return self._half_space.displacement_of(cells, tractions) + self._of_body(cells, tractions)

    def roughly(self, cells: Cells, tractions: Array) -> Array:
        """Return the same in single precision."""
        return self._half_space.roughly(cells, tractions) + self._of_body(cells, tractions)

    def _of_body(self, cells: Cells, tractions: Array) -> Array:
        """Return what the body adds, on the rows and columns of the cells alone."""
        if self._last is None or self._last[0] is not cells:
            columns, column = np.unique(cells.column, return_inverse=True)
            place = cells.row * len(columns) + column.ravel()
            self._last = cells, self._body.among(cells.rows, columns), place, len(columns)
        _, body, place, count = self._last
        some = np.zeros((2, len(cells.rows) * count))
        some[:, place] = tractions
        moved = body.displacement(some.reshape(2, -1, count))
        return np.asarray(moved.reshape(2, -1)[:, place])


tangential_grid = lru_cache(maxsize=4)(TangentialGrid)
"""Half-spaces on grids, the last few of them cached with their kernels and work arrays."""


class CrossCompliance:
    """Displacements along the surface by pressures and across it by tractions, on all cells.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides of a cell [mm].
        materials: The two bodies.
        periodic: Whether loads continue periodically.
        body: What a finite body adds, on these cells, none when not given.
    """

    def __init__(
        self,
        grid: tuple[int, int],
        spacing: tuple[float, float],
        materials: MaterialPair,
        *,
        periodic: bool,
        body: TractionsOnCells | None = None,
    ) -> None:
        self._body = body
        self._shown = tuple(slice(count) for count in grid)
        self._shape = grid if periodic else tuple(2 * count for count in grid)
        waves = _waves if periodic else _padded_waves
        self._waves = waves(grid, spacing) * (materials.dundurs_beta / materials.contact_modulus)

    def sideways(self, pressure: Array) -> Array:
        """Return the displacements along the surface by pressures [MPa], shape (2, nx, ny) [mm]."""
        moved = np.stack([self._convolved(-one, pressure) for one in self._waves])
        if self._body is not None:
            moved += self._body.sideways(pressure)
        return moved

    def across(self, tractions: Array) -> Array:
        """Return the displacements into the body by tractions, shape (nx, ny) [mm].

        Args:
            tractions: The tractions, shape (2, nx, ny) [MPa].
        """
        moved = sum(map(self._convolved, self._waves, tractions))
        if self._body is not None:
            moved = moved + self._body.across(tractions)
        return np.asarray(moved)

    def _convolved(self, kernel: Array, field: Array) -> Array:
        loaded = fft.rfft2(field, s=self._shape, workers=cores())
        return np.asarray(fft.irfft2(kernel * loaded, s=self._shape, workers=cores())[self._shown])


def _waves(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the transforms −2 i k/|k|² of d/(π ρ²) on a period, shape (2, nx, ny // 2 + 1)."""
    kx = 2.0 * np.pi * fft.fftfreq(grid[0], spacing[0])[:, None]
    ky = 2.0 * np.pi * fft.rfftfreq(grid[1], spacing[1])
    square = kx * kx + ky * ky
    square[0, 0] = np.inf
    k = np.stack(np.broadcast_arrays(kx, ky))
    return np.asarray(-2.0j * k / square)


def _padded_waves(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the transforms of d/(π ρ²), integrated over cells, on a grid twice as long and wide.

    Its antiderivative is y ln ρ + x atan(y/x) along x.
    """
    u, v = (np.arange(-n, n + 1) * step - 0.5 * step for n, step in zip(grid, spacing, strict=True))
    x, y = u[:, None], v[None, :]
    log = np.log(np.hypot(x, y))
    parts = np.stack([y * log + x * np.arctan(y / x), x * log + y * np.arctan(x / y)])
    kernels = np.diff(np.diff(parts, axis=1), axis=2) / np.pi
    around = fft.ifftshift(kernels, axes=(1, 2))
    return np.asarray(fft.rfft2(around, workers=cores()))
