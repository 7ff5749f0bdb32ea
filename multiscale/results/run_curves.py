"""A run, and its quantities over a load that rises, read at any load within its range.

Between load steps, values are those of a monotone cubic in logarithms. Contact areas and
stiffnesses are not smooth, because contacts are made one by one, so that the error of that is
measured: each load step but the first and the last is left out in turn and interpolated from the
others. Twice the largest deviation counts as the error. From fewer than five load steps that cannot
be told, and the error is the distance to the neighbouring ones, between which a value lies.

Finishes are compared by what load steps tell over the mean pressure: stiffness of the interface,
conductance, contact area, mean gap, and the powers of the pressure that these follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from patchlaw.geometry.surface import FIRST_TOUCH
from patchlaw.multiscale.loading.column import leak_rates
from patchlaw.multiscale.loading.load_step import COLUMNS, LoadStep
from patchlaw.multiscale.results.files import read_history, result_of_a_run
from patchlaw.multiscale.results.history import History
from patchlaw.support import Array, Flags, InputError
from patchlaw.support.readable import number, usual_unit

SAME = 1e-6
"""Relative difference below which loads are the same."""

_LEAST_STEPS = 5
"""Load steps from which the error of interpolation can be told by leaving one out."""
_SAFETY = 2.0
"""Factor on deviations of load steps left out. Measured on a map of ground steel and on a law of a
sample, 6 and 8 of 48 load steps kept: the errors held 89 to 100 % of all values between them."""


class Quantity(NamedTuple):
    """A quantity of load steps that does not grow with the face.

    Attributes:
        name: Its name, which ends in its unit.
        text: Its name in words.
        unit: Its unit.
        column: The column of ``history.csv`` that it is read from.
        per_area: Factor on both over the nominal area; 0 where they do not grow with it.
        zone: Name of the region of the face whose column of ``patches.csv`` it is read from.
    """

    name: str
    text: str
    unit: str
    column: str
    per_area: float = 0.0
    zone: str = ""

    def values(self, history: History) -> Array:
        """Return the values at all load steps of a history, NaN where not known."""
        return self._read(history, self.column)

    def errors(self, history: History) -> Array:
        """Return their errors, NaN where not measured."""
        return self._read(history, "" if self.zone else _ERRORS[self.column])

    def _read(self, history: History, name: str) -> Array:
        values = np.full(len(history), np.nan)
        if name and self.zone:
            zone = getattr(history.patches, "names", ()).index(self.zone)
            states = [getattr(step.patches, name) for step in history.steps]
            values = np.array([np.nan if one is None else one[zone] for one in states])
        elif name:
            values = np.asarray(getattr(history, name), float)
        if not self.per_area:
            return values
        # nothing per area is nothing, where no force tells the area as well
        return np.where(values == 0.0, 0.0, self.per_area * values / nominal_area(history))


APPROACH = Quantity("approach_mm", "approach", "mm", "approach_mm")
PRESSURE = Quantity("mean_pressure_MPa", "mean pressure", "MPa", "force_N", 1.0)
SLID = Quantity("slid_mm", "distance slid", "mm", "slid_mm")
LOADS = {"pressure": PRESSURE, "approach": APPROACH, "slid": SLID}
"""What two runs can have in common where they are compared."""
AREA = Quantity("contact_area_fraction", "real contact area", "%", "contact_area_fraction")
SEPARATION = Quantity("mean_separation_mm", "mean separation", "mm", "mean_separation_mm")
OTHERS = (
    AREA,
    SEPARATION,
    Quantity("peak_pressure_MPa", "peak pressure", "MPa", "peak_pressure_MPa"),
    Quantity("plastic_depth_mm", "plastic depth", "mm", "plastic_depth_mm"),
    Quantity("mean_worn_depth_mm", "mean worn depth", "mm", "mean_worn_depth_mm"),
    Quantity("worn_depth_mm", "largest worn depth", "mm", "worn_depth_mm"),
    Quantity(
        "interface_stiffness_MPa_per_mm", "interface stiffness per area", "MPa/mm",
        "interface_stiffness_N_per_mm", 1.0,
    ),
    Quantity(
        "thermal_conductance_W_per_m2K", "thermal conductance per area", "W/m²K",
        "thermal_conductance_W_per_K", 1e6,
    ),
    Quantity(
        "electrical_conductance_S_per_m2", "electrical conductance per area", "S/m²",
        "electrical_conductance_S", 1e6,
    ),
    *(Quantity(name, f"leak {words}", "mm³/s", name) for name, words in leak_rates()),
)  # fmt: skip
_ERRORS = {one.name: one.error for one in COLUMNS}


def zone_quantities(names: Sequence[str]) -> Iterator[Quantity]:
    """Yield the quantities of the regions of a face.

    Args:
        names: Their names.
    """
    for name in names:
        for column, text, unit in (
            ("pressure_MPa", "mean pressure", "MPa"),
            ("force_N", "force", "N"),
            ("contact_area_fraction", "real contact area", "%"),
            ("interface_stiffness_MPa_per_mm", "interface stiffness per area", "MPa/mm"),
            ("leak_mm3_per_s", "leak", "mm³/s"),
        ):
            yield Quantity(f"{name} {column}", f"{name}: {text}", unit, column, zone=name)


def nominal_area(history: History) -> float:
    """Return the nominal area that mean pressures refer to [mm²]; NaN without any force."""
    loaded = history.mean_pressure_MPa > 0.0
    if not loaded.any():
        return float("nan")
    return float(np.median(history.force_N[loaded] / history.mean_pressure_MPa[loaded]))


@dataclass(frozen=True, slots=True, kw_only=True)
class StudiedRun:
    """A run and, where it was read from its folder, the scene behind it.

    Attributes:
        history: Its load steps.
        scene: The sections of its scene as they were given; None where they are not known.
        heights: SHA-256 of the heights of its surface; empty where it is not known.
    """

    history: History
    scene: Mapping[str, Any] | None = None
    heights: str = ""

    @classmethod
    def of(cls, given: History | str | Path) -> StudiedRun:
        """Return a run, which is read where its folder is given.

        Args:
            given: Its history, or the folder that ``patchlaw run`` wrote.

        Raises:
            InputError: When the folder holds no run.
        """
        if isinstance(given, History):
            return cls(history=given)
        folder = Path(given)
        if not (folder / "history.csv").is_file():
            problem = "holds no run: there is no history.csv in it"
            allowed = "a folder that patchlaw run wrote"
            raise InputError(problem, file=str(folder), allowed=allowed)
        history, path = read_history(folder), folder / "provenance.json"
        with result_of_a_run(path) as facts:
            if facts["units"] != "mm, N, MPa":
                problem, units = "has other units", facts["units"]
                raise InputError(problem, key="units", value=units, allowed="mm, N, MPa")
            heights = facts["surface"]["heights_sha256"]
            return cls(history=history, scene=facts["scene_given"], heights=heights)

    @property
    def zero(self) -> str | None:
        """Name of the height that the approach counts from; None where it is not known."""
        return None if self.scene is None else self.scene["load"].get("zero", FIRST_TOUCH)

    @property
    def is_periodic(self) -> bool:
        """Whether the approach counts from the mean of a surface that continues periodically."""
        return self.scene is not None and bool(self.scene["surface"].get("periodic"))


def slides(history: History) -> Flags:
    """Tell of every load step whether the surfaces slid, and wore, on the way to it, shape (n,)."""
    return np.diff(np.nan_to_num(history.slid_mm), prepend=0.0) > 0.0


def first_rise(history: History, name: str) -> History:
    """Return the load steps up to where the load first falls, those without a force left out.

    Args:
        history: All load steps.
        name: What the run is called.

    Raises:
        InputError: When no load step has a force.
    """
    falls = np.flatnonzero(history.unloading)
    end = int(falls[0]) if falls.size else len(history)
    steps = tuple(step for step in history.steps[:end] if step.force_N > 0.0)
    if not steps:
        raise InputError("has no load step with a force", key=name)
    return replace(history, steps=steps)


def from_one_zero(
    runs: Sequence[StudiedRun], risen: Sequence[History]
) -> tuple[list[History], list[str], bool]:
    """Return histories whose approaches count from one height, notes, and whether they can.

    Args:
        runs: The runs.
        risen: Their first rises.
    """
    if runs[0].is_periodic != runs[1].is_periodic:
        note = "approaches are not compared: one surface is periodic, and counts from its mean"
        return list(risen), [note], False
    depths = {bool(history.steps[0].zero_mm) for history in risen}
    zeros = {run.zero for run in runs} - {None}
    if len(zeros) < 2 and len(depths) == 1:
        return list(risen), [], True
    touched = [one.counted_from(-one.steps[0].zero_mm) for one in risen]
    return touched, ["the runs have different load.zero: approaches count from first touch"], True


class Curves:
    """What a run knows over a load that rises.

    Args:
        history: Its load steps.
        load: The load.

    Attributes:
        over: The load.
        slid: Number of load steps that slid to no larger load and are left out.
    """

    def __init__(self, history: History, load: Quantity) -> None:
        values = np.nan_to_num(load.values(history))
        before = np.maximum.accumulate(values)[:-1]
        # approaches alone may begin below 0; a force that is held rises by rounding
        begins = (values[:1] > 0.0) | (load is APPROACH)
        rises = np.append(begins, values[1:] > before + SAME * np.abs(before))
        self.history = replace(history, steps=tuple(compress(history.steps, rises)))
        self.slid = np.count_nonzero(slides(history) & ~rises)
        self.over = load
        self.load, self.load_error = load.values(self.history), load.errors(self.history)

    def at(self, quantity: Quantity, loads: Array) -> tuple[Array, Array]:
        """Return a quantity and its errors, at loads within the range.

        Args:
            quantity: The quantity.
            loads: The loads, shape (n,).
        """
        values = quantity.values(self.history)
        known = np.isfinite(values)
        if not known.any():
            return np.full(loads.shape, np.nan), np.full(loads.shape, np.nan)
        load, values = self.load[known], values[known]
        errors = self._errors(quantity)[known]
        found, between = interpolated(loads, load, values)
        relative = errors / np.abs(np.where(values, values, np.nan))
        nearest = np.abs(loads[:, None] - load).argmin(axis=1)
        on_step = np.abs(loads - load[nearest]) <= SAME * np.abs(load[nearest])
        carried = np.interp(loads, load, relative)
        relative = np.where(on_step, relative[nearest], carried)
        measured = relative * np.abs(found)
        unknown = np.isnan(found) | (np.isnan(measured) & (between == 0.0))
        return found, np.where(unknown, np.nan, np.nan_to_num(measured) + between)

    def _errors(self, quantity: Quantity) -> Array:
        """Return errors at the load steps, at exactly their loads; NaN where not measured."""
        own = quantity.errors(self.history)
        # those of what is prescribed are 0; else the error of the load shifts the curve sideways
        slope = np.zeros(1)
        if len(self.load) > 1:
            slope = np.abs(np.gradient(quantity.values(self.history), self.load))
        both = np.nan_to_num(own) + slope * np.nan_to_num(self.load_error)
        unknown = np.isnan(own)
        if quantity in (APPROACH, PRESSURE):  # of which one is prescribed
            unknown &= np.isnan(self.load_error)
        return np.where(unknown, np.nan, both)


def interpolated(at: Array, load: Array, values: Array) -> tuple[Array, Array]:
    """Return values at loads, and the errors of interpolation, 0 at the load steps themselves.

    Args:
        at: The loads, shape (n,); NaN is returned for those beyond the range.
        load: Loads of the load steps, rising.
        values: Values there.
    """
    nearest = np.abs(at[:, None] - load).argmin(axis=1)
    found, between = values[nearest], np.zeros(len(at))
    on_step = np.abs(at - load[nearest]) <= SAME * np.abs(load[nearest])
    inside = on_step | ((at > load[0]) & (at < load[-1]))
    if len(load) > 1:
        where, steps = np.clip(at, load[0], load[-1]), load
        if load[0] > 0.0:
            where, steps = np.log(where), np.log(steps)
        cubic = _cubic(steps, values)(where)
        found = np.where(on_step, found, cubic)
        between = np.where(on_step, 0.0, _error(where, steps, values, cubic))
    return np.where(inside, found, np.nan), between


def _cubic(steps: Array, values: Array) -> Callable[[Array], Array]:
    """Return a monotone cubic, of logarithms where all values have some."""
    if (values > 0.0).all():
        logarithm = scipy.interpolate.PchipInterpolator(steps, np.log(values))
        return lambda where: np.exp(logarithm(where))
    return scipy.interpolate.PchipInterpolator(steps, values)


def _error(where: Array, steps: Array, values: Array, found: Array) -> Array:
    """Return the errors of values found between load steps; see the module."""
    if len(steps) < _LEAST_STEPS:
        after = np.clip(np.searchsorted(steps, where), 1, len(steps) - 1)
        return np.maximum(np.abs(found - values[after]), np.abs(found - values[after - 1]))
    missed = np.zeros(len(steps))
    for left_out in range(1, len(steps) - 1):
        others = np.arange(len(steps)) != left_out
        missed[left_out] = abs(
            _cubic(steps[others], values[others])(steps[left_out]) - values[left_out]
        )
    scale = np.where(values, np.abs(values), np.inf)
    return np.asarray(_SAFETY * np.max(missed / scale) * np.abs(found))


def common_loads(curves: Sequence[Curves], names: Sequence[str], load: Quantity) -> Array:
    """Return loads that both runs have or, without any, those of either in the range of both.

    Args:
        curves: The runs.
        names: What they are called.
        load: The load.

    Raises:
        InputError: When the ranges do not overlap.
    """
    first, second = (curve.load for curve in curves)
    nearest = second[np.abs(first[:, None] - second).argmin(axis=1)]
    shared = first[np.abs(first - nearest) <= SAME * np.abs(nearest)]
    if shared.size:
        return shared
    low, high = max(first[0], second[0]), min(first[-1], second[-1])
    both = np.sort(np.concatenate([first, second]))
    both = both[(both >= low) & (both <= high)]
    if not both.size:
        name, size = usual_unit([float(curve.load[-1]) for curve in curves], load.unit)
        ranges = " and ".join(
            f"{number(curve.load[0] / size)} to {number(curve.load[-1] / size)} {name} in {said}"
            for curve, said in zip(curves, names, strict=True)
        )
        problem = f"the runs have none in common: {ranges}"
        raise InputError(problem, key=load.text, allowed="runs whose loads overlap")
    return both


_NOT_COMPARED = "peak_pressure_MPa", "plastic_depth_mm", "mean_worn_depth_mm", "worn_depth_mm"
_NO_POWER = "mean_separation_mm"
"""What falls as a logarithm of the pressure."""
_SATURATES = "contact_area_fraction"
"""What follows no power in full contact, where it is 1."""
_FULL = 1.0 - 1e-9
"""Share that counts as full contact; means of it round to less than 1."""
_ONE_POWER = 0.1
"""Largest relative deviation from a power of the pressure that counts as one."""
_OF_HALF = 0.3
"""The same of a power in half of the range."""
_KNOWN = 0.2
"""Largest relative error of a stiffness that still tells a slope. Where few cells yield it is half,
and cubics of four load steps were up to twice as far from 32 load steps as straight lines."""
_APART = 0.1
"""Both slopes may be so much above or below that between load steps, relatively. On faces of uneven
pressures they are that of the interface as a whole, and not that of means over it."""
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
            is within `_ONE_POWER` of all values, and of them those of three values or more, all
            within `_OF_HALF`, as leaks follow none; none of fewer than two values above 0.
        """
        known = np.isfinite(values) & (values > 0.0)
        x, y = np.log(pressure[known]), np.log(values[known])
        if len(x) < 2:
            return ()
        one = cls.of(x, y)
        if one._off(x, y) <= _ONE_POWER:
            return (one,)
        below = np.count_nonzero(x < 0.5 * (x[0] + x[-1]))
        low, high = slice(max(below, 2)), slice(min(below, len(x) - 2), None)
        halves = [(cls.of(x[part], y[part]), x[part], y[part]) for part in (low, high)]
        return tuple(law for law, *at in halves if len(at[0]) > 2 and law._off(*at) <= _OF_HALF)

    def _off(self, x: Array, y: Array) -> float:
        """Return the largest relative deviation of values, given by logarithms, from the power."""
        return math.expm1(np.abs(y - self.exponent * x - math.log(self.factor)).max())

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
    first load step it is the power of the approach from first touch that has its slope there. Where
    the surfaces wear in between, or both slopes over the separation are on one side of that
    between, there is none.

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
    worn = slides(history)
    for index, (here, there) in enumerate(pairwise(steps), 1):
        x, y = (
            np.array([getattr(step, column) for step in (here, there)])
            for column in (over, "mean_pressure_MPa")
        )
        if worn[index] or x[0] == x[1] or y[0] == y[1]:
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
        one_side = (known > 1.0 + _APART).all() or (known < 1.0 - _APART).all()
        if one_side and not by_approach:
            continue
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
    scatter = step.stiffness_scatter or 0.0  # both load steps share their other errors
    if not scatter <= _KNOWN or (step.plastic_depth_mm and bool(scatter) != anew):
        return None
    return float(stiffness * step.mean_pressure_MPa / step.force_N)
