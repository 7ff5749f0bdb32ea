"""Closed forms and published fits of the flow through thin gaps."""

import numpy as np

_EXPONENTIAL = {1.0: (0.90, 0.56), 1.0 / 3.0: (1.18, 0.42), 1.0 / 6.0: (1.38, 0.42)}
_POWER = {3.0: (0.225, 1.5), 6.0: (0.520, 1.5), 9.0: (0.870, 1.5)}
"""Constants C and r of Patir & Cheng's fits by Peklenik number γ."""


def patir_cheng(ratio, peklenik=1.0):
    """Return Patir and Cheng's fit of the pressure flow factor of Gaussian roughness.

    φ = 1 − C e^(−r h/σ) up to γ = 1, and 1 + C (h/σ)^(−r) beyond. It belongs to h/σ > ½, for
    γ ≤ 1/3 to h/σ > 1, and to gaps g = max(h + z, 0) with heights z whose autocorrelation falls
    linearly.

    Args:
        ratio: Distance h of the mean planes over the rms height σ.
        peklenik: Peklenik number γ, length of correlation along the flow over that across.

    Source:
        Patir & Cheng 1978, table 1, doi 10.1115/1.3453103.
    """
    if peklenik in _EXPONENTIAL:
        factor, rate = _EXPONENTIAL[peklenik]
        return float(1.0 - factor * np.exp(-rate * ratio))
    factor, power = _POWER[peklenik]
    return float(1.0 + factor * ratio**-power)


def slight_roughness(ratio, peklenik=1.0):
    """Return the pressure flow factor of shallow roughness, to second order in its heights.

    φ = 1 + 3 (σ/h)² (1 − 3/(1 + γ)), with the spectrum of an isotropic surface that is stretched.

    Args:
        ratio: Distance h of the mean planes over the rms height σ.
        peklenik: Factor γ by which the surface is stretched along the flow.

    Source:
        Tripp 1983, Journal of Lubrication Technology 105, 458-463.
    """
    return 1.0 + 3.0 / ratio**2 * (1.0 - 3.0 / (1.0 + peklenik))


def slit_resistance(opening):
    """Return what a thin wall with a slit adds to the resistance of a strip, over that of a square.

    It follows from the conformal map w = sin(π z/W) of the half strip to the half plane.

    Args:
        opening: Width of the slit over that of the strip, in whose middle it is.
    """
    return float(-2.0 / np.pi * np.log(np.sin(0.5 * np.pi * opening)))
