"""How far two runs with the same load history lie apart, and why; the rows that hold this.

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
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

import numpy as np

from patchlaw.geometry.patches import interval_overlaps
from patchlaw.multiscale.readable import times
from patchlaw.multiscale.scene.parts import block_section
from patchlaw.multiscale.studies.configurations import SMALL_SLOPES, Configuration, Grid
from patchlaw.multiscale.studies.running import CaseResult
from patchlaw.support.arrays import Array

Curves: TypeAlias = Mapping[str, Array]
"""The load steps of a run, see `multiscale.studies.comparison`; empty of one without any."""

RESPONSES = ("force", "approach", "area", "separation")
ERRORS = (
    *(f"{name}_{where}" for name in RESPONSES for where in ("max", "last")),
    "pressure_l1",
    "distribution",
)
"""Errors of a run against another: of force, approach, contact area and mean separation the largest
over the curve, and the signed one at the last step; the two of the patch pressures there."""

CAUSES = ("micro", "coupling", "block", "slopes", "discretisation")
"""Causes of errors: the micro model, as on the half-space; what the coupling neglects, on a mesh by
its elements too; the half-space in place of the finite block; neglected slopes; grids, meshes, and
everything that cannot be separated."""

ZERO = 1e-9
"""A force or an area below this share of the largest counts as zero: nothing is relative to it."""

_UNKNOWN = float("nan")
NO_ERRORS: Mapping[str, float] = dict.fromkeys(ERRORS, _UNKNOWN)
NO_SHARES: Mapping[str, float] = dict.fromkeys(CAUSES, _UNKNOWN)


@dataclass(frozen=True, kw_only=True)
class Row(Configuration):
    """A configuration with its result and errors: a row of ``compare.csv``.

    Attributes:
        result: What it came to.
        is_measure: Whether the others are compared against it.
        errors: `ERRORS` against the measure, NaN where unknown; of the measure its uncertainty.
        shares: Signed shares of the error at the last load step, by `CAUSES`; NaN where unknown.
    """

    result: CaseResult
    is_measure: bool = False
    errors: Mapping[str, float] = field(default_factory=lambda: NO_ERRORS)
    shares: Mapping[str, float] = field(default_factory=lambda: NO_SHARES)

    @classmethod
    def of(cls, one: Configuration, result: CaseResult) -> Row:
        """Return the row of a configuration, without errors."""
        return cls(**{each.name: getattr(one, each.name) for each in fields(one)}, result=result)

    @property
    def status(self) -> str:
        """How the run ended."""
        return self.result.status

    @property
    def curves(self) -> Curves:
        """The accepted load steps."""
        return self.result.arrays

    @property
    def steps(self) -> int:
        """Number of accepted load steps."""
        return len(self.curves.get("force", ()))

    @property
    def seconds(self) -> float:
        """Wall time of the run [s]; NaN where it did not begin."""
        return float(self.result.measured.get("seconds", _UNKNOWN))

    @property
    def finite_slopes(self) -> bool:
        """Whether it accounts for finite slopes."""
        return bool(self.result.measured.get("finite_slopes"))

    def last(self, name: str) -> float:
        """Return a value at the last accepted load step; NaN without any.

        Args:
            name: Name of one of the curves.
        """
        return float(self.curves[name][-1]) if self.steps else _UNKNOWN

    def record(self) -> dict[str, Any]:
        """Return the row by column: plain values, None where unknown.

        Values such as ``force_N`` are those of the last accepted load step.
        """
        scene = self.scene
        cells = None if self.coupling.meshes_roughness else block_section(scene).cells
        record = {
            "name": self.name,
            "kind": self.kind,
            "model": self.model,
            "heights": times(self.heights, "x"),
            "patches": times(scene.patches.grid, "x"),
            "cells": times(cells or (), "x"),
            "status": self.status,
            "finite_slopes": self.finite_slopes,
            "is_measure": self.is_measure,
            "unknowns": self.result.measured.get("unknowns"),
            "seconds": self.seconds,
            "steps": self.steps,
            "approach_mm": self.last("approach"),
            "force_N": self.last("force"),
            "contact_area_fraction": self.last("area"),
            "mean_separation_mm": self.last("separation"),
            **{f"error_{name}": value for name, value in self.errors.items()},
            **{f"share_{name}": value for name, value in self.shares.items()},
            "message": self.result.failure,
        }
        return {name: None if value != value else value for name, value in record.items()}


def error_measures(run: Curves, against: Curves, grid: Grid) -> dict[str, float]:
    """Return the `ERRORS` of a run against another, relative; NaN where unknown.

    Args:
        run: The run.
        against: The run that it is compared against.
        grid: Numbers of patches on which pressures are compared.
    """
    errors = dict(NO_ERRORS)
    common = min(len(run.get("force", ())), len(against["force"]))
    if not common:
        return errors
    whole, last = common == against["force"].size, common - 1
    for name in RESPONSES:
        mine, right = run[name][:common], against[name]
        scale = np.abs(right[:common])
        if name != "separation":
            scale[:] = scale.max()
        errors[f"{name}_max"] = _largest(mine - right[:common], scale)
        if whole:
            floor = ZERO * float(np.abs(right).max())
            errors[f"{name}_last"] = _ratio(mine[last] - right[last], right[last], floor)
    if whole:
        p, r = (
            on_grid(one["patch_pressure"][last], one["patches"], grid) for one in (run, against)
        )
        errors["pressure_l1"] = _ratio(float(np.abs(p - r).sum()), float(r.sum()))
        errors["distribution"] = _distribution_distance(p, r)
    return errors


def uncertainty(
    against: Curves, pairs: Sequence[tuple[Curves, Curves]], grid: Grid
) -> dict[str, float]:
    """Return the uncertainty of the run that others are compared against; no value is negative.

    Force, approach and area take the run's own error bars where it has them. All else is the sum of
    the distances between runs that differ by one refinement each. If a refinement at least halves
    the error, the error of the finer run is no larger than this distance.

    Args:
        against: The run.
        pairs: A coarser and a finer run for each refinement; without any, nothing is known.
        grid: Numbers of patches on which pressures are compared.
    """
    distances = [error_measures(*pair, grid) for pair in pairs] or [dict(NO_ERRORS)]
    total = {name: float(sum(abs(one[name]) for one in distances)) for name in ERRORS}
    for name in ("force", "approach", "area"):
        value, error = against[name], against[f"{name}_error"]
        known = np.isfinite(error)  # An error bar is unknown before meshes find the first contact.
        if known[-1]:
            top = float(np.abs(value).max())
            total[f"{name}_max"] = _largest(error[known], np.full(np.count_nonzero(known), top))
            total[f"{name}_last"] = _ratio(error[-1], value[-1], ZERO * top)
    return total


def on_grid(pressure: Array, patches: Sequence[int] | Array, grid: Grid) -> Array:
    """Return patch pressures on other patches of the same rectangle; the force is conserved.

    Pressures are uniform on the patches they are given on, and averaged over the new ones.

    Args:
        pressure: Mean pressures, shape (N,) [MPa].
        patches: Numbers of their patches along x and y.
        grid: Numbers of the new ones.

    Returns:
        Mean pressures, one for each new patch [MPa].
    """
    counts = [(int(new), int(old)) for new, old in zip(grid, patches, strict=True)]
    x, y = (
        new * interval_overlaps(np.linspace(0.0, 1.0, new + 1), np.linspace(0.0, 1.0, old + 1))
        for new, old in counts
    )
    return np.asarray((x @ pressure.reshape([old for _, old in counts]) @ y.T).ravel())


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
    """Return the largest |error| / scale of those with a scale; NaN when there is none."""
    usable = scale > 0.0
    return float(np.max(np.abs(error[usable]) / scale[usable])) if usable.any() else _UNKNOWN


def _ratio(error: float, right: float, floor: float = 0.0) -> float:
    """Return error / right; NaN when |right| is not above a floor."""
    return float(error / right) if abs(right) > floor else _UNKNOWN


class ErrorCauses:
    """Splits errors by causes.

    Args:
        rows: All rows.
        best: The best row of ``analytic``, ``concurrent`` and ``reference``, where reached.
        measure: The one of them that the others are compared against.
        quantity: Name of the curve that is compared, ``force`` or ``approach``.
    """

    def __init__(
        self, rows: Sequence[Row], best: Mapping[str, Row], measure: Row, quantity: str
    ) -> None:
        self._best, self._measure, self._quantity = best, measure, quantity
        self._models = {_micro_key(one): one for one in rows if not one.coupling.has_body}
        self._slopes = self._effect_of_slopes(rows)

    def shares(self, row: Row) -> Mapping[str, float]:
        """Return the shares of a row's error; unknown where it has none that is comparable.

        Those that are known add up to it.

        Args:
            row: One of the rows.
        """
        measure, value, right = self._measure, self._value(row), self._value(self._measure)
        if math.isnan(value) or not right:
            return NO_SHARES
        best, alone = self._best, self._models.get(_micro_key(row))
        # Differences are taken between responses with the same effect of slopes.
        mine, model, half_space, concurrent = (
            self._with_slopes(one)
            for one in (row, alone, best.get("analytic"), best.get("concurrent"))
        )
        shares = dict(NO_SHARES) | dict.fromkeys(("micro", "coupling", "block"), 0.0)
        if row.model not in ("", "half-space"):
            shares["micro"] = model - half_space
        if row.coupling.has_laws:
            shares["coupling"] = mine - concurrent - (model - half_space)
        neglects_block = measure.coupling.has_body - row.coupling.has_body
        if neglects_block:
            shares["block"] = neglects_block * (half_space - concurrent)
        if not math.isnan(self._slopes):
            neglected = measure.finite_slopes - row.finite_slopes
            shares["slopes"] = value - value * self._slopes**neglected
        shares["discretisation"] = value - right - float(np.nansum(list(shares.values())))
        return {name: share / right for name, share in shares.items()}

    def _value(self, row: Row | None) -> float:
        """Return the response at the measure's last load step; NaN where it was not reached."""
        steps = self._measure.steps
        if row is None or row.steps < steps:
            return _UNKNOWN
        return float(row.curves[self._quantity][steps - 1])

    def _with_slopes(self, row: Row | None) -> float:
        """Return the response that a row would have with finite slopes, where that is known."""
        neglected = row is not None and not row.finite_slopes and not math.isnan(self._slopes)
        return self._value(row) * (self._slopes if neglected else 1.0)

    def _effect_of_slopes(self, rows: Sequence[Row]) -> float:
        """Return the factor by finite slopes, of the concurrent coupling if any."""
        named, effects = {one.name: one for one in rows}, dict[str, float]()
        for name, small in named.items():
            steep = named.get(name.removesuffix(SMALL_SLOPES))
            values = self._value(steep), self._value(small)
            if name.endswith(SMALL_SLOPES) and steep and abs(values[0] * values[1]) > 0.0:
                effects.setdefault(steep.kind, values[0] / values[1])
        return effects.get("concurrent", next(iter(effects.values()), _UNKNOWN))


def _micro_key(row: Row) -> tuple[Any, str]:
    """Return what distinguishes a micro model and its surface from others."""
    return row.heights, repr(row.scene.micro)
