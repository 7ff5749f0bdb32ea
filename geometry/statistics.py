"""Roughness parameters and the radially averaged power spectrum of a surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from patchlaw.geometry.surface import Surface
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.parallel import cores, on_rows


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
        sdq: Root mean square gradient sqrt<|∇h|²> of the spline through the heights [-].
        sdq_differences: The same of first differences, as programs of instruments have it [-].
        m0: Variance of the spline [mm²].
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
    sdq_differences: float
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

    Moments, and with them Sdq and Nayak's parameter, are those of the spline through the heights,
    the surface that is pressed.

    Args:
        surface: The surface.
    """
    h = surface.heights - surface.mean_height
    square = h * h  # powers of arrays are slow
    variance = float(np.mean(square))
    flat = np.ptp(h) <= 1e-14 * np.abs(surface.heights).max()
    m0, xx, yy, x4, y4, laplacian = mean_squares(surface)
    return Roughness(
        sa=float(np.mean(np.abs(h))),
        sq=math.sqrt(variance),
        ssk=math.nan if flat else float(np.mean(square * h)) / variance**1.5,
        sku=math.nan if flat else float(np.mean(square * square)) / variance**2,
        sz=float(np.ptp(h)),
        sdq=math.sqrt(xx + yy),
        sdq_differences=difference_gradient(surface),
        m0=m0,
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
    h = surface.heights
    qx, qy = (
        2.0 * np.pi * scipy.fft.fftfreq(n, d)
        for n, d in zip(surface.grid, surface.spacing, strict=True)
    )
    weight = np.ones(surface.grid)
    if not surface.periodic:
        wx, wy = (np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2 for n in surface.grid)
        weight = np.outer(wx, wy)
        weight /= math.sqrt(np.mean(weight**2))
    h = (h - np.mean(h * weight) / np.mean(weight)) * weight
    power = np.abs(scipy.fft.fft2(h, norm="forward", workers=cores())) ** 2  # of each wave
    step = 2.0 * np.pi / min(surface.lengths)
    size = np.hypot(qx[:, None], qy)
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


def mean_squares(surface: Surface) -> list[float]:
    """Return <h²>, <h_x²>, <h_y²>, <h_xx²>, <h_yy²> and <(∇²h)²> of the surface that is pressed.

    That is the cubic spline through the heights. On whole periods they are sums over waves: a wave
    of the heights of θ radians a cell has the squares g(θ)/b(θ)² on the spline, g the products of
    B-splines or of their derivatives, and b the B-splines at the heights.

    Args:
        surface: The surface.

    Returns:
        The means, of heights [mm²], gradients [-] and curvatures [1/mm²].
    """
    if not surface.periodic:
        return surface.mean_squares
    waves = scipy.fft.rfft2(
        surface.heights - surface.mean_height, norm="forward", overwrite_x=True, workers=cores()
    )
    angles = (2.0 * np.pi * scipy.fft.fftfreq(n) for n in surface.grid)
    x, y = (_spline_squares(*one) for one in zip(angles, surface.spacing, strict=True))
    y = y[: waves.shape[1]]
    y[1 : (surface.grid[1] + 1) // 2] *= 2.0  # waves of the other half

    def moments(rows: slice) -> Array:
        power = np.square(waves.real[rows])
        power += np.square(waves.imag[rows])
        return np.asarray(x[rows].T @ power @ y)

    sums = np.sum(on_rows(moments, waves.shape), axis=0)  # of orders (0, 1, 2) along x and y
    xx, yy = sums[2, 0], sums[0, 2]
    means = (sums[0, 0], sums[1, 0], sums[0, 1], xx, yy, xx + 2.0 * sums[1, 1] + yy)
    return [float(mean) for mean in means]


def _spline_squares(angle: Array, step: float) -> Array:
    """Return the squares of splines through waves, and of two derivatives, shape (n, 3).

    Args:
        angle: Phase of the waves from height to height [rad].
        step: Distance of the heights [mm].
    """
    c1, c2, c3 = (np.cos(k * angle) for k in (1, 2, 3))
    products = (
        (1208.0 + 1191.0 * c1 + 120.0 * c2 + c3) / 2520.0,
        (2.0 / 3.0 - c1 / 4.0 - 2.0 * c2 / 5.0 - c3 / 60.0) / step**2,
        (8.0 / 3.0 - 3.0 * c1 + c3 / 3.0) / step**4,
    )
    return np.stack(products, axis=1) / ((2.0 + c1) / 3.0)[:, None] ** 2


def difference_gradient(surface: Surface) -> float:
    """Return the root mean square of first differences between neighbours over their distance [-].

    Instruments' programs usually take Sdq of ISO 25178-2 so. Waves of few heights are less steep
    in it than the spline through them.

    Args:
        surface: The surface.
    """
    square = 0.0
    for axis, step in enumerate(surface.spacing):
        steps = np.diff(surface.heights, axis=axis)
        square += float(np.vdot(steps, steps)) / (steps.size * step**2)
    return math.sqrt(square)
