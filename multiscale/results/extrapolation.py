"""Extrapolates results of two or three meshes to mesh size zero, with an error bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]

LEAST_RATE, MOST_RATE = 0.5, 8.0
"""Rates outside are not believed: the meshes are not yet, or no more, in the asymptotic range."""

_LESS = 1.25
"""How far two meshes may be below the known order, or half of it if that is less. From first order
on, c + a hᵖ (1 + b h) with b h > −0.4 is not 0.75 below, with sizes that differ by a half or more.
The rest is for nodes that happen to lie well or badly: of seven rough blocks of order 3 whose
finer edges are a third of a contact's radius, the least showed 2.0."""

_LESS_OBSERVED = 0.5
"""The same of a rate that three meshes show, which knows most of b h."""

_SLOWEST = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Values at mesh size zero; arrays over load steps.

    Attributes:
        value: The values, shape (steps,).
        error: Half widths of their error bars, shape (steps,); NaN where nothing is known.
        rate: Rates that were used: the known order with two meshes, observed with three; NaN
            where there was none to use. Shape (steps,).
    """

    value: Array
    error: Array
    rate: Array


def extrapolated(values: ArrayLike, sizes: ArrayLike, order: float | None = None) -> Estimate:
    """Extrapolate results of meshes of falling size, by Richardson.

    With f = c + a hᵖ on meshes h₁ < h₂ the finest is wrong by a h₁ᵖ = (f₂ − f₁) / (rᵖ − 1),
    r = h₂ / h₁. The error bar reaches from there to what a slower rate would give: the order less
    one and a quarter, but at least half the order, with two meshes, where the order is taken on
    trust; with three, half less than the rate they show, or than the order if they seem to
    converge faster. Where three meshes do not converge monotonically at a rate between 0.5 and 8,
    the finest value stands, with what a third of the known order leaves open between the first and
    the last, a rate of 0.25 without one, or their spread if that is more. Meshes may also agree by
    accident: no relative bar is less than half the median of all load steps.

    Args:
        values: Results of every mesh, the finest last, shape (meshes, steps).
        sizes: Mesh sizes, falling, shape (meshes,). More than three meshes: the finest three count.
        order: Known rate of convergence; needed by two meshes.

    Raises:
        InputError: When shapes or sizes do not fit, or two meshes come without an order.

    Source:
        Roache 1994, doi 10.1115/1.2910291, on why an error bar is more than the correction.
    """
    results, h = _checked(values, sizes, order)
    if len(h) == 1:
        nothing = np.full(results.shape[1], np.nan)
        return Estimate(value=results[0], error=nothing, rate=nothing.copy())
    difference = results[-2] - results[-1]
    ratio = h[-2] / h[-1]
    if len(h) == 2:
        assert order is not None
        rate: Array = np.full(len(difference), order)
        slower = np.maximum(rate - _LESS, 0.5 * order)
    else:
        rate = _observed(results, h)
        slower = np.fmin(rate, np.inf if order is None else order) - _LESS_OBSERVED
        slower = np.maximum(slower, _SLOWEST)
    correction = _correction(difference, ratio, rate)
    bar = np.abs(_correction(difference, ratio, slower) - correction)
    lost = np.isnan(rate)
    cautious = np.maximum(_unsettled(results, h, order), np.ptp(results, axis=0))
    still = np.ptp(results, axis=0) == 0.0  # such as before first touch: nothing to be wrong
    error = np.where(lost, cautious, bar)
    size = np.abs(results[-1])
    usual = np.median(error[size > 0.0] / size[size > 0.0]) if size.any() else 0.0
    return Estimate(
        value=results[-1] - np.where(lost, 0.0, correction),
        error=np.maximum(error, 0.5 * usual * size),
        rate=np.where(still, np.nan, rate),
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


def _unsettled(results: Array, h: Array, order: float | None) -> Array:
    """Return what meshes that show no rate leave open.

    With a known order that is what a third of it leaves between the first and the last, whose
    difference noise matters least for; without, what almost no convergence leaves.
    """
    if order is None or len(h) == 2:
        step, ratio, rate = results[-2] - results[-1], h[-2] / h[-1], _SLOWEST
    else:
        step, ratio, rate = results[0] - results[-1], h[0] / h[-1], order / 3.0
    return np.abs(_correction(step, ratio, np.full(len(step), rate)))


def _correction(difference: Array, ratio: float, rate: Array) -> Array:
    """Return the error of the finest mesh, from its difference to the next."""
    return np.asarray(difference / (ratio**rate - 1.0))


def _observed(results: Array, h: Array) -> Array:
    """Return the rates that three meshes show, NaN where they show none, by bisection."""
    coarse, fine = results[-3] - results[-2], results[-2] - results[-1]
    # (h₃ᵖ − h₂ᵖ) / (h₂ᵖ − h₁ᵖ) rises with p
    with np.errstate(divide="ignore", invalid="ignore"):
        found = coarse / fine
    low: Array = np.full(len(found), LEAST_RATE)
    high: Array = np.full(len(found), MOST_RATE)
    shown = (found >= _quotient(h, low)) & (found <= _quotient(h, high))
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = _quotient(h, middle) < found
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.where(shown, 0.5 * (low + high), np.nan)


def _quotient(h: Array, rate: Array) -> Array:
    return np.asarray(((h[-3] / h[-2]) ** rate - 1.0) / (1.0 - (h[-1] / h[-2]) ** rate))
