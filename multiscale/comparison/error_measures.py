"""How far two runs with the same load history lie apart: every error measure, defined once.

With R the run that is compared against and k the load steps that both have,

* of force, approach and contact area, relative to their largest in R over these steps,

      max_k |X_k − R_k| / max_k |R_k|,    and signed at R's last step,    (X − R) / R;

* of the mean separation likewise, but relative to R's at the same step, as it falls under load;
* of the patch pressures at R's last step, on the patches of a common grid, the L1 distance

      Σ_i |p_i − r_i| / Σ_i r_i;

* of their distribution there, the Wasserstein distance of p / <p> and r / <r>, which is the area
  between the two distribution functions: blind to where pressures are and to the force.

Errors at R's last step are unknown (NaN) for a run that stopped before it. The uncertainty of R
itself is defined by the same formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.patches import PatchGrid, interval_overlaps

Array = NDArray[np.float64]

ZERO = 1e-9
"""A force or an area below this share of the largest counts as zero: nothing is relative to it."""

_UNKNOWN = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curves:
    """The results of a run that are compared: m load steps, N patches.

    Attributes:
        patches: The partition of the interface.
        approach: Approach of the plane at the middle, shape (m,) [mm].
        force: Force, shape (m,) [N].
        area: Contact area fraction, shape (m,).
        separation: Mean separation, shape (m,) [mm].
        patch_pressure: Mean pressure of each patch, shape (m, N) [MPa].
        approach_error: The run's own error bar of the approach, shape (m,) [mm]; NaN where unknown.
        force_error: Error bar of the force, shape (m,) [N].
        area_error: Error bar of the area fraction, shape (m,).
    """

    patches: PatchGrid
    approach: Array
    force: Array
    area: Array
    separation: Array
    patch_pressure: Array
    approach_error: Array
    force_error: Array
    area_error: Array

    def __post_init__(self) -> None:
        if self.patch_pressure.shape != (self.force.size, self.patches.count):
            raise InputError(
                "patch pressures do not fit the load steps and patches",
                value=self.patch_pressure.shape,
                allowed=f"{(self.force.size, self.patches.count)}",
            )

    def __len__(self) -> int:
        return self.force.size

    def divided(self, scale: float) -> Curves:
        """Return the curves for heights and a load that are larger by 1 / scale, at small slopes.

        Areas stay as they are; forces, pressures and lengths normal to the surface are divided.
        """
        names = {field.name for field in fields(self)} - {"patches", "area", "area_error"}
        return replace(self, **{name: getattr(self, name) / scale for name in names})


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


def error_measures(run: Curves, against: Curves, grid: PatchGrid) -> ErrorMeasures:
    """Measure how far a run lies from another.

    Args:
        run: The run.
        against: The run that it is compared against.
        grid: Patches on which pressures are compared.
    """
    common = min(len(run), len(against))
    if not common:
        return ErrorMeasures()
    whole, last = common == len(against), common - 1
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
