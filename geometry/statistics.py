"""Roughness of a surface, its power spectrum, and which heights are implausible."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from patchlaw.geometry.surface import Surface
from patchlaw.support import Array, Indices, InputError, cores, is_level, on_rows


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


STEEPEST, STEEPEST_FINITE = 2.0, 0.8
"""Rms gradients of the steepest heights that are accepted, a slope of 63°, and that finite slopes
are taken into account on. Heights in µm that are taken for mm make a surface a thousand times as
steep. At 0.8 the two orders of finite slopes change the force by as much as they err."""

MAPS = ": are they in {0}? Then say height_unit = '{1}'; if a map has spikes, outliers = 'remove'"
LARGEST_MAP = 1e4
"""Side beyond which no instrument measures: lengths of another unit are read as it [mm]."""

STATED = (
    ": {} in {}; is that right, and are its lengths, which of an .xyz xy_unit tells? If the map "
    "has spikes, outliers = 'remove'"
)
SPECTRA = ": the spectrum needs a smaller amplitude, or fewer waves"
"""What may be wrong with the heights of maps and of spectra that are too steep."""


def reading_notes(grid: tuple[int, int], lengths: tuple[float, float]) -> list[str]:
    """Return a note where a map has square cells on its sides if x and y are swapped, and only so.

    Args:
        grid: Numbers of heights (nx, ny), as they were read.
        lengths: Sides (Lx, Ly) that were given [mm].
    """
    (nx, ny), (x, y) = grid, lengths
    dx, dy, dx_swapped, dy_swapped = x / nx, y / ny, x / ny, y / nx
    if abs(dx_swapped / dy_swapped - 1.0) > 0.02 or abs(dx / dy - 1.0) < 0.1:
        return []
    return [
        f"{nx} × {ny} heights make cells of {1e3 * dx:.3g} × {1e3 * dy:.3g} µm on these sides; "
        f"with x and y swapped, {ny} × {nx} heights make square ones of {1e3 * dx_swapped:.3g} × "
        f"{1e3 * dy_swapped:.3g} µm: is a row of the map one along x? Then swap_xy = true"
    ]


def rms_gradient(surface: Surface) -> float:
    """Return the root mean square gradient of the spline through heights, which is kept with them.

    Args:
        surface: The surface.
    """
    kept = vars(surface)  # not a field: another surface has another one
    if "rms_gradient" not in kept:
        kept["rms_gradient"] = math.sqrt(sum(mean_squares(surface)[1:3]))
    return float(kept["rms_gradient"])


def check_slopes(surface: Surface, advice: str = MAPS) -> None:
    """Refuse heights that are steeper than any rough surface, wherever they come from.

    Args:
        surface: The surface, prepared; of two rough sides each, and the sum of their heights.
        advice: What may be wrong with them, at the end of a sentence; {0} and {1} in it stand
            for a unit in which they are less steep than in mm, and its key.

    Raises:
        InputError: Gives the advice.
    """
    gradient = rms_gradient(surface)
    unit = ("µm", "um") if gradient <= 1e3 * STEEPEST else ("nm", "nm")
    if gradient > STEEPEST * (1.0 + 1e-9):
        raise InputError(
            f"the rms gradient of the heights is {gradient:.3g}, no rough surface is so steep"
            f"{advice.format(*unit)}",
            allowed=f"rms gradients up to {STEEPEST:g}",
        )


def check_finite_slopes(surface: Surface) -> None:
    """Refuse slopes that two orders do not describe.

    Args:
        surface: The surface of one body.

    Raises:
        InputError: Says what else can be done, and what error that has.
    """
    gradient = rms_gradient(surface)
    if gradient > STEEPEST_FINITE * (1.0 + 1e-9):
        raise InputError(
            "finite slopes are known to second order, which fails at the rms gradient of the "
            f"surface, {gradient:.3g}; without them (micro.finite_slopes = false) forces of such "
            "surfaces are too large by 10 % and more, by an error that is not measured; "
            "coupling.kind = 'reference' meshes the slopes as they are",
            allowed=f"rms gradients up to {STEEPEST_FINITE:g}",
        )


def surface_notes(surface: Surface) -> list[str]:
    """Return what a user should know of a measured surface before it is pressed.

    Args:
        surface: The surface, prepared.
    """
    gradient, (least, most), notes = rms_gradient(surface), sorted(surface.lengths), []
    share = _plane_share(surface)
    steps = [] if share <= 0.5 and not surface.periodic else _steps_at_borders(surface.heights)
    if surface.periodic and max(steps) > 1.0:
        notes.append(
            "the map is continued periodically and its opposite borders do not match: it steps "
            f"there up to {max(steps):.2g} times as much as between neighbours elsewhere"
        )
    if share > 0.5 and max(steps) > 1.0:
        notes.append(
            f"the map is tilted: its mean plane makes {100 * share:.0f} % of the variance of its "
            "heights, and a level plane touches one edge first; detrend = 'plane' levels it"
        )
    if most > 200.0 or least < 1e-4:
        notes.append(
            f"the map is {surface.lengths[0]:g} × {surface.lengths[1]:g} mm large: are its lengths "
            "in mm? Quantities take units, as in '100 um'"
        )
    differences = difference_gradient(surface)
    if abs(differences - gradient) > 0.05 * gradient:
        notes.append(
            f"waves at the grid are not resolved: the rms gradient is {gradient:.3g} on the spline "
            f"that is pressed, and {differences:.3g} in first differences, which Sdq of ISO "
            "25178-2 usually stands for; contact areas and stiffness depend on the grid, unless "
            "surface.filter removes such waves"
        )
    # coordinates in µm that are taken for mm turn 0.01 to 0.3 into 1e-5 to 3e-4
    if 0.0 < gradient < 3e-4:
        notes.append(
            f"the rms gradient of the map is {gradient:.2g}, far less than of machined "
            "surfaces: are lengths and heights in the units that they were taken in? For heights "
            "in m say height_unit = 'm'; x and y of an .xyz are taken in mm, unless xy_unit or "
            "surface.lengths says otherwise"
        )
    return notes


def check_periodic_form(before: Array, after: Array, kind: str) -> None:
    """Refuse to remove a form that opposite borders of a periodic map match with.

    Args:
        before: Heights, shape (nx, ny) [mm]; not a number where missing.
        after: Heights without the form [mm].
        kind: The kind of ``detrend``.

    Raises:
        InputError: Says what such a map needs.
    """
    steps = zip("xy", _steps_at_borders(after), _steps_at_borders(before), strict=True)
    for axis, step, was in steps:
        if step > 1.0 >= was:
            raise InputError(
                f"the map continues periodically along {axis}, where its borders match; without "
                f"its mean {kind} they do not",
                key="surface.detrend",
                value=kind,
                allowed="'none' or 'mean' for what continues periodically",
            )


def _steps_at_borders(heights: Array) -> list[float]:
    """Return how far opposite borders are from matching along x and along y.

    It is the rms step from the last row to the first, by 1.5 times the largest between rows
    within: 1 or less where the map may continue, by chance beyond what it has within. Missing
    heights do not count.
    """
    ratios = []
    for rows in (heights, heights.T):
        squares = np.diff(rows, axis=0, append=rows[:1]) ** 2
        known = ~np.isnan(squares)
        count = known.sum(axis=1)
        sums = np.where(known, squares, 0.0).sum(axis=1) / np.maximum(count, 1)
        within = 2.25 * float(sums[:-1].max())
        ratios.append(math.sqrt(sums[-1] / within) if within else float("inf" if sums[-1] else 0))
    return ratios


def _plane_share(surface: Surface) -> float:
    """Return the share of the mean plane in the variance of the heights."""
    if is_level(surface.heights):
        return 0.0
    heights = surface.heights - surface.mean_height
    share = 0.0
    for centres, means in ((surface.x, heights.mean(axis=1)), (surface.y, heights.mean(axis=0))):
        u = centres - centres.mean()  # on a grid the slopes along x and y are found one by one
        share += float(np.mean(means * u) ** 2 / np.mean(u * u))
    return share / float(np.mean(heights * heights))
