"""What load steps tell of the curves through them: powers of the mean pressure, slopes between.

Finishes are compared by the stiffness of their interface, its conductance, contact area and mean
gap over the mean pressure. Between load steps the stiffnesses of these are the slopes of the curves
of the pressure; of other quantities nothing is known there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import number, usual_unit
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.results.run_curves import OTHERS, PRESSURE, Curves, Quantity, slides
from patchlaw.support.arrays import Array, Flags

_NOT_COMPARED = "peak_pressure_MPa", "plastic_depth_mm", "mean_worn_depth_mm", "worn_depth_mm"
_NO_POWER = "mean_separation_mm"
"""What falls as a logarithm of the pressure."""
_SATURATES = "contact_area_fraction"
"""What follows no power in full contact, where it is 1."""
_FULL = 1.0 - 1e-9
"""Share that counts as full contact; means of it round to less than 1."""
_ONE_POWER = 0.1
"""Largest relative deviation from a power of the pressure that counts as one."""
_KNOWN = 0.2
"""Largest relative error of a stiffness that still tells a slope. Where few cells yield it is half,
and cubics of four load steps were up to twice as far from 32 load steps as straight lines."""
_PARTS = np.linspace(0.0, 1.0, 13)
"""Places between two load steps that a curve is drawn through."""


class PowerLaw(NamedTuple):
    """The power of the mean pressure that a quantity follows, q = factor p^exponent.

    Attributes:
        exponent: The exponent.
        factor: The quantity at 1 MPa.
        low: Smallest mean pressure [MPa].
        high: Largest mean pressure [MPa].
    """

    exponent: float
    factor: float
    low: float
    high: float

    @classmethod
    def of(cls, x: Array, y: Array) -> PowerLaw:
        """Return the power through logarithms of pressures and of values, by least squares."""
        exponent, offset = np.polyfit(x, y, 1)
        return cls(float(exponent), math.exp(offset), math.exp(x[0]), math.exp(x[-1]))

    @classmethod
    def through(cls, pressure: Array, values: Array) -> tuple[PowerLaw, ...]:
        """Return the power of values at rising pressures.

        Args:
            pressure: Mean pressures, shape (n,) [MPa].
            values: The values, NaN where not known.

        Returns:
            One; two, in the lower and the upper half of the logarithms of pressures, where no power
            is within `_ONE_POWER` of all values; none of fewer than two values above 0.
        """
        known = np.isfinite(values) & (values > 0.0)
        x, y = np.log(pressure[known]), np.log(values[known])
        if len(x) < 2:
            return ()
        one = cls.of(x, y)
        if np.abs(y - one.exponent * x - math.log(one.factor)).max() <= math.log1p(_ONE_POWER):
            return (one,)
        below = np.count_nonzero(x < 0.5 * (x[0] + x[-1]))
        low, high = max(below, 2), min(below, len(x) - 2)
        return cls.of(x[:low], y[:low]), cls.of(x[high:], y[high:])

    def at(self, pressure: Array) -> Array:
        """Return the quantity at mean pressures [MPa]."""
        return np.asarray(self.factor * pressure**self.exponent)

    @property
    def text(self) -> str:
        """The power in words, such as ``p^1.24 from 50 to 200 MPa``."""
        name, size = usual_unit([self.high], "MPa")
        low, high = (number(end / size, 3) for end in (self.low, self.high))
        return f"p^{self.exponent:.2f} from {low} to {high} {name}"


class OverPressure(NamedTuple):
    """A quantity over the mean pressure, at all load steps with a force.

    Attributes:
        quantity: The quantity.
        pressure: Mean pressures, shape (n,) [MPa].
        values: Its values, NaN where not known.
        errors: Their errors, NaN where not measured.
        back: Whether the load has fallen to or before each load step, shape (n,).
        laws: The powers that it follows as the load first rises, up to the first load step before
            which the surfaces slid and wore, see `PowerLaw.through`.
    """

    quantity: Quantity
    pressure: Array
    values: Array
    errors: Array
    back: Flags
    laws: tuple[PowerLaw, ...]

    @property
    def text(self) -> str:
        """The powers in words; empty where there is none."""
        return ", ".join(law.text for law in self.laws)


def over_pressure(history: History) -> list[OverPressure]:
    """Return what is read over the mean pressure of a run that reaches several.

    Args:
        history: Its load steps.

    Returns:
        Contact area, mean separation, and those of the stiffness of the interface and the
        conductances, per area, that are known; nothing where the load does not first rise through
        two load steps.
    """
    loaded = replace(history, steps=tuple(step for step in history.steps if step.force_N > 0.0))
    if not len(loaded):
        return []
    back, pressure = np.cumsum(loaded.unloading) > 0, PRESSURE.values(loaded)
    first = replace(loaded, steps=loaded.steps[: np.count_nonzero(~back)])
    rising, found = Curves(first, PRESSURE), []
    worn = np.flatnonzero(slides(rising.history)[1:])  # other surfaces from there on
    unworn = int(worn[0]) + 1 if worn.size else len(rising.load)
    for one in OTHERS if len(rising.load) > 1 else ():
        values, laws = one.values(loaded), tuple[PowerLaw, ...]()
        if one.name in _NOT_COMPARED or np.count_nonzero(np.isfinite(values)) < 2:
            continue
        if one.name != _NO_POWER:
            known = one.values(rising.history)
            if one.name == _SATURATES:
                known = np.where(known < _FULL, known, np.nan)
            laws = PowerLaw.through(rising.load[:unworn], known[:unworn])
        found.append(OverPressure(one, pressure, values, one.errors(loaded), back, laws))
    return found


def pressure_between(history: History, over: str) -> Iterator[tuple[int, Array, Array]]:
    """Yield the curve of the mean pressure between load steps, where its slopes are known.

    A cubic through both load steps with the slopes that their stiffnesses are, monotone. To the
    first load step it is the power of the approach from first touch that has its slope there.

    Args:
        history: The load steps.
        over: Column that the pressure is drawn over, ``"approach_mm"`` or ``"mean_separation_mm"``.

    Yields:
        Number of the load step that a curve ends at, from 0; its abscissae [mm] and pressures
        [MPa], shape (m,) each.
    """
    steps, by_approach = history.steps, over == "approach_mm"
    name = "approach_stiffness_N_per_mm" if by_approach else "interface_stiffness_N_per_mm"
    sign = 1.0 if by_approach else -1.0
    if not steps:
        return
    if by_approach and history.before is None and not any(any(step.tilt) for step in steps):
        yield from _from_touch(steps[0], name)
    most = max([steps[0].force_N, *([] if history.before is None else [history.before.force_N])])
    for index, (here, there) in enumerate(pairwise(steps), 1):
        x, y = (
            np.array([getattr(step, column) for step in (here, there)])
            for column in (over, "mean_pressure_MPa")
        )
        if x[0] == x[1] or y[0] == y[1]:
            continue
        anew = there.force_N > most
        most = max(most, there.force_N)
        secant = (y[1] - y[0]) / (x[1] - x[0])
        slopes = [_slope(step, name, anew=anew) for step in (here, there)]
        known = np.array([np.nan if slope is None else sign * slope for slope in slopes]) / secant
        if np.isnan(known).all() or not secant * sign > 0.0:
            continue
        if np.isnan(known).any():  # without curvature at the other end
            known = np.where(np.isnan(known), 1.5 - 0.5 * np.nansum(known), known)
        # the circle within which cubics are monotone (Fritsch and Carlson 1980)
        known = np.clip(known, 0.0, None) * min(1.0, 3.0 / max(float(np.hypot(*known)), 1e-300))
        t = _PARTS
        rise = (3.0 - 2.0 * t) * t**2 + t * (1.0 - t) * ((1.0 - t) * known[0] - t * known[1])
        yield index, x[0] + t * (x[1] - x[0]), y[0] + rise * (y[1] - y[0])


def _from_touch(step: LoadStep, name: str) -> Iterator[tuple[int, Array, Array]]:
    """Yield the curve from first touch to the first load step."""
    touch, stiffness = -step.zero_mm, _slope(step, name, anew=True)
    reached = step.approach_mm - touch
    if stiffness is None or not step.force_N > 0.0 or not reached > 0.0:
        return
    exponent = stiffness * reached / step.mean_pressure_MPa
    if exponent >= 1.0:
        yield 0, touch + _PARTS * reached, step.mean_pressure_MPa * _PARTS**exponent


def _slope(step: LoadStep, name: str, *, anew: bool) -> float | None:
    """Return the slope of the mean pressure on one side of a load step [MPa/mm], if it is known.

    Where surfaces have yielded, a stiffness is that of a load that goes on beyond all before, or
    that below them.

    Args:
        step: The load step.
        name: Column of the stiffness.
        anew: Whether the load is larger on that side than all before.
    """
    stiffness = getattr(step, name)
    if stiffness is None or not step.force_N > 0.0:
        return None
    # that of the interface has measured errors, too, of grids that both load steps share
    error, whole = step.approach_stiffness_error_N_per_mm or 0.0, step.approach_stiffness_N_per_mm
    if whole is not None and not error <= _KNOWN * whole:
        return None
    if step.plastic_depth_mm and bool(step.approach_stiffness_error_N_per_mm) != anew:
        return None
    return float(stiffness * step.mean_pressure_MPa / step.force_N)
