"""Makes representative laws: pressure over closure of periodic samples of a large face.

The law of several samples is the mean of their pressures at equal separations of their mean planes.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry import Control, Regions, Surface
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro import HalfSpaceModel, Start, press_along
from patchlaw.multiscale.laws.interpolation import rising_curves
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import MOST_ROWS, RowMaker, refined
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.support import Array, InputError, shared
from patchlaw.support.arguments import Comm, Limits, PositiveLength, PositivePressure, checked
from patchlaw.support.readable import ProgressObserver, unobserved

T = TypeVar("T", float, Array)
MakeModel = Callable[[Surface], HalfSpaceModel]

FULL_CONTACT = 0.01
"""Compliance of a law in full contact, relative to its mean one up to there. The interface itself
has none left; without any, the pressure would be no function of closure."""

_NEARLY_FULL = 0.8
"""Contact area fraction from which on the law of a sample with finite slopes may have ended; the
least one where the approach turned back was 0.89."""
_ROUNDING = 1e-12
"""Separations that differ by no more, over the largest, are one, as closures are that were counted
from another height and back."""
_MOST = 0.9
"""Largest mean pressure under which finite slopes are solved for, over the Young's modulus."""
_PART = 2e-3
"""Error of the mean pressure where such a law ends, over that which closes the flat sample."""
_ROW_ERROR = 5e-4
"""Residual of a row over the tolerance of the law."""

_ROWS_TOGETHER = 2
"""Rows of a sample that one rank solves in sequence, each starting from the one before, so that
results do not depend on the number of ranks."""

_CLOSE = 0.01  # of its way: further than needed that the last row may lie
_FULL_ROWS = 4  # of a law that goes on in full contact


@checked
def representative_law(
    samples: Sequence[Surface],
    contact_modulus: PositivePressure,
    *,
    largest_pressure: PositivePressure | None = None,
    largest_closure: PositiveLength | None = None,
    tolerance: Annotated[float, Limits(gt=0, lt=1)] = 3e-3,
    most_rows: Annotated[int, Limits(ge=4, le=100_000)] = MOST_ROWS,
    make_model: MakeModel | None = None,
    before: PatchLaw | None = None,
    leak: bool = False,
    comm: Comm | None = None,
    observe: ProgressObserver | None = None,
) -> PatchLaw:
    """Tabulate the law of a face that is much larger than the samples of its roughness.

    The samples continue periodically on a half-space whose displacements count from their mean:
    p over z_M − mean height − mean separation is the law of the interface alone, and all long waves
    are left to the body that uses it. The law of several samples is the mean of their pressures at
    equal separations of their mean planes. Closure counts from the height z_M of the sample that
    rises highest above its mean plane.

    Args:
        samples: Periodic surfaces; they count by their areas. A map that does not continue
            periodically is `geometry.mirrored` first.
        contact_modulus: E* [MPa].
        largest_pressure: Largest local pressure that the law will be used for [MPa].
        largest_closure: Largest local closure [mm]. Of both, what is reached first ends the law.
        tolerance: Interpolation error of the pressure, see `refinement.refined`.
        most_rows: Rows that are solved at most, for each sample.
        make_model: Makes the model of a sample; by default the periodic half-space.
        before: A law of the same samples that ends too early: its rows are kept, and only what lies
            beyond them is solved.
        leak: Whether the law also has the transmissivity of the gaps, for a leak.
        comm: MPI communicator, whose ranks share samples and rows. The law does not depend on
            their number.
        observe: Called as rows are solved.

    Returns:
        The law, on every rank, parametrised by s = c + Λ p with its mean compliance Λ: the plane's
        approach where a layer of that compliance lies under the interface. The contacts are those
        of all samples together, on `sample_area`. In full contact, where the interface has no
        compliance left, the law goes on with a hundredth of its mean one. Under a hardness the law
        is that of rising loads, and ends where the plane is at the mean plane at the latest.

    Raises:
        InputError: When there is no sample, one is not periodic or flat, or no largest load is
            given.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    given = largest_pressure, largest_closure
    pressure, closure = (np.inf if value is None else float(value) for value in given)
    if not np.isfinite([pressure, closure]).any():
        raise InputError(
            "a representative law needs an end",
            value=list(given),
            allowed="largest_pressure, largest_closure or both",
        )
    if not samples:
        raise InputError("a representative law needs a sample", key="samples", value=[])
    make = make_model or (
        lambda sample: HalfSpaceModel(sample, contact_modulus=contact_modulus, periodic=True)
    )
    face = PeriodicSamples(
        samples=tuple(_checked(sample, make, _ROW_ERROR * tolerance) for sample in samples),
        comm=comm,
        observe=lambda rows: (observe or unobserved)("rows of laws", rows, most_rows),
    )
    law = face.law(pressure, closure, tolerance, most_rows, before)
    return face.with_leak(law, before) if leak else law


def representative_laws(
    regions: Mapping[str, Sequence[Surface]],
    contact_modulus: float,
    *,
    largest_pressure: float | Sequence[float] | None = None,
    before: LawTable | None = None,
    **options: Any,
) -> LawTable:
    """Tabulate the laws of all regions of a face, whose mean planes are one plane.

    Args:
        regions: Samples of each region, by its name; a face in one piece is one region.
        contact_modulus: E* [MPa].
        largest_pressure: As for `representative_law`, of all regions or of each [MPa].
        before: Laws of the same samples that end too early, as for `representative_law`; a law that
            reaches its largest pressure is kept.
        options: As for `representative_law`.

    Returns:
        One law per region. Closures of all count from the height of the region that rises highest
        above the common mean plane.

    Raises:
        InputError: When there is no region, or as for `representative_law`.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    names = Regions(tuple(regions))
    count = len(names.names)
    earlier = [None] * count if before is None else before.laws
    each = isinstance(largest_pressure, Sequence)
    ends: Any = largest_pressure if each else [largest_pressure] * count

    def made(name: str, end: float | None, law: PatchLaw | None) -> PatchLaw:
        if law is not None and end and float(law.rows.pressure.max(initial=0.0)) >= end:
            return law
        options.update(largest_pressure=end, before=law)
        return representative_law(regions[name], contact_modulus, **options)

    laws = [made(*one) for one in zip(names.names, ends, earlier, strict=True)]
    highest = max(law.initial_separation for law in laws)
    return LawTable(
        patches=names,
        laws=tuple(law.shifted(highest - law.initial_separation) for law in laws),
        made_by={
            "coupling": "representative",
            "model": "half-space-periodic",
            "love": "none",
            "tolerance": f"{options.get('tolerance', 3e-3):g}",
            "samples": ", ".join(str(len(regions[name])) for name in names.names),
        },
        force_error=max(law.interpolation_error for law in laws),
    )


def _checked(sample: Surface, make: MakeModel, error: float) -> PeriodicSample:
    if np.ptp(sample.heights) == 0.0:
        raise InputError("a flat sample has no law", value=sample.source or "flat")
    model = make(sample)
    if not model.periodic:
        raise InputError("a representative law needs periodic models", value=model.name)
    return PeriodicSample(model, error)


@dataclass(frozen=True, kw_only=True, eq=False)
class PeriodicSamples:
    """Periodic samples of one face, each under a plane at the same mean separation.

    The rows' parameter t runs from first touch, 0, to full contact, 1: the separation is
    g = (1 − t)² of that at first touch. Towards full contact the pressure of a wave rises as √g
    (Westergaard 1939), and so linearly in t. With finite slopes the law goes on a little, to a
    separation of −(1 − t)² of that.

    Args:
        samples: The samples.
        comm: MPI communicator, whose ranks share samples and rows; None for this process alone.
        observe: Called with the number of rows that are solved.
    """

    samples: tuple[PeriodicSample, ...]
    comm: Any = None
    observe: Callable[[int], None] = lambda rows: None
    _solved: list[int] = field(default_factory=lambda: [0], init=False)

    @property
    def shares(self) -> Array:
        """Shares of the samples in the area of all, shape (n,)."""
        areas = np.array([sample.area for sample in self.samples])
        return np.asarray(areas / areas.sum())

    @cached_property
    def reference(self) -> float:
        """Separation that closure counts from, z_M − mean height of the highest sample [mm]."""
        return max(sample.reference for sample in self.samples)

    @cached_property
    def first_touch(self) -> float:
        """Separation at first touch of a cell [mm]."""
        return max(sample.first_touch for sample in self.samples)

    @cached_property
    def closed(self) -> list[Closed]:
        """Where the laws of the samples end; collective."""
        samples = self.samples
        return shared(self.comm, len(samples), lambda k: samples[k].closed)

    @cached_property
    def nearest(self) -> float:
        """Least separation of the law, where the first of the samples ends [mm]; collective."""
        if not any(sample.model.slopes for sample in self.samples):
            return 0.0
        return max(closed.separation for closed in self.closed)

    def law(
        self,
        pressure: float,
        closure: float,
        tolerance: float,
        most_rows: int,
        before: PatchLaw | None = None,
    ) -> PatchLaw:
        """Tabulate the mean law of the samples up to a limit; collective.

        Args:
            pressure: Largest mean pressure [MPa].
            closure: Largest closure [mm]. Of both, what is reached first ends the law.
            tolerance: Interpolation error of the pressure.
            most_rows: Rows that are solved at most, for each sample.
            before: A law of the same samples, whose rows are kept; others are added beyond them.
        """
        touch = max(self.reference - self.first_touch, 0.0)
        ends: dict[str, Any] = {
            "first_touch": touch,
            "initial_separation": self.reference,
            "sample_area": sum(sample.area for sample in self.samples),
        }
        if closure <= touch:
            return PatchLaw(rows=LawRows.none(), **ends)
        end, start, kept = self.end(pressure, closure), 0.0, LawRows.none()
        if before is not None and not before.is_open:
            kept = self._without_full_contact(before)
            start = self._parameter(self._within(self.reference - float(kept.closure[-1])))
            compliance = float((kept.approach[-1] - kept.closure[-1]) / kept.pressure[-1])
        else:
            last = self.rows(np.array([end]), 0.0)[:, 0]
            compliance = float((last.closure[0] - touch) / last.pressure[0])
        solve = partial(self.rows, compliance=compliance)
        make = RowMaker(solve, rising_curves, np.array([[compliance]]), self.reference)
        made = refined(make, start, end, tolerance, most_rows)
        new, errors = made.rows[:, 0], made.of_law(0)
        rising, change = (kept.joined(new[1:]) if len(kept) else new).rising()
        nearest = max(start, end)
        ends_full = not self._separation(nearest) > 0.0 and nearest == self._parameter(self.nearest)
        if ends_full and not any(sample.yields for sample in self.samples):
            rising = self._in_full_contact(rising, pressure, closure, compliance)
        if before is not None:
            known = before.interpolation_error
            errors["interpolation_error"] = max(errors["interpolation_error"], known)
        return PatchLaw(
            rows=rising, warning_pressure=rising.warning_pressure, repaired=change, **ends, **errors
        )

    def with_leak(self, law: PatchLaw, before: PatchLaw | None) -> PatchLaw:
        """Return a law with the transmissivity of the gaps; collective.

        Args:
            law: The law of the samples.
            before: A law of theirs whose transmissivity serves where it goes far enough.
        """
        least = max(law.initial_separation - law.range[1], 0.0)

        def gaps(separation: ArrayLike) -> Array:
            """Return mean gaps at separations of the mean planes, which did not yield."""
            if not any(sample.yields for sample in self.samples):
                return np.asarray(separation)
            closure = law.initial_separation - np.asarray(separation)
            return law.at(closure, extend=True).separation

        known = None if before is None else before.transmissivity
        if known is not None and (
            not known.hydraulic_gap[0].any() or known.separation[0] <= gaps(least)
        ):
            return replace(law, transmissivity=known)
        from patchlaw.multiscale.laws.transmissivity import (
            sample_transmissivity,  # others do without
        )

        flow = sample_transmissivity(
            [sample.model for sample in self.samples],
            lambda separation: law.pressure(law.initial_separation - separation),
            self.comm,
            least=least,
        )
        return replace(law, transmissivity=replace(flow, separation=gaps(flow.separation)))

    def _without_full_contact(self, law: PatchLaw) -> LawRows:
        """Return the rows of a law of these samples that were solved, on their own reference."""
        rows = law.shifted(self.reference - law.initial_separation).rows
        # beyond the last one the rows of full contact follow, which go on straight
        last = self.reference - self._within(self.reference - float(rows.closure[-1]))
        rows = rows[rows.closure <= last + self.reference * _ROUNDING]
        return replace(rows, outside_range=rows.pressure >= law.warning_pressure)

    def end(self, pressure: float, closure: float) -> float:
        """Return the parameter of the last row, in full contact at most; collective.

        Args:
            pressure: Largest mean pressure [MPa].
            closure: Largest closure [mm].
        """
        by_closure = self._parameter(self._within(self.reference - closure))
        if not np.isfinite(pressure):
            return by_closure
        samples = self.samples
        under = shared(self.comm, len(samples), lambda k: samples[k].separation_under(pressure))
        low, high = (self._parameter(self._within(end)) for end in (max(under), min(under)))

        @cache
        def excess(parameter: float) -> float:
            return float(self.rows(np.array([parameter]), 0.0).pressure[0, 0]) - pressure

        if high - low > _CLOSE * high and excess(low) < 0.0 < excess(high):
            found = float(scipy.optimize.brentq(excess, low, high, xtol=1e-9 * high, rtol=_CLOSE))
            high = min(high, (1.0 + _CLOSE) * found)
        return min(by_closure, high)

    def _within(self, separation: float) -> float:
        """Return a separation, no less than the least one; collective."""
        return separation if separation > 0.0 else max(separation, self.nearest)

    def _parameter(self, separation: float) -> float:
        root = float(np.sqrt(abs(separation) / self.first_touch))
        return 1.0 - root if separation > 0.0 else 1.0 + root

    def _separation(self, parameter: T) -> T:
        return self.first_touch * ((1.0 - parameter) * abs(1.0 - parameter))

    def rows(self, parameters: Array, compliance: float) -> LawRows:
        """Return rows of the mean law, columns of shape (m, 1); collective.

        Args:
            parameters: Values of t, increasing, shape (m,).
            compliance: Λ of the rows' approach, s = c + Λ p [mm/MPa].
        """
        separations = self._separation(parameters)
        found, shares = self._solve(separations), self.shares
        means = np.tensordot(shares, found, 1)
        pressure, closure = means[:, 0], self.reference - separations
        variance = shares @ (found[..., 0] - pressure) ** 2
        columns = LawRows(
            approach=closure + compliance * pressure,
            closure=closure,
            pressure=pressure,
            contact_area_fraction=means[:, 1],
            contacts=found[..., 2].sum(axis=0).astype(np.int64),
            # of what has no gap left, and by what has yielded
            unresolved_displacement=np.maximum(-separations, 0.0) + means[:, 4],
            pressure_scatter=np.sqrt(variance / (1.0 - shares @ shares or 1.0)),
            outside_range=found[..., 3].any(axis=0),
        )
        return columns[:, None]

    def _solve(self, separations: Array) -> Array:
        """Return the rows of all n samples at m separations that fall, shape (n, m, 5).

        The ranks share them.
        """
        quick = all(sample.quick for sample in self.samples)
        count = len(separations) if quick else _ROWS_TOGETHER
        parts = [separations[k : k + count] for k in range(0, len(separations), count)]
        tasks = len(self.samples) * len(parts)
        within: Sequence[Closed | None] = [None] * len(self.samples)
        if not separations[-1] > 0.0:
            within = self.closed

        def solve(task: int) -> Array:
            sample, part = divmod(task, len(parts))
            return self.samples[sample].rows(parts[part], within[sample])

        def solved(done: int) -> None:
            self.observe(self._solved[0] + done * len(separations) // tasks)

        nearer = [self.first_touch - float(part.mean()) for part in parts]  # and so dearer
        found = shared(self.comm, tasks, solve, costs=nearer * len(self.samples), observe=solved)
        self._solved[0] += len(separations)
        return np.concatenate(found).reshape(len(self.samples), len(separations), 5)

    def _in_full_contact(
        self, rows: LawRows, pressure: float, closure: float, compliance: float
    ) -> LawRows:
        """Return the rows of a law with others in full contact, up to a limit."""
        last, least = rows[-1:], FULL_CONTACT * compliance
        full = float(last.pressure[0])
        pressure = min(pressure, full + (closure - float(last.closure[0])) / least)
        # rows need closures that rounding keeps apart
        resolved = _FULL_ROWS * _ROUNDING * float(last.approach[0])
        if not least * (pressure - full) > resolved:
            return rows
        more = np.linspace(0.0, pressure - full, _FULL_ROWS + 1)[1:]
        repeated = last.mapped(lambda column: np.repeat(column, _FULL_ROWS))
        beyond = replace(
            repeated,
            approach=last.approach + (least + compliance) * more,
            closure=last.closure + least * more,
            pressure=full + more,
            contact_area_fraction=np.ones(_FULL_ROWS),
            unresolved_displacement=last.unresolved_displacement + least * more,
        )
        return rows.joined(beyond)


class Closed(NamedTuple):
    """Where the law of a sample ends.

    Attributes:
        separation: The mean separation of the undeformed planes [mm].
        row: What the sample gives there, see `PeriodicSample.rows`.
    """

    separation: float
    row: Array


@dataclass(frozen=True, eq=False)
class PeriodicSample:
    """A sample that continues periodically on a half-space.

    Its displacements count from their mean, so that the mean separation is z_M less the mean height
    and the approach.

    Args:
        model: Its periodic model.
        error: Error of the pressures of rows that does no harm, over them.
    """

    model: HalfSpaceModel
    error: float = 0.0
    _starts: dict[float, Start] = field(default_factory=dict, init=False)

    @property
    def quick(self) -> bool:
        """Whether its rows take so little that one rank solves them all."""
        return self.model.quick_up_to(Control(approach=self.reference)) is not None

    @property
    def _rough_model(self) -> HalfSpaceModel:
        return replace(self.model, tolerance=max(self.model.tolerance, self.error))

    @property
    def area(self) -> float:
        """Nominal area [mm²]."""
        return self.model.surface.area

    @property
    def reference(self) -> float:
        """Separation at zero approach, z_M less the mean height [mm]."""
        return self.model.reference_height - self.model.surface.mean_height

    @property
    def first_touch(self) -> float:
        """Separation at first touch of a cell [mm]."""
        return self.reference - self.model.first_touch

    @property
    def yields(self) -> bool:
        """Whether its pressures are bounded by a hardness; then no load closes all gaps."""
        return self.model.hardness is not None

    @cached_property
    def closed(self) -> Closed:
        """Where the law of the sample ends.

        It is full contact, at a separation of 0. Under a hardness the plane is at the mean plane
        there. Of a sample with finite slopes the separation falls as long as the pressure rises
        until shortly before full contact, when it is a little below 0; its law ends where the
        compliance is a hundredth of the mean one.
        """
        model = self.model
        if self.yields:
            state = model.press(Control(approach=self.reference))
            return Closed(0.0, _row(state))
        if not model.slopes:
            return Closed(0.0, np.array([self._flattening_pressure(), 1.0, 1.0, 0.0, 0.0]))
        flat = PeriodicSample(replace(model, slopes=()))
        young = min(one.material.young_modulus for one in model.slopes)
        most = min(flat.closed.row[0], _MOST * young)
        least = FULL_CONTACT * self.first_touch / most
        states: dict[float, ContactState] = {}

        def above(pressure: float) -> float:
            """Return the separation, and what the law in full contact would take off it."""
            near = min(states, key=lambda known: abs(known - pressure), default=None)
            start = None if near is None else states[near].guess
            control = Control(force=pressure * self.area)
            states[pressure] = self._rough_model.press(control, start=start)
            return least * pressure - states[pressure].approach

        options = {"xatol": _PART * most}
        end = scipy.optimize.minimize_scalar(
            above, bounds=(0.0, most), method="bounded", options=options
        ).x
        return Closed(self.reference - states[end].approach, _row(states[end]))

    def _flattening_pressure(self) -> float:
        """Return the mean pressure that just closes a sample of small slopes [MPa].

        In full contact pressures differ from their mean by what flattens the sample, whatever the
        mean.
        """
        surface = self.model.surface
        slopes = np.gradient(surface.heights, *surface.spacing)
        pressure = self.model.contact_modulus * float(np.sqrt(np.mean(np.square(slopes))))
        while True:
            pressure *= 2.0
            cells = self.model.press(Control(force=pressure * self.area)).pressures
            if cells.min() > 0.0:
                return float(cells.mean() - cells.min())

    def separation_under(self, pressure: float) -> float:
        """Return the mean separation under a mean pressure [mm], no less than that of `closed`.

        Args:
            pressure: The mean pressure [MPa].
        """
        model = self.model
        if model.hardness is not None and pressure >= model.hardness:
            return 0.0
        if any(pressure >= _MOST * one.material.young_modulus for one in model.slopes):
            return self.closed.separation
        state = self._rough_model.press(Control(force=pressure * self.area))
        if not self.yields and state.pressures.min() > 0.0:  # what is left is rounding
            return self.closed.separation if model.slopes else 0.0
        nearly = bool(model.slopes) and state.contact_area_fraction > _NEARLY_FULL
        if nearly and pressure >= self.closed.row[0]:
            return self.closed.separation
        if self.quick:
            self._starts[state.approach] = state.guess
        separation = self.reference - state.approach
        return separation if model.slopes else max(separation, 0.0)

    def rows(self, separations: Array, closed: Closed | None) -> Array:
        """Return rows at separations, each solved from those next to it.

        Args:
            separations: Mean separations, falling, shape (m,) [mm].
            closed: Where its law ends; None where no separation is that small.

        Returns:
            Mean pressure [MPa], real over nominal contact area, number of contacts, whether the
            model warned that it is outside its range of validity, and mean plastic depth [mm],
            shape (m, 5).
        """
        end = -np.inf
        if closed is not None and not self.yields:
            end = closed.separation + _ROUNDING * self.reference
        solved = (separations > end) & (separations < self.first_touch)
        approaches = self.reference - separations[solved]
        states = press_along(self._rough_model, approaches, known=self._starts)
        if self.quick:
            self._starts.update((state.approach, state.guess) for state in states)
        found = np.zeros((len(separations), 5))
        found[solved] = np.reshape([_row(state) for state in states], (-1, 5))
        if closed is not None:
            found[separations <= end] = closed.row
        return found


def _row(state: ContactState) -> Array:
    """Return a row of `PeriodicSample.rows`."""
    fraction, outside = state.contact_area_fraction, bool(state.warning)
    yielded = 0.0 if state.plastic_depth is None else float(state.plastic_depth.mean())
    return np.array([state.mean_pressure, fraction, state.contacts, outside, yielded])
