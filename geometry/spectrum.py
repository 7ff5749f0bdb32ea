"""The self-affine, band-limited spectrum of random surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Annotated, Any

from support.checks import finite_pair
from support.errors import InputError
from support.fields import Limits, Positive, PositiveLength, Slope, Unit, check_limits

LARGEST_SEED = 2**128 - 1
"""Seeds have at most 128 bits, as many as numpy draws from the system for a seed."""

Band = tuple[float, float]

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
        check_limits(self)
        if not isinstance(self.seed, Integral):
            raise InputError("must be a whole number", key="seed", value=self.seed)
        bands = self._given(_BANDS)
        if bands not in (["waves"], ["waves_x", "waves_y"]):
            raise InputError(
                f"a spectrum needs exactly one band, not {' and '.join(bands) or 'none'}",
                allowed="waves, or waves_x and waves_y together",
            )
        for name in bands:
            object.__setattr__(self, name, _checked_band(getattr(self, name), name))
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


def _checked_band(band: Band, name: str) -> Band:
    problem, allowed = "is not a band", "0 ≤ lo ≤ hi, waves per side"
    try:
        lo, hi = finite_pair(band, problem, allowed=allowed)
    except InputError as error:
        raise error.located(key=name) from None
    if not 0.0 <= lo <= hi:
        raise InputError(problem, key=name, value=band, allowed=allowed)
    return lo, hi
