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

import numpy as np
from scipy import fft

from patchlaw.geometry import MaterialPair
from patchlaw.micro.boundary_elements.body_modes import TractionsOnCells
from patchlaw.micro.boundary_elements.half_space_grid import (
    Cells,
    Convolution,
    Field,
    apart,
    fast_counts,
)
from patchlaw.micro.closed_forms import corner_parts
from patchlaw.support import Array, Indices, cores

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
    mixed[-1] *= grid[0] % 2  # waves of two cells run either way
    mixed[:, -1] *= grid[1] % 2
    return np.stack([normal + across * ky * ky, normal + across * kx * kx, mixed])


class TangentialGrid:
    """Tangential compliance of nx × ny cells, and its inverse on a period of the half-space.

    The period of the inverse is that of `micro.boundary_elements.half_space_grid`: where tractions
    do not continue periodically it is larger than the grid, so that images are far. What a body
    adds is smooth, and left out of it.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        poisson_ratio: ν.
        periodic: Whether tractions continue periodically; a half-space that is loaded on the grid
            alone otherwise.
        modulus: Contact modulus E* [MPa].
        body: What a finite body adds on these cells; nothing when not given.

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
        body: TractionsOnCells | None = None,
    ) -> None:
        self.grid, self.products, self._body = grid, 0, body
        made = _convolutions(grid, spacing, poisson_ratio, periodic, modulus)
        self._exact, self._rough, self.inverse = made
        own = cerruti_kernels((1, 1), spacing, poisson_ratio)
        self.self_compliance = float(own[0, 0, 0]) / modulus
        self._last: tuple[Cells, TractionsOnCells, Indices, int] | None = None

    def displacement(self, tractions: Array) -> Array:
        """Return the displacements of all cells by tractions, shape (2, nx, ny) [mm].

        Args:
            tractions: The tractions along x and y, shape (2, nx, ny) [MPa].
        """
        self.products += 1
        moved = self._exact(tractions.copy())
        return moved if self._body is None else moved + self._body.displacement(tractions)

    def displacement_of(self, cells: Cells, tractions: Array) -> Array:
        """Return the displacements of some cells by tractions on them, shape (2, n) [mm].

        Args:
            cells: The cells.
            tractions: The tractions on them, shape (2, n) [MPa].
        """
        self.products += 1
        return self._exact.on_cells(cells, tractions) + self._of_body(cells, tractions)

    def roughly(self, cells: Cells, tractions: Array) -> Array:
        """Return the same in single precision."""
        self.products += 1
        return self._rough.on_cells(cells, tractions) + self._of_body(cells, tractions)

    def _of_body(self, cells: Cells, tractions: Array) -> Array | float:
        """Return what a body adds, on the rows and columns of the cells alone."""
        if self._body is None:
            return 0.0
        if self._last is None or self._last[0] is not cells:
            columns, column = np.unique(cells.column, return_inverse=True)
            place = cells.row * len(columns) + column.ravel()
            self._last = cells, self._body.among(cells.rows, columns), place, len(columns)
        _, body, place, count = self._last
        some = np.zeros((2, len(cells.rows) * count))
        some[:, place] = tractions
        moved = body.displacement(some.reshape(2, -1, count))
        return np.asarray(moved.reshape(2, -1)[:, place])


@lru_cache(maxsize=4)
def _convolutions(
    grid: tuple[int, int], spacing: Pair, poisson_ratio: float, periodic: bool, modulus: float
) -> tuple[Convolution, Convolution, Convolution]:
    """Return products with the half-space, the same in single precision, and with its inverse."""
    padded = period = grid
    if periodic:
        spectra = waves = periodic_spectra(grid, spacing, poisson_ratio) / modulus
    else:
        fast = fast_counts(grid)
        padded, period = (2 * fast[0], 2 * fast[1]), apart(grid)
        spectra = padded_spectra(padded, spacing, poisson_ratio) / modulus
        waves = periodic_spectra(period, spacing, poisson_ratio) / modulus
    most = max(grid[0] * (padded[1] // 2 + 1), period[0] * (period[1] // 2 + 1) // 2 + 1)
    work = np.empty(2 * most, complex)  # one for all: they take turns
    return (
        Convolution(spectra, grid, padded, work),
        Convolution(spectra.astype(np.float32), grid, padded, work),
        Convolution(_inverted(waves), period, period, work),
    )


def _inverted(waves: Array) -> Field:
    """Return the inverse of periodic spectra, in single precision.

    At the mean of a period, where the compliance vanishes, its largest value counts.
    """
    xx, yy, xy = waves
    xx, yy = xx.copy(), yy.copy()
    xx[0, 0] = yy[0, 0] = waves[:2].max()
    return np.asarray(np.stack([yy, xx, -xy]) / (xx * yy - xy**2), np.float32)


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
    kx[grid[0] // 2] *= grid[0] % 2  # waves of two cells run either way
    ky[grid[1] // 2] *= grid[1] % 2
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
