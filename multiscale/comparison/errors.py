"""How far two runs with the same load history lie apart, and why.

With R the run that is compared against and k the load steps that both have, errors are

* of force, approach and contact area, relative to their largest in R over these steps,

      max_k |X_k − R_k| / max_k |R_k|,    and signed at R's last step,    (X − R) / R;

* of the mean separation likewise, but relative to R's at the same step, as it falls under load;
* of the patch pressures at R's last step, on the patches of a common grid, the L1 distance

      Σ_i |p_i − r_i| / Σ_i r_i;

* of their distribution there, the Wasserstein distance of p / <p> and r / <r>, which is the area
  between the two distribution functions: blind to where pressures are and to the force.

Errors at R's last step are unknown (NaN) for a run that stopped before it. The uncertainty of R
itself is defined by the same formulas.

The error at R's last step is split by causes as far as the other results allow: of the force, or of
the approach where the force is prescribed. All configurations have the same heights. Between a
configuration X and R lie at most three models that are the best of their kind: the finest
half-space, the finest concurrent coupling, which is the same on the block, and the best explicit
reference. Differences between them add up, so that

    X − R  =  (X − best of X's kind)  +  steps from one best model to the next, up to R.

The first term is by neglected slopes, by the micro model, by the laws and by the discretisation.
The step from half-space to concurrent coupling is by the finite block. The step from there to the
explicit reference is by finite slopes that are accounted for in the first order only, and by the
discretisation of both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from geometry.patches import PatchGrid, interval_overlaps
from multiscale.comparison.configuration import Array, Curves, RunResult
from multiscale.comparison.scene_content import LOW_HEIGHTS, SMALL_SLOPES

ZERO = 1e-9
"""A force or an area below this share of the largest counts as zero: nothing is relative to it."""

_UNKNOWN = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMeasures:
    """Errors of a run against another; relative, NaN where unknown.

    Attributes:
        force_max: Of the force, the largest over the curve.
        force_last: Of the force at the last step, signed.
        approach_max: Of the approach, the largest over the curve.
        approach_last: Of the approach at the last step, signed.
        area_max: Of the contact area, the largest over the curve.
        area_last: Of the contact area at the last step, signed.
        separation_max: Of the mean separation, the largest over the curve.
        separation_last: Of the mean separation at the last step, signed.
        pressure_l1: L1 distance of the patch pressures at the last step.
        distribution: Wasserstein distance of the distributions of patch pressures there, in units
            of the mean pressure.
    """

    force_max: float = _UNKNOWN
    force_last: float = _UNKNOWN
    approach_max: float = _UNKNOWN
    approach_last: float = _UNKNOWN
    area_max: float = _UNKNOWN
    area_last: float = _UNKNOWN
    separation_max: float = _UNKNOWN
    separation_last: float = _UNKNOWN
    pressure_l1: float = _UNKNOWN
    distribution: float = _UNKNOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorBreakdown:
    """Signed shares of an error; those that are known add up to it. NaN where unknown.

    Attributes:
        micro: By the micro model, as on the half-space.
        coupling: By what the coupling neglects; on a mesh, by its elements too.
        block: By the half-space in place of the finite block.
        slopes: By neglected slopes, from the same configuration with and without them. Where a
            reference with low heights was reached, also by slopes in the first order only.
        discretisation: By grids and meshes, and everything that could not be separated.
    """

    micro: float = _UNKNOWN
    coupling: float = _UNKNOWN
    block: float = _UNKNOWN
    slopes: float = _UNKNOWN
    discretisation: float = _UNKNOWN


def error_measures(run: Curves, against: Curves, grid: PatchGrid) -> ErrorMeasures:
    """Measure how far a run lies from another.

    Args:
        run: The run.
        against: The run that it is compared against.
        grid: Patches on which pressures are compared.
    """
    common = min(run.force.size, against.force.size)
    if not common:
        return ErrorMeasures()
    whole, last = common == against.force.size, common - 1
    errors: dict[str, float] = {}
    for name in ("force", "approach", "area", "separation"):
        mine, right = getattr(run, name), getattr(against, name)
        scale = np.abs(right[:common])
        if name != "separation":
            scale[:] = scale.max()
        errors[f"{name}_max"] = _largest(mine[:common] - right[:common], scale)
        if whole:
            floor = ZERO * float(np.abs(right).max())
            errors[f"{name}_last"] = _ratio(mine[last] - right[last], right[last], floor)
    if whole:
        p = on_grid(run.patch_pressure[last], run.patches, grid)
        r = on_grid(against.patch_pressure[last], against.patches, grid)
        errors["pressure_l1"] = _ratio(float(np.abs(p - r).sum()), float(r.sum()))
        errors["distribution"] = _distribution_distance(p, r)
    return ErrorMeasures(**errors)


def uncertainty(
    against: Curves, pairs: Sequence[tuple[Curves, Curves]], grid: PatchGrid
) -> ErrorMeasures:
    """Measure the uncertainty of the run that others are compared against; no value is negative.

    Force, approach and area take the run's own error bars where it has them. All else is the sum of
    the distances between runs that differ by one refinement each. If a refinement at least halves
    the error, the error of the finer run is no larger than this distance.

    Args:
        against: The run.
        pairs: A coarser and a finer run for each refinement; without any, nothing is known.
        grid: Patches on which pressures are compared.
    """
    distances = [error_measures(*pair, grid) for pair in pairs] or [ErrorMeasures()]
    found = {
        field.name: float(sum(abs(getattr(one, field.name)) for one in distances))
        for field in fields(ErrorMeasures)
    }
    for name in ("force", "approach", "area"):
        value, error = getattr(against, name), getattr(against, f"{name}_error")
        known = np.isfinite(error)  # An error bar is unknown before meshes find the first contact.
        if known[-1]:
            top = float(np.abs(value).max())
            found[f"{name}_max"] = _largest(error[known], np.full(np.count_nonzero(known), top))
            found[f"{name}_last"] = _ratio(error[-1], value[-1], ZERO * top)
    return ErrorMeasures(**found)


def on_grid(pressure: Array, patches: PatchGrid, grid: PatchGrid) -> Array:
    """Return patch pressures on other patches; the force is conserved.

    Pressures are uniform on the patches they are given on, and averaged over the new ones.

    Args:
        pressure: Mean pressures, shape (N,) [MPa].
        patches: Their patches.
        grid: The new patches, of the same rectangle.

    Returns:
        Mean pressures, shape (grid.count,) [MPa].
    """
    x = interval_overlaps(grid.borders_x, patches.borders_x) / grid.size[0]
    y = interval_overlaps(grid.borders_y, patches.borders_y) / grid.size[1]
    return np.asarray((x @ pressure.reshape(patches.grid) @ y.T).ravel())


def _distribution_distance(pressure: Array, right: Array) -> float:
    """Return the Wasserstein distance of p / <p> and r / <r> over equal numbers of patches.

    Of two samples of the same size it is the mean distance of their sorted values (Villani 2009,
    doi 10.1007/978-3-540-71050-9, remark 2.19). NaN when either carries no load.
    """
    means = float(pressure.mean()), float(right.mean())
    if min(means) <= 0.0:
        return _UNKNOWN
    return float(np.abs(np.sort(pressure) / means[0] - np.sort(right) / means[1]).mean())


def _largest(error: Array, scale: Array) -> float:
    """Return the largest |error| / scale; NaN where every scale is zero."""
    usable = scale > 0.0
    return float(np.max(np.abs(error[usable]) / scale[usable])) if usable.any() else _UNKNOWN


def _ratio(error: float, right: float, floor: float = 0.0) -> float:
    """Return error / right; NaN when |right| is not above a floor."""
    return float(error / right) if abs(right) > floor else _UNKNOWN


class ErrorCauses:
    """Splits errors by causes.

    Args:
        results: All results.
        best: The best result of ``analytic``, ``concurrent`` and ``reference``, where reached.
        measure: The one of them that the others are compared against.
        quantity: Name of the curve that is compared, ``force`` or ``approach``.
    """

    def __init__(
        self,
        results: Sequence[RunResult],
        best: Mapping[str, RunResult],
        measure: RunResult,
        quantity: str,
    ) -> None:
        self._best, self._measure, self._quantity = best, measure, quantity
        self._models = {_micro_key(one): one for one in results if one.kind == "analytic"}
        first_order = self._pairwise_effect(results, SMALL_SLOPES)
        complete = self._pairwise_effect(results, LOW_HEIGHTS)
        # An effect that is unknown is taken from the other.
        self._first_order = complete if math.isnan(first_order) else first_order
        self._complete = first_order if math.isnan(complete) else complete

    def breakdown(self, result: RunResult) -> ErrorBreakdown:
        """Return the shares of a result's error; unknown where it has none that is comparable.

        Args:
            result: One of the results.
        """
        measure, value, right = self._measure, self._value(result), self._value(self._measure)
        if math.isnan(value) or result.configuration.scale != 1.0 or not right:
            return ErrorBreakdown()
        best, alone = self._best, self._models.get(_micro_key(result))
        # Differences are taken between responses with the same effect of slopes.
        mine, model, half_space, concurrent = (
            self._with_slopes(one, float(np.nan_to_num(self._first_order)))
            for one in (result, alone, best.get("analytic"), best.get("concurrent"))
        )
        shares = dict.fromkeys(("micro", "coupling", "block"), 0.0)
        if result.model not in ("", "half-space"):
            shares["micro"] = model - half_space
        if result.kind in ("isolated", "consistent"):
            shares["coupling"] = mine - concurrent - (model - half_space)
        if (result.kind == "analytic") != (measure.kind == "analytic"):
            step = half_space - concurrent
            shares["block"] = step if result.kind == "analytic" else -step
        if not math.isnan(self._first_order):
            shares["slopes"] = value - self._with_slopes(result, self._slope_effect(measure))
        shares["discretisation"] = value - right - float(np.nansum(list(shares.values())))
        return ErrorBreakdown(**{name: share / right for name, share in shares.items()})

    def _value(self, result: RunResult | None) -> float:
        """Return the response at the measure's last load step; NaN where it was not reached."""
        steps = self._measure.steps
        if result is None or result.steps < steps:
            return _UNKNOWN
        return float(getattr(result.curves, self._quantity)[steps - 1])

    def _slope_effect(self, result: RunResult) -> float:
        """Return the relative change by slopes as a configuration accounts for them."""
        if result.kind == "reference":
            return float(np.nan_to_num(self._complete))
        return float(np.nan_to_num(self._first_order)) if result.finite_slopes else 0.0

    def _with_slopes(self, result: RunResult | None, effect: float) -> float:
        """Return the response that a result would have with another effect of slopes."""
        own = 0.0 if result is None else self._slope_effect(result)
        # A value that slopes reduce to nothing stays: the value without them is unknown.
        return self._value(result) * ((1.0 + effect) / (1.0 + own) if own > -1.0 else 1.0)

    def _pairwise_effect(self, results: Sequence[RunResult], ending: str) -> float:
        """Return the effect of slopes by a pair of results, of the concurrent coupling if any."""
        named, found = {one.name: one for one in results}, dict[str, float]()
        for name, small in named.items():
            steep = named.get(name.removesuffix(ending))
            values = self._value(steep), self._value(small)
            if name.endswith(ending) and steep and abs(values[0] * values[1]) > 0.0:
                found.setdefault(steep.kind, values[0] / values[1] - 1.0)
        return found.get("concurrent", next(iter(found.values()), _UNKNOWN))


def _micro_key(result: RunResult) -> tuple[Any, ...]:
    """Return what distinguishes a micro model and its surface from others."""
    one = result.configuration
    return one.heights, *sorted(one.content["micro"].items())
