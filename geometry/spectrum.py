"""Random surfaces of a self-affine, band-limited spectrum: its waves, and heights on a grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import scipy

from patchlaw.geometry.surface import Surface
from patchlaw.support import Array, Counts, Flags, InputError
from patchlaw.support.arguments import (
    Heights,
    Lengths,
    Limits,
    Positive,
    PositiveLength,
    Slope,
    Unit,
    check_fields,
    checked,
)
from patchlaw.support.checks import check_scale

LARGEST_SEED = 2**128 - 1
"""Seeds have at most 128 bits, as many as numpy draws from the system for a seed."""

Band = tuple[float, float]

_ROUNDING = 1.0 + 1e-12
"""Factor by which a band is widened, so that waves on its border belong to it."""

_BANDS = ("waves", "waves_x", "waves_y")
_AMPLITUDES = ("rms_slope", "rms_height", "s0")
_UNITS = {"rms_height": " mm", "s0": " mm^4"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spectrum:
    """A synthesised self-affine surface: S = S0 |k|^(−2 (H + 1)) in a band of waves, 0 outside.

    k = (kx, ky) counts waves per side. On a rectangle its length is measured along x,
    |k| = Lx |q| / 2π with the angular wavenumber q, so that the surface stays isotropic. The
    band is either the ring lo ≤ |k| ≤ hi, or the box |kx| ≤ hi_x, |ky| ≤ hi_y without the inner
    ellipse (kx/lo_x)² + (ky/lo_y)² < 1.

    Args:
        hurst: Hurst exponent of the self-affine roughness, between 0 and 1; 0.8 and more are usual.
        waves: Smallest and largest number of waves along the side x, of a spectrum that is the same
            in all directions: the ring. Either this, or ``waves_x`` and ``waves_y``.
        waves_x: Smallest and largest number of waves along x, of an anisotropic spectrum: the box.
        waves_y: Smallest and largest number of waves along y, of an anisotropic spectrum.
        rms_slope: Rms gradient of the surface, sqrt<|∇h|²>, which every surface has exactly. It is
            scaled by exactly one of ``rms_slope``, ``rms_height`` and ``s0``.
        rms_height: Rms height sqrt<h²>, instead of ``rms_slope`` [mm].
        s0: Amplitude S0 of the spectrum, instead of ``rms_slope`` [mm⁴]; <h²> is the integral of S
            over the angular wavenumbers.
        seed: Number that the random phases follow from; the same number makes the same surface.

    Raises:
        InputError: When a value is out of range, or not exactly one kind of band and one
            amplitude is given.

    Source: Waddad et al. 2016, section 1.1, doi 10.1016/j.triboint.2015.12.023.
    """

    hurst: Annotated[float, Limits(ge=0, le=1)]
    waves: Band | None = None
    waves_x: Band | None = None
    waves_y: Band | None = None
    rms_slope: Annotated[Slope, Positive] | None = None
    rms_height: PositiveLength | None = None
    s0: Annotated[float, Unit("mm**4"), Positive] | None = None
    seed: Annotated[int, Limits(ge=0, le=LARGEST_SEED)] = 0

    def __post_init__(self) -> None:
        check_fields(self)
        bands = self._given(_BANDS)
        if bands not in (["waves"], ["waves_x", "waves_y"]):
            raise InputError(
                f"a spectrum needs exactly one band, not {' and '.join(bands) or 'none'}",
                allowed="waves, or waves_x and waves_y together",
            )
        for name in bands:
            _check_band(getattr(self, name), name)
        amplitudes = self._given(_AMPLITUDES)
        if len(amplitudes) != 1:
            raise InputError(
                f"a spectrum needs exactly one amplitude, not {' and '.join(amplitudes) or 'none'}",
                allowed="one of " + ", ".join(_AMPLITUDES),
            )

    def __str__(self) -> str:
        given = self._given(("hurst", *_BANDS, *_AMPLITUDES, "seed"))
        return "spectrum with " + ", ".join(
            f"{name} {_written(getattr(self, name))}{_UNITS.get(name, '')}" for name in given
        )

    def _given(self, names: Sequence[str]) -> list[str]:
        return [name for name in names if getattr(self, name) is not None]


def _written(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)  # without rounding noise


def _check_band(band: Band, name: str) -> None:
    if not 0.0 <= band[0] <= band[1]:
        allowed = "0 ≤ lo ≤ hi, waves per side"
        raise InputError("is not a band", key=name, value=band, allowed=allowed)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waves:
    """The waves of one random surface, h = Σ 2 B cos(2π (kx x/Lx + ky y/Ly) + φ).

    Only one wave of each pair ±k is listed; the factor 2 counts the other.

    Args:
        kx: Waves per side along x, 0 or positive, shape (n,).
        ky: Waves per side along y, shape (n,).
        amplitude: Amplitudes B of each of the pair, shape (n,) [mm].
        phase: Phases φ, shape (n,) [rad].
    """

    kx: Counts
    ky: Counts
    amplitude: Array
    phase: Array


def random_waves(spectrum: Spectrum, lengths: tuple[float, float]) -> Waves:
    """Draw the waves of a surface, whatever grid will sample it.

    The real surface is the sum over the whole band of B cos(2π k·x/L + φ) with φ(−k) = −φ(k)
    and B = 2π sqrt(S/A0), so that <h²> = Σ B² = ∫ S d²q. The phase of a wave depends on nothing
    but the seed and (kx, ky): phases are drawn for all waves in the order of kx² + ky², then
    kx, then ky, whether in the band or not. So the same seed gives the same surface on any
    grid, and a band that is widened keeps the waves it had.

    Args:
        spectrum: The spectrum.
        lengths: Sides (Lx, Ly) of the surface [mm].

    Raises:
        InputError: When no wave lies in the band.
    """
    kx, ky = _half_plane(_largest_waves(spectrum, lengths))
    phase = np.random.Generator(np.random.PCG64(spectrum.seed)).uniform(0.0, 2.0 * np.pi, len(kx))
    inside = _in_band(spectrum, lengths, kx, ky)
    if not inside.any():
        raise InputError("no wave lies in the band of the spectrum", value=str(spectrum))
    kx, ky, phase = kx[inside], ky[inside], phase[inside]
    return Waves(kx=kx, ky=ky, amplitude=_amplitudes(spectrum, lengths, kx, ky), phase=phase)


@checked
def synthesise(spectrum: Spectrum, *, grid: tuple[Heights, Heights], lengths: Lengths) -> Surface:
    """Synthesise a periodic random surface with uniformly distributed phases.

    Args:
        spectrum: The spectrum.
        grid: Numbers of cells (nx, ny).
        lengths: Sides (Lx, Ly) [mm].

    Returns:
        The periodic surface.

    Raises:
        InputError: When the grid is too coarse for the band, or no wave lies in the band.

    Source: Waddad et al. 2016, section 1.1, doi 10.1016/j.triboint.2015.12.023.
    """
    nx, ny = grid
    largest = _largest_waves(spectrum, lengths)
    _check_resolved((nx, ny), largest, per_wave=1)  # before waves are listed
    waves = random_waves(spectrum, lengths)
    largest = int(np.abs(waves.kx).max()), int(np.abs(waves.ky).max())
    _check_resolved((nx, ny), largest, per_wave=2)
    shift = np.pi * (waves.kx / nx + waves.ky / ny)  # samples lie at cell centres
    coefficient = waves.amplitude * np.exp(1j * (waves.phase + shift))
    half = np.zeros((nx, ny // 2 + 1), dtype=np.complex128)
    for sign in (1, -1):  # the real transform keeps ky ≥ 0, and ±kx at ky = 0
        kept = sign * waves.ky >= 0
        value = coefficient if sign > 0 else coefficient.conj()
        half[sign * waves.kx[kept], sign * waves.ky[kept]] = value[kept]
    heights = scipy.fft.irfft2(half, s=(nx, ny), norm="forward")
    check_scale(heights)
    return Surface(heights=heights, lengths=lengths, periodic=True, source=str(spectrum))


def _check_resolved(grid: tuple[int, int], largest: tuple[int, int], *, per_wave: int) -> None:
    """Refuse a grid that has no more than so many cells per wave along x or y."""
    if any(cells <= per_wave * waves for cells, waves in zip(grid, largest, strict=True)):
        needed = " × ".join(f"{max(4, 2 * waves + 1)}" for waves in largest)
        raise InputError(
            f"a grid of {grid[0]} × {grid[1]} heights is too coarse for the shortest waves",
            allowed=f"at least {needed} heights",
        )


def _largest_waves(spectrum: Spectrum, lengths: tuple[float, float]) -> tuple[int, int]:
    """Return the largest |kx| and |ky| that the band can hold."""
    if spectrum.waves is not None:
        hi = spectrum.waves[1] * _ROUNDING
        return _whole(hi), _whole(hi * lengths[1] / lengths[0])
    assert spectrum.waves_x is not None and spectrum.waves_y is not None
    return _whole(spectrum.waves_x[1]), _whole(spectrum.waves_y[1])


def _whole(waves: float) -> int:
    """Return a number of waves rounded down; infinite products count as more than any grid has."""
    return int(min(waves, 1e18))


def _half_plane(largest: tuple[int, int]) -> tuple[Counts, Counts]:
    """Return one wave of each pair ±k ≠ 0 of a disc around the box ``largest``, in order."""
    radius = math.isqrt(largest[0] ** 2 + largest[1] ** 2) + 1
    kx, ky = (k.ravel() for k in np.mgrid[0 : radius + 1, -radius : radius + 1])
    squared = kx**2 + ky**2
    kept = ((kx > 0) | (ky > 0)) & (squared <= radius**2)
    order = np.argsort(squared[kept], kind="stable")
    return kx[kept][order], ky[kept][order]


def _amplitudes(spectrum: Spectrum, lengths: tuple[float, float], kx: Counts, ky: Counts) -> Array:
    squared = _squared_waves(lengths, kx, ky)
    shape = squared ** (-0.5 * (spectrum.hurst + 1.0))
    if spectrum.s0 is not None:
        return 2.0 * np.pi * math.sqrt(spectrum.s0 / (lengths[0] * lengths[1])) * shape
    if spectrum.rms_height is not None:
        return spectrum.rms_height / math.sqrt(2.0 * np.sum(shape**2)) * shape
    assert spectrum.rms_slope is not None
    slope = 2.0 * np.pi / lengths[0] * math.sqrt(2.0 * np.sum(shape**2 * squared))
    return spectrum.rms_slope / slope * shape


def _squared_waves(lengths: tuple[float, float], kx: Counts, ky: Counts) -> Array:
    """Return |k|² = (Lx |q| / 2π)² in waves per Lx."""
    return kx**2 + (ky * (lengths[0] / lengths[1])) ** 2


def _in_band(spectrum: Spectrum, lengths: tuple[float, float], kx: Counts, ky: Counts) -> Flags:
    if spectrum.waves is not None:
        lo, hi = spectrum.waves
        squared = _squared_waves(lengths, kx, ky)
        return (squared * _ROUNDING >= lo**2) & (squared <= hi**2 * _ROUNDING)
    assert spectrum.waves_x is not None and spectrum.waves_y is not None
    inner = np.zeros(kx.shape)
    for k, (lo, _) in ((kx, spectrum.waves_x), (ky, spectrum.waves_y)):
        inner += (k / lo) ** 2 if lo > 0.0 else np.where(k == 0, 0.0, np.inf)
    within = (np.abs(kx) <= spectrum.waves_x[1]) & (np.abs(ky) <= spectrum.waves_y[1])
    return within & (inner * _ROUNDING >= 1.0)
