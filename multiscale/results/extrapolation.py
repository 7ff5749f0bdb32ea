"""Extrapolates results of two or three meshes to mesh size zero, with an error bar.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from support.errors import InputError

Array = NDArray[np.float64]

LEAST_RATE, MOST_RATE = 0.5, 8.0
"""Observed rates outside are not trusted: the meshes are not in the asymptotic range."""

RATE_MARGIN = 1.25
"""The error bar of two meshes allows a rate this much below the known order.

The margin is at most half the order. From first order on, c + a hᵖ (1 + b h) with b h > −0.4 and
sizes that differ by a factor of two or more is not 0.75 below its order. The rest is for nodes that
happen to lie well or badly: of seven rough blocks of order 3, whose finer edges were a third of a
contact's radius, the slowest showed 2.0."""

OBSERVED_RATE_MARGIN = 0.5
"""The same for a rate that three meshes show, which contains most of the effect of b h."""

SLOWEST_RATE = 0.25
"""The rate that the error bar assumes where nothing better is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Values at mesh size zero; arrays over load steps.

    Attributes:
        value: The values, shape (steps,).
        error: Half widths of their error bars, shape (steps,); NaN where nothing is known.
        rate: Rates that were used: the known order with two meshes, the observed rate with three;
            NaN where no rate was used. Shape (steps,).
    """

    value: Array
    error: Array
    rate: Array

    def at(self, steps: slice) -> Estimate:
        """Return the values at some load steps alone.

        Args:
            steps: Their places.
        """
        return Estimate(value=self.value[steps], error=self.error[steps], rate=self.rate[steps])


def extrapolated(values: ArrayLike, sizes: ArrayLike, order: float | None = None) -> Estimate:
    """Extrapolate results of meshes of falling size (Richardson).

    With f = c + a hᵖ on meshes h₁ < h₂ the finest mesh is wrong by
    a h₁ᵖ = (f₂ − f₁) / (rᵖ − 1), r = h₂ / h₁. The error bar is the difference between this
    correction and the one that a slower rate would give: `RATE_MARGIN` below the known order with
    two meshes, `OBSERVED_RATE_MARGIN` below the observed rate, or below the order if that is less,
    with three.

    Three meshes may show no rate between `LEAST_RATE` and `MOST_RATE`. Then the value of the finest
    mesh is returned, and its error bar is the correction that a third of the known order would
    give between the first and the last mesh (`SLOWEST_RATE` without an order), or the range of the
    results if that is more.

    Meshes may also agree by accident. Therefore no relative error bar is less than half the median
    over all load steps.

    Args:
        values: Results of every mesh, the finest last, shape (meshes, steps).
        sizes: Mesh sizes, falling, shape (meshes,). Of more than three meshes the finest three
            are used.
        order: Known rate of convergence; required for two meshes.

    Raises:
        InputError: When shapes or sizes do not fit, or two meshes come without an order.

    Source:
        Roache 1994, doi 10.1115/1.2910291, on why an error bar is more than the correction.
    """
    results, h = _checked(values, sizes, order)
    if len(h) == 1:
        nothing = np.full(results.shape[1], np.nan)
        return Estimate(value=results[0], error=nothing, rate=nothing.copy())
    difference, ratio = results[-2] - results[-1], h[-2] / h[-1]
    if len(h) == 2:
        assert order is not None
        rate: Array = np.full(len(difference), order)
        slower = np.maximum(rate - RATE_MARGIN, 0.5 * order)
    else:
        rate = _observed_rates(results, h)
        slower = np.fmin(rate, np.inf if order is None else order) - OBSERVED_RATE_MARGIN
        slower = np.maximum(slower, SLOWEST_RATE)
    correction = difference / (ratio**rate - 1.0)
    bar = np.abs(difference / (ratio**slower - 1.0) - correction)
    unknown, spread = np.isnan(rate), np.ptp(results, axis=0)
    error = np.where(unknown, np.maximum(_bar_without_rate(results, h, order), spread), bar)
    size = np.abs(results[-1])
    usual = np.median(error[size > 0.0] / size[size > 0.0]) if size.any() else 0.0
    return Estimate(
        value=results[-1] - np.where(unknown, 0.0, correction),
        error=np.maximum(error, 0.5 * usual * size),
        rate=np.where(spread == 0.0, np.nan, rate),  # such as before the first touch
    )


def _checked(values: ArrayLike, sizes: ArrayLike, order: float | None) -> tuple[Array, Array]:
    results, h = np.asarray(values, float)[-3:], np.asarray(sizes, float)[-3:]
    if results.ndim != 2 or h.shape != results.shape[:1] or not len(h):
        raise InputError(
            "results and mesh sizes do not fit together",
            value=(np.shape(values), np.shape(sizes)),
            allowed="(meshes, steps) and (meshes,)",
        )
    if not (np.all(h > 0.0) and np.all(np.diff(h) < 0.0)):
        raise InputError("mesh sizes must fall", value=h.tolist(), allowed="the finest last")
    if len(h) == 2 and order is None:
        raise InputError("two meshes show no rate", value=order, allowed="a known order > 0")
    if order is not None and not order > 0.0:
        raise InputError("the order must be positive", value=order, allowed="> 0")
    return results, h


def _bar_without_rate(results: Array, h: Array, order: float | None) -> Array:
    """Return error bars for meshes that show no rate.

    With a known order the first and the last mesh are compared: noise matters least for them.
    """
    first, rate = (-2, SLOWEST_RATE) if order is None else (0, order / 3.0)
    return np.asarray(np.abs((results[first] - results[-1]) / ((h[first] / h[-1]) ** rate - 1.0)))


def _observed_rates(results: Array, h: Array) -> Array:
    """Return the rates p that three meshes show, NaN where they show none.

    They solve (h₃ᵖ − h₂ᵖ) / (h₂ᵖ − h₁ᵖ) = (f₃ − f₂) / (f₂ − f₁), whose left side rises with p.
    """

    def quotient(rate: float) -> float:
        return float(((h[-3] / h[-2]) ** rate - 1.0) / (1.0 - (h[-1] / h[-2]) ** rate))

    with np.errstate(divide="ignore", invalid="ignore"):
        observed = (results[-3] - results[-2]) / (results[-2] - results[-1])
    trusted = (observed >= quotient(LEAST_RATE)) & (observed <= quotient(MOST_RATE))
    rates = np.full(len(observed), np.nan)
    for i in np.flatnonzero(trusted):
        rates[i] = brentq(
            lambda rate, i=i: quotient(rate) - observed[i], LEAST_RATE, MOST_RATE, xtol=1e-14
        )
    return rates
