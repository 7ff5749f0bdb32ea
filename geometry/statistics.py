"""Roughness parameters and the radially averaged power spectrum of a surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from geometry.surface import Surface
from support.arrays import Array, Indices
from support.cores import cores, on_rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Roughness:
    """Areal roughness parameters and spectral moments; heights count from their mean.

    Profile moments are averages over profiles along x and along y; radial moments belong to the
    surface. On an isotropic surface <|∇h|²> = 2 m2 and <(∇²h)²> = 8/3 m4, so that the radial
    Nayak parameter is 2/3 of the usual one.

    Args:
        sa: Arithmetical mean height <|h|> [mm].
        sq: Root mean square height [mm].
        ssk: Skewness <h³>/Sq³ [-]; not a number on a flat surface.
        sku: Kurtosis <h⁴>/Sq⁴ [-]; not a number on a flat surface.
        sz: Highest minus lowest height [mm].
        sdq: Root mean square gradient sqrt<|∇h|²> [-].
        m0: Variance of the heights [mm²].
        m2: Profile moment (<h_x²> + <h_y²>)/2 [-].
        m4: Profile moment (<h_xx²> + <h_yy²>)/2 [1/mm²].
        m2_radial: <|∇h|²> [-].
        m4_radial: <(∇²h)²> [1/mm²].

    Source: ISO 25178-2; Nayak 1971, doi 10.1115/1.3451608.
    """

    sa: float
    sq: float
    ssk: float
    sku: float
    sz: float
    sdq: float
    m0: float
    m2: float
    m4: float
    m2_radial: float
    m4_radial: float

    @property
    def nayak(self) -> float:
        """Nayak's parameter α = m0 m4/m2² of the profile moments [-]."""
        return self.m0 * self.m4 / self.m2**2 if self.m2 > 0.0 else math.nan

    @property
    def nayak_radial(self) -> float:
        """The same ratio of the radial moments [-]."""
        return self.m0 * self.m4_radial / self.m2_radial**2 if self.m2_radial > 0.0 else math.nan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerSpectrum:
    """Two-dimensional power spectral density, averaged over rings of angular wavenumber.

    Args:
        wavenumber: Mean |q| of the waves in each ring, ascending, shape (n,) [rad/mm].
        density: Mean density C, shape (n,) [mm⁴]; ∫ C d²q is the variance of the heights.
        waves: Number of waves of the transform in each ring, shape (n,).
        cell: Area Δqx Δqy of a wave in the plane of wavenumbers [1/mm²].
    """

    wavenumber: Array
    density: Array
    waves: Indices
    cell: float

    @property
    def variance(self) -> float:
        """Sum of C Δqx Δqy over all waves, Sq² by Parseval's theorem [mm²]."""
        return float(np.sum(self.density * self.waves) * self.cell)


def roughness(surface: Surface) -> Roughness:
    """Compute roughness parameters from the heights.

    Derivatives are those of the trigonometric interpolant when the surface is periodic, and
    central differences over the inner cells otherwise.

    Args:
        surface: The surface.
    """
    h = surface.heights - surface.mean_height
    square = h * h  # powers of arrays are slow
    variance = float(np.mean(square))
    flat = np.ptp(h) <= 1e-14 * np.abs(surface.heights).max()
    xx, yy, x4, y4, laplacian = derivatives(surface)
    return Roughness(
        sa=float(np.mean(np.abs(h))),
        sq=math.sqrt(variance),
        ssk=math.nan if flat else float(np.mean(square * h)) / variance**1.5,
        sku=math.nan if flat else float(np.mean(square * square)) / variance**2,
        sz=float(np.ptp(h)),
        sdq=math.sqrt(xx + yy),
        m0=variance,
        m2=0.5 * (xx + yy),
        m4=0.5 * (x4 + y4),
        m2_radial=xx + yy,
        m4_radial=laplacian,
    )


def power_spectrum(surface: Surface) -> PowerSpectrum:
    """Average the power spectral density over rings one wave wide.

    Of a periodic surface the variance is that of the heights. On any other Hann's window, scaled to
    unit mean square, suppresses the jump at the border; it keeps the variance in the mean over many
    surfaces.

    Args:
        surface: The surface; its mean is subtracted.
    """
    h, (qx, qy) = surface.heights, _wavenumbers(surface)
    weight = np.ones(surface.grid)
    if not surface.periodic:
        wx, wy = (np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2 for n in surface.grid)
        weight = np.outer(wx, wy)
        weight /= math.sqrt(np.mean(weight**2))
    power = _power((h - np.mean(h * weight) / np.mean(weight)) * weight)
    step = 2.0 * np.pi / min(surface.lengths)
    size = np.hypot(qx, qy)
    ring = np.rint(size / step).astype(np.intp).ravel()
    waves = np.bincount(ring)
    waves[0] -= 1  # q = 0, whose power is none
    kept = waves > 0
    count = waves[kept]
    cell = 4.0 * np.pi**2 / surface.area
    return PowerSpectrum(
        wavenumber=np.bincount(ring, weights=size.ravel())[kept] / count,
        density=np.divide(np.bincount(ring, weights=power.ravel())[kept], count * cell),
        waves=count,
        cell=cell,
    )


def _wavenumbers(surface: Surface) -> tuple[Array, Array]:
    """Return angular wavenumbers in the order of the transform, shapes (nx, 1) and (1, ny)."""
    qx, qy = (
        2.0 * np.pi * scipy.fft.fftfreq(n, d)
        for n, d in zip(surface.grid, surface.spacing, strict=True)
    )
    return qx[:, None], qy[None, :]


def _power(h: Array) -> Array:
    """Return the variance carried by every wave of the discrete transform [mm²]."""
    return np.abs(scipy.fft.fft2(h, norm="forward", workers=cores())) ** 2


def derivatives(surface: Surface) -> list[float]:
    """Return the means of squares <h_x²>, <h_y²>, <h_xx²>, <h_yy²>, <(∇²h)²>; see `roughness`.

    Args:
        surface: The surface.
    """
    return _spectral(surface) if surface.periodic else _differences(surface)


def _spectral(surface: Surface) -> list[float]:
    """Return these means of the trigonometric interpolant."""
    waves = scipy.fft.rfft2(
        surface.heights - surface.mean_height, norm="forward", overwrite_x=True, workers=cores()
    )
    x, y = (np.vander(each.ravel() ** 2, 3, increasing=True) for each in _wavenumbers(surface))
    y = y[: waves.shape[1]]
    y[1 : (surface.grid[1] + 1) // 2] *= 2.0  # waves of the other half

    def moments(rows: slice) -> Array:
        power = np.square(waves.real[rows])
        power += np.square(waves.imag[rows])
        return np.asarray(x[rows].T @ power @ y)

    sums = np.sum(on_rows(moments, waves.shape), axis=0)  # times powers of qx² and qy²
    x2, y2, x4, y4 = sums[1, 0], sums[0, 1], sums[2, 0], sums[0, 2]
    return [float(mean) for mean in (x2, y2, x4, y4, x4 + 2.0 * sums[1, 1] + y4)]


def _differences(surface: Surface) -> list[float]:
    """Return these means from central differences over the inner cells."""
    h, (dx, dy), (nx, ny) = surface.heights, surface.spacing, surface.grid

    def sums(rows: slice) -> list[float]:
        """Return the sums of squares over some rows, without the first and last where need be."""
        own, near = h[rows], h[max(rows.start - 1, 0) : rows.stop + 1]
        inner = slice(max(rows.start, 1) - rows.start, min(rows.stop, nx - 1) - rows.start)
        x, y = (near[2:] - near[:-2]) / (2.0 * dx), (own[:, 2:] - own[:, :-2]) / (2.0 * dy)
        xx = (near[2:] - 2.0 * near[1:-1] + near[:-2]) / dx**2
        yy = (own[:, 2:] - 2.0 * own[:, 1:-1] + own[:, :-2]) / dy**2
        laplacian = xx[:, 1:-1] + yy[inner]
        return [float(np.vdot(part, part)) for part in (x, y, xx, yy, laplacian)]

    along_x, along_y, both = (nx - 2) * ny, nx * (ny - 2), (nx - 2) * (ny - 2)
    counts = along_x, along_y, along_x, along_y, both
    totals = np.sum(on_rows(sums, (nx, 4 * ny)), axis=0)
    return [float(total) for total in totals / counts]
