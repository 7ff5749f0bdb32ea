"""Extrapolates results of several meshes to mesh size zero, with an error bar.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from support.errors import InputError

Array = NDArray[np.float64]

RATE_MARGIN = 1.25
"""The error bar allows a rate this much below the known order.

The margin is at most half the order. From first order on, c + a hᵖ (1 + b h) with b h > −0.4 and
sizes that differ by a factor of two or more is not 0.75 below its order. The rest is for nodes that
happen to lie well or badly: of seven rough blocks of order 3, whose finer edges were a third of a
contact's radius, the slowest showed 2.0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """Values at mesh size zero; arrays over load steps.

    Attributes:
        value: The values, shape (steps,).
        error: Half widths of their error bars, shape (steps,); NaN where nothing is known.
        rate: The known order that was used; NaN where none was, as before the first touch. Shape
            (steps,).
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


def extrapolated(
    values: ArrayLike,
    sizes: ArrayLike,
    order: float | None = None,
    scatter: ArrayLike = 0.0,
) -> Estimate:
    """Extrapolate results of meshes of falling size with a known order (Richardson).

    With f = c + a hᵖ on meshes h₁ < h₂ the finest mesh is wrong by
    a h₁ᵖ = (f₂ − f₁) / (rᵖ − 1), r = h₂ / h₁, where h₂ is the coarsest mesh. The error bar is the
    difference between this correction and the one that a rate lower by `RATE_MARGIN` would give.
    Meshes between the two check the order: what lies between their results and those of the
    formula is added to the bar. A rate is not observed: it would have to be that of three
    results, whose scatter by where nodes happen to lie is as large as their differences.

    Meshes may also agree by accident. Therefore the scatter of single meshes, where it is known,
    is added, and no relative error bar is less than half the median over all load steps.

    Args:
        values: Results of every mesh, the finest last, shape (meshes, steps).
        sizes: Mesh sizes, falling, shape (meshes,).
        order: Known rate of convergence; required for several meshes.
        scatter: Relative scatter of the results, shape (steps,) or one for all.

    Raises:
        InputError: When shapes or sizes do not fit, or several meshes come without an order.

    Source:
        Roache 1994, doi 10.1115/1.2910291, on why an error bar is more than the correction.
    """
    results, h = _checked(values, sizes, order)
    if len(h) == 1:
        nothing = np.full(results.shape[1], np.nan)
        return Estimate(value=results[0], error=nothing, rate=nothing.copy())
    assert order is not None
    difference, ratio = results[0] - results[-1], h[0] / h[-1]
    correction = difference / (ratio**order - 1.0)
    slower = max(order - RATE_MARGIN, 0.5 * order)
    error = np.abs(difference / (ratio**slower - 1.0) - correction)
    expected = results[-1] + correction * ((h[:, None] / h[-1]) ** order - 1.0)
    size = np.abs(results[-1])
    error += np.abs(results - expected).max(axis=0) + np.asarray(scatter) * size
    usual = np.median(error[size > 0.0] / size[size > 0.0]) if size.any() else 0.0
    return Estimate(
        value=results[-1] - correction,
        error=np.maximum(error, 0.5 * usual * size),
        rate=np.where(np.ptp(results, axis=0) == 0.0, np.nan, order),
    )


def _checked(values: ArrayLike, sizes: ArrayLike, order: float | None) -> tuple[Array, Array]:
    results, h = np.asarray(values, float), np.asarray(sizes, float)
    if results.ndim != 2 or h.shape != results.shape[:1] or not len(h):
        raise InputError(
            "results and mesh sizes do not fit together",
            value=(np.shape(values), np.shape(sizes)),
            allowed="(meshes, steps) and (meshes,)",
        )
    if not (np.all(h > 0.0) and np.all(np.diff(h) < 0.0)):
        raise InputError("mesh sizes must fall", value=h.tolist(), allowed="the finest last")
    if len(h) > 1 and order is None:
        raise InputError("meshes alone show no rate", value=order, allowed="a known order > 0")
    if order is not None and not order > 0.0:
        raise InputError("the order must be positive", value=order, allowed="> 0")
    return results, h
