"""The self-affine, band-limited spectrum of random surfaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from support.checks import finite_pair
from support.errors import InputError

LARGEST_SEED = 2**128 - 1
"""Seeds have at most 128 bits, as many as numpy draws from the system for a seed."""

_BANDS = ("waves", "waves_x", "waves_y")
_AMPLITUDES = ("rms_slope", "rms_height", "s0")
_UNITS = {"rms_height": " mm", "s0": " mm^4"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spectrum:
    """Power spectral density S = S0 |k|^(−2 (H + 1)) in a band of waves, 0 outside.

    k = (kx, ky) counts waves per side. On a rectangle its length is measured along x,
    |k| = Lx |q| / 2π with the angular wavenumber q, so that the surface stays isotropic. The
    band is either the ring lo ≤ |k| ≤ hi, or the box |kx| ≤ hi_x, |ky| ≤ hi_y without the inner
    ellipse (kx/lo_x)² + (ky/lo_y)² < 1.

    Args:
        hurst: Hurst exponent H, 0 … 1.
        waves: Ring (lo, hi) [waves per Lx].
        waves_x: Limits (lo_x, hi_x) of the box along x [waves per Lx].
        waves_y: Limits (lo_y, hi_y) of the box along y [waves per Ly].
        rms_slope: Amplitude by sqrt<|∇h|²>, met exactly by every surface [-].
        rms_height: Amplitude by sqrt<h²>, met exactly by every surface [mm].
        s0: Amplitude S0 itself [mm⁴]; <h²> is the integral of S over the angular wavenumbers.
        seed: Seed of the phases.

    Raises:
        InputError: When a value is out of range, or not exactly one kind of band and one
            amplitude is given.

    Source: Waddad et al. 2016, section 1.1, doi 10.1016/j.triboint.2015.12.023.
    """

    hurst: float
    waves: tuple[float, float] | None = None
    waves_x: tuple[float, float] | None = None
    waves_y: tuple[float, float] | None = None
    rms_slope: float | None = None
    rms_height: float | None = None
    s0: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.hurst <= 1.0:
            raise InputError(
                "the Hurst exponent is out of range", value=self.hurst, allowed="0 … 1"
            )
        if not isinstance(self.seed, int | np.integer) or not 0 <= self.seed <= LARGEST_SEED:
            raise InputError(
                "the seed does not fit", value=self.seed, allowed="a whole number, 0 … 2^128 − 1"
            )
        bands = self._given(_BANDS)
        if bands not in (["waves"], ["waves_x", "waves_y"]):
            raise InputError(
                "a spectrum needs exactly one band",
                value=bands,
                allowed="waves, or waves_x and waves_y together",
            )
        for name in bands:
            object.__setattr__(self, name, _checked_band(getattr(self, name), name))
        amplitudes = self._given(_AMPLITUDES)
        if len(amplitudes) != 1:
            raise InputError(
                "a spectrum needs exactly one amplitude",
                value=amplitudes,
                allowed="one of " + ", ".join(_AMPLITUDES),
            )
        size = getattr(self, amplitudes[0])
        if not (math.isfinite(size) and size > 0.0):
            raise InputError(f"{amplitudes[0]} must be positive", value=size, allowed="> 0")

    def __str__(self) -> str:
        given = self._given(("hurst", *_BANDS, *_AMPLITUDES, "seed"))
        return "spectrum with " + ", ".join(
            f"{name} {_written(getattr(self, name))}{_UNITS.get(name, '')}" for name in given
        )

    def _given(self, names: Sequence[str]) -> list[str]:
        return [name for name in names if getattr(self, name) is not None]


def _written(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)  # without rounding noise


def _checked_band(band: tuple[float, float], name: str) -> tuple[float, float]:
    problem, allowed = f"{name} is not a band", "0 ≤ lo ≤ hi, waves per side"
    lo, hi = finite_pair(band, problem, allowed=allowed)
    if not 0.0 <= lo <= hi:
        raise InputError(problem, value=band, allowed=allowed)
    return lo, hi
