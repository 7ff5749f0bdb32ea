"""The mean law of periodic samples of a rough face, at equal separations of their mean planes.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from patchlaw.multiscale.laws.interpolation import rising_curves
from patchlaw.multiscale.laws.of_samples import FULL_CONTACT, Closed, PeriodicSample, SampleRow
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import refined
from patchlaw.multiscale.laws.rows import LawRows as SolvedRows
from patchlaw.support.arrays import Array
from patchlaw.support.parallel import shared

T = TypeVar("T", float, NDArray[np.float64])

_ROWS_TOGETHER = 2
"""Rows of a sample that one rank solves in sequence, each starting from the one before, so that
results do not depend on the number of ranks."""

_CLOSE = 0.01  # of its way: further than needed that the last row may lie
_ROUNDING = 1e-12  # of a closure, from counting it from another height and back
_FULL_ROWS = 4  # of a law that goes on in full contact


class Limit(NamedTuple):
    """How far a law is tabulated: to the first of the two that is reached.

    Attributes:
        pressure: Largest mean pressure [MPa].
        closure: Largest closure [mm].
    """

    pressure: float = np.inf
    closure: float = np.inf


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
    observe: Callable[[int], None] | None = None
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
        self, limit: Limit, tolerance: float, most_rows: int, before: PatchLaw | None = None
    ) -> PatchLaw:
        """Tabulate the mean law of the samples up to a limit; collective.

        Args:
            limit: Where it ends.
            tolerance: Interpolation error of the pressure.
            most_rows: Rows that are solved at most, for each sample.
            before: A law of the same samples, whose rows are kept; others are added beyond them.
        """
        touch = max(self.reference - self.first_touch, 0.0)
        area = sum(sample.area for sample in self.samples)
        if limit.closure <= touch:
            return PatchLaw.of(SolvedRows.none(), touch, self.reference, sample_area=area)
        end, start, kept = self.end(limit), 0.0, SolvedRows.none()
        if before is not None and not before.is_open:
            kept = self._without_full_contact(before)
            start = self._parameter(self._within(self.reference - float(kept.closure[-1])))
            compliance = float((kept.approach[-1] - kept.closure[-1]) / kept.pressure[-1])
        else:
            last = self.rows(np.array([end]), 0.0)[:, 0]
            compliance = float((last.closure[0] - touch) / last.pressure[0])

        made = refined(
            lambda parameters: self.rows(parameters, compliance),
            rising_curves,
            start,
            end,
            compliance=np.array([[compliance]]),
            tolerance=tolerance,
            most_rows=most_rows,
        )
        new = made.rows[:, 0]
        rising, change = (kept.joined(new[1:]) if len(kept) else new).rising()
        ends = not self._separation(max(start, end)) > 0.0 and max(start, end) == self._last
        if ends and not any(sample.yields for sample in self.samples):
            rising = self._in_full_contact(rising, limit, compliance)
        more = made.of_law(0) | {"repaired": change, "sample_area": area}
        if before is not None:
            more["interpolation_error"] = max(
                more["interpolation_error"], before.interpolation_error
            )
        return PatchLaw.of(rising, touch, self.reference, **more)

    def _without_full_contact(self, law: PatchLaw) -> SolvedRows:
        """Return the rows of a law of these samples that were solved, on their own reference."""
        rows = law.shifted(self.reference - law.initial_separation).rows
        # beyond the last one the rows of full contact follow, which go on straight
        last = self.reference - self._within(self.reference - float(rows.closure[-1]))
        rows = rows[rows.closure <= last + self.reference * _ROUNDING]
        outside = {"outside_range": rows.pressure >= law.warning_pressure}
        return SolvedRows(**dict(rows.columns()) | outside)

    def end(self, limit: Limit) -> float:
        """Return the parameter of the last row, in full contact at most; collective.

        Args:
            limit: What that row reaches.
        """
        by_closure = self._parameter(self._within(self.reference - limit.closure))
        if not np.isfinite(limit.pressure):
            return by_closure
        samples, pressure = self.samples, limit.pressure
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

    @property
    def _last(self) -> float:
        """The parameter of the least separation; collective."""
        return self._parameter(self.nearest)

    def _parameter(self, separation: float) -> float:
        root = float(np.sqrt(abs(separation) / self.first_touch))
        return 1.0 - root if separation > 0.0 else 1.0 + root

    def _separation(self, parameter: T) -> T:
        return self.first_touch * ((1.0 - parameter) * abs(1.0 - parameter))

    def rows(self, parameters: Array, compliance: float) -> SolvedRows:
        """Return rows of the mean law, columns of shape (m, 1); collective.

        Args:
            parameters: Values of t, increasing, shape (m,).
            compliance: Λ of the rows' approach, s = c + Λ p [mm/MPa].
        """
        separations = self._separation(parameters)
        found = self._solve(separations)
        shares = self.shares

        def mean(name: str) -> Array:
            return np.array([[getattr(row, name) for row in rows] for rows in found]).T @ shares

        pressure = mean("pressure")
        scatter = np.zeros(len(pressure))
        if len(self.samples) > 1:
            each = np.array([[row.pressure for row in rows] for rows in found])
            variance = shares @ (each - pressure) ** 2 / (1.0 - shares @ shares)
            scatter = np.sqrt(variance)
        closure = self.reference - separations
        columns = SolvedRows(
            approach=closure + compliance * pressure,
            closure=closure,
            pressure=pressure,
            contact_area_fraction=mean("contact_area_fraction"),
            contacts=np.sum([[row.contacts for row in rows] for rows in found], axis=0),
            unresolved_displacement=np.maximum(-separations, 0.0),  # of what has no gap left
            pressure_scatter=scatter,
            outside_range=np.any([[row.outside_range for row in rows] for rows in found], axis=0),
        )
        return columns[:, None]

    def _solve(self, separations: Array) -> list[list[SampleRow]]:
        """Return the rows of all samples at separations that fall, shared by the ranks."""
        quick = all(sample.quick for sample in self.samples)
        count = len(separations) if quick else _ROWS_TOGETHER
        parts = [separations[k : k + count] for k in range(0, len(separations), count)]
        tasks = len(self.samples) * len(parts)
        within: Sequence[Closed | None] = [None] * len(self.samples)
        if not separations[-1] > 0.0:
            within = self.closed

        def solve(task: int) -> list[SampleRow]:
            sample, part = divmod(task, len(parts))
            return self.samples[sample].rows(parts[part], within[sample])

        def solved(done: int) -> None:
            if self.observe is not None:
                self.observe(self._solved[0] + done * len(separations) // tasks)

        nearer = [self.first_touch - float(part.mean()) for part in parts]  # and so dearer
        found = shared(self.comm, tasks, solve, costs=nearer * len(self.samples), observe=solved)
        self._solved[0] += len(separations)
        each = len(parts)
        return [
            [row for rows in found[k * each : (k + 1) * each] for row in rows]
            for k in range(len(self.samples))
        ]

    def _in_full_contact(self, rows: SolvedRows, limit: Limit, compliance: float) -> SolvedRows:
        """Return the rows of a law with others in full contact, up to a limit."""
        last, least = rows[-1:], FULL_CONTACT * compliance
        full = float(last.pressure[0])
        pressure = min(limit.pressure, full + (limit.closure - float(last.closure[0])) / least)
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
