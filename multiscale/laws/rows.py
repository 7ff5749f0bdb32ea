"""The rows of patch laws and transmissivities, and the path of the plane that laws were made on.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from patchlaw.geometry.spring_bed import never_falling
from patchlaw.support import Array, Counts, Flags, Indices, InputError

CAUSES = "grid", "rows", "samples"
"""Causes of the error of a transmissivity."""
_OF_ROWS = 3.0
"""Error by the rows over the change where every second one is left out: the larger of both ways."""
_NOISE = 1e-3
"""Fall of a closure, relative to the range of closures, that counts as noise."""

_APPROACH_TOLERANCE = 1e-15  # of an approach under a force, relative to the length of the path


@dataclass(frozen=True, kw_only=True, eq=False)
class LawRows:
    """Rows of one patch law, or rows of the laws of N patches at the same load steps.

    Every column has the shape (m,) for one law, or (m, N) for N laws. Its metadata are the unit
    and, where it is another one, the name in law files.

    Attributes:
        approach: Local rigid approach [mm]. Where the plane was free to turn it is the approach at
            the middle of the interface.
        closure: Local rigid approach minus the displacement of the patch in the macro model [mm].
        pressure: Mean pressure of the patch [MPa].
        contact_area_fraction: Real over nominal contact area of the patch.
        contacts: Number of contacts in the patch.
        unresolved_displacement: Mean displacement of the patch in the contact problem, less its
            displacement in the macro model [mm].
        pressure_scatter: Standard deviation of the pressure among the samples whose mean the law
            is, at the same closure [MPa]; zero of one sample.
        outside_range: Whether the micro model warned that it is outside its range of validity.

    Raises:
        InputError: When the columns have different shapes, or a number is not finite.
    """

    approach: Array = field(metadata={"unit": "mm"})
    closure: Array = field(metadata={"unit": "mm"})
    pressure: Array = field(metadata={"unit": "MPa"})
    contact_area_fraction: Array = field(metadata={"unit": "1"})
    contacts: Counts = field(metadata={"unit": "1", "kind": np.int64})
    unresolved_displacement: Array = field(metadata={"unit": "mm", "stored": "relief"})
    pressure_scatter: Array = field(
        default=None,  # type: ignore[arg-type]
        metadata={"unit": "MPa", "optional": True},
    )
    outside_range: Flags = field(
        default=None,  # type: ignore[arg-type]
        metadata={"kind": np.bool_},
    )

    def __post_init__(self) -> None:
        for one in fields(self):
            if getattr(self, one.name) is None:
                nothing = np.zeros(self.closure.shape, one.metadata.get("kind"))
                object.__setattr__(self, one.name, nothing)
        for name, column in self.columns():
            if column.shape != self.closure.shape:
                raise InputError("a patch law needs columns of one length", value=name)
            if not np.all(np.isfinite(column)):
                raise InputError(f"a patch law needs a finite {name}")

    def __len__(self) -> int:
        return len(self.approach)

    def __getitem__(self, index: Any) -> LawRows:
        return self.mapped(lambda column: column[index])

    def columns(self) -> list[tuple[str, NDArray[Any]]]:
        """Return the names and values of all columns."""
        return [(one.name, getattr(self, one.name)) for one in fields(self)]

    def mapped(self, function: Callable[[NDArray[Any]], NDArray[Any]]) -> LawRows:
        """Return rows whose columns are a function of the columns of these.

        Args:
            function: Takes and returns a column; all columns become the same shape.
        """
        return LawRows(**{name: function(column) for name, column in self.columns()})

    def joined(self, *later: LawRows) -> LawRows:
        """Return these rows followed by others.

        Args:
            later: Other rows, with as many laws beside each other.
        """
        every = [dict(one.columns()) for one in (self, *later)]
        return LawRows(**{name: np.concatenate([one[name] for one in every]) for name in every[0]})

    def with_rising_pressure(self) -> tuple[LawRows, float]:
        """Return rows of a patch alone whose pressure rises with the approach.

        A rigid plane that comes nearer to a patch alone cannot lose force: pressures that fall are
        an unevenness of a micro model or the noise of a measurement. They become the nearest rising
        sequence in least squares. The displacement behind a closure is scaled with its pressure.

        Returns:
            The rows, and the largest change relative to the largest pressure.

        Source:
            Barlow, Bartholomew, Bremner & Brunk 1972, Statistical inference under order
            restrictions, ch. 1 (pool adjacent violators).
        """
        before = self.pressure
        pressure = never_falling(before, 1.0)
        largest = float(before.max(initial=0.0)) or 1.0
        change = float(np.abs(pressure - before).max(initial=0.0)) / largest
        if change:
            scale = np.divide(pressure, before, out=np.ones(len(self)), where=before > 0.0)
            closure = self.approach - scale * (self.approach - self.closure)
            return replace(self, closure=closure, pressure=pressure), change
        return self, change

    def rising(self) -> tuple[LawRows, float]:
        """Return rows of a patch alone that rise, without those that then carry no information.

        Of rows of equal pressure the first is kept. A closure that falls for good is kept, because
        the patch's stiffness has outgrown that of its own half-space. One that lies a little below
        those before it is left out.

        Returns:
            The rows that are kept, and the largest change: of a pressure relative to the largest,
            or of a closure relative to the range.
        """
        rows, change = self.with_rising_pressure()
        closure, pressure = map(np.maximum.accumulate, (rows.closure, rows.pressure))
        fall, span = closure - rows.closure, float(np.ptp(rows.closure))
        noise = (fall > 0.0) & (fall < _NOISE * span)
        noise |= np.concatenate(([False], (np.diff(closure) == 0.0) & (fall[1:] == 0.0)))
        noise &= np.arange(len(rows)) < np.argmax(rows.closure)
        rising = np.concatenate(([True], pressure[1:] > pressure[:-1]))
        left_out = float(fall[noise].max(initial=0.0)) / (span or 1.0)
        return rows[rising & ~noise], max(change, left_out)

    @classmethod
    def none(cls) -> LawRows:
        """Return the rows of a patch that stays open."""
        return cls(**{one.name: np.zeros(0, one.metadata.get("kind")) for one in fields(cls)})

    @property
    def warning_pressure(self) -> float:
        """Pressure of the first row of one law outside the range [MPa]; infinite without any."""
        return float(np.append(self.pressure[self.outside_range], np.inf)[0])

    def untouched(self, law: int, own: LawRows) -> Untouched:
        """Return what displaces the patch of one of N laws before it is touched.

        Args:
            law: Index of the law.
            own: Its rows from first touch on; none of a patch that stays open.
        """
        count = int(np.argmax(np.append(self.pressure[:, law] > 0.0, True)))
        closures = np.append(self.closure[:count, law], own.closure[:1])
        displaced = self.unresolved_displacement[:count, law]
        displaced = np.append(displaced, own.unresolved_displacement[:1])
        # neighbours may take the surface away faster than the plane comes
        later = np.minimum.accumulate(closures[::-1])[::-1]
        kept = np.append(closures[:-1] < later[1:], True)
        return Untouched(closure=closures[kept], unresolved_displacement=displaced[kept])

    def from_first_touch(self) -> tuple[LawRows, Indices]:
        """Return the rows of N laws from first touch on, one law after another.

        First touch lies between the last open row and the first one in contact, at the approach
        where the straight line of p^(2/3) through the first two rows in contact vanishes (Hertz'
        law). Closure and displacement are interpolated between the open row and the first one in
        contact.

        Where contacts join, the displacement of a block may grow so fast that the local approach
        of a patch decreases while the plane comes nearer: such rows are left out.

        Returns:
            The rows, and how many each law has, shape (N,); none of a patch that stays open.
        """
        largest = np.maximum.accumulate(self.approach, axis=0)
        kept = np.ones(largest.shape, bool)
        kept[1:] = self.approach[1:] > largest[:-1]
        kept &= self.pressure.any(axis=0)  # most patches stay open
        rows, end = self.mapped(lambda column: column.T[kept.T]), np.cumsum(kept.sum(axis=0))
        law = np.repeat(np.arange(len(end)), kept.sum(axis=0))
        loaded = np.flatnonzero(rows.pressure > 0.0)
        touched, first = np.unique(law[loaded], return_index=True)
        contact = np.maximum(loaded[first], end[touched] - kept.sum(axis=0)[touched] + 1)
        before, later = contact - 1, np.minimum(contact + 1, end[touched] - 1)
        power = rows.pressure ** (2 / 3)
        rise = power[later] - power[contact]
        back = power[contact] * (rows.approach[later] - rows.approach[contact])
        step = (rows.approach[contact] - rows.approach[before]) * rise
        share = 1.0 - np.divide(back, step, out=np.ones_like(back), where=rise > 0.0)
        share = np.clip(share, 0.0, 0.99)

        def started(name: str, column: NDArray[Any]) -> NDArray[Any]:
            if name in ("approach", "closure", "unresolved_displacement"):
                start = column[before] + share * (column[contact] - column[before])
            else:
                start = column[before] if name == "outside_range" else 0
            column[before] = start
            return column

        rows = LawRows(**{name: started(name, column) for name, column in rows.columns()})
        start = np.full(len(end), len(rows))
        start[touched] = before
        used = np.arange(len(rows)) >= start[law]
        return rows[used], np.bincount(law[used], minlength=len(end))


@dataclass(frozen=True, kw_only=True, eq=False)
class Untouched:
    """What displaces a patch before it is touched, by the loads of other patches.

    Between rows it is interpolated linearly, before the first one it stays.

    Attributes:
        closure: Closures, rising, the last one at first touch where there is one, (m,) [mm].
        unresolved_displacement: Mean displacements of the patch in the contact problem, less its
            displacements in the macro model, shape (m,) [mm].

    Raises:
        InputError: When the columns do not fit each other, or the closure does not rise.
    """

    closure: Array = field(metadata={"unit": "mm"})
    unresolved_displacement: Array = field(metadata={"unit": "mm"})

    def __post_init__(self) -> None:
        columns = self.closure, self.unresolved_displacement
        if columns[0].shape != columns[1].shape or not np.isfinite(columns).all():
            raise InputError("an untouched patch needs finite columns of one length")
        if np.any(np.diff(self.closure) <= 0.0):
            raise InputError("an untouched patch needs a strictly increasing closure")

    def __len__(self) -> int:
        return len(self.closure)

    @classmethod
    def nothing(cls) -> Untouched:
        """Return that of a patch that nothing is known of."""
        return cls(closure=np.zeros(0), unresolved_displacement=np.zeros(0))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanePath:
    """How a plane that is free to turn, and so without moment, turns while it approaches.

    Attributes:
        approach: Approaches at the middle of the interface, increasing, shape (m,) [mm].
        tilt: Slopes along x and y there, shape (m, 2).
        force: Forces, increasing from none at first touch, shape (m,) [N].
        moment: First moments of the contacts' forces: zero within the tolerance of the micro
            model, shape (m, 2) [N mm].

    Raises:
        InputError: When the columns do not fit each other, or the approach does not increase.
    """

    approach: Array = field(metadata={"unit": "mm"})
    tilt: Array = field(metadata={"unit": "1"})
    force: Array = field(metadata={"unit": "N"})
    moment: Array = field(metadata={"unit": "N mm"})

    def __post_init__(self) -> None:
        count = len(self.approach)
        shapes = {"approach": (count,), "tilt": (count, 2), "force": (count,), "moment": (count, 2)}
        _check(self, "a path", shapes)
        if np.any(np.diff(self.approach) <= 0.0):
            raise InputError("a path needs a strictly increasing approach")

    def at(self, approach: float) -> Array:
        """Return slopes and moments at an approach, shape (4,); beyond both ends those of the end.

        Args:
            approach: The approach at the middle [mm].
        """
        if len(self.approach) == 1:
            return np.append(self.tilt, self.moment)
        return np.asarray(self._curves(np.clip(approach, self.approach[0], self.approach[-1])))

    def shifted(self, distance: float) -> PlanePath:
        """Return the path with approaches counted from a plane that is higher.

        Args:
            distance: How much higher it is [mm].
        """
        return replace(self, approach=self.approach + distance)

    def mixed(self, other: PlanePath, share: float) -> PlanePath:
        """Return a path on the way to another, linear at equal approaches.

        Args:
            other: The other path.
            share: How much of it, from 0 to 1.
        """
        every = np.union1d(self.approach, other.approach)
        every = every[every <= min(self.approach[-1], other.approach[-1])]
        (here, bears), (there, load) = (
            (np.array([path.at(one) for one in every]), np.interp(every, path.approach, path.force))
            for path in (self, other)
        )
        turns = (1.0 - share) * here + share * there
        force = (1.0 - share) * bears + share * load
        return PlanePath(approach=every, tilt=turns[:, :2], force=force, moment=turns[:, 2:])

    def turning(self, approach: float) -> Array:
        """Return what the slopes change by with the approach, shape (2,) [1/mm].

        Args:
            approach: The approach at the middle; beyond the ends the slopes stay [mm].
        """
        if not self.approach[0] < approach <= self.approach[-1]:
            return np.zeros(2)
        return np.asarray(self._curves(approach, 1)[:2])

    @cached_property
    def _curves(self) -> Any:
        values = np.column_stack((self.tilt, self.moment))
        return scipy.interpolate.PchipInterpolator(self.approach, values)

    def approach_under(self, force: float, force_at: Callable[[float], float]) -> tuple[float, int]:
        """Return the approach under a force [mm], and the number of evaluations of the force.

        Args:
            force: The force; zero is that of first touch [N].
            force_at: Returns the force at an approach, with which it increases [N].
        """
        first, last = float(self.approach[0]), float(self.approach[-1])
        if force == 0.0:
            return first, 0
        largest = force_at(last)
        if largest < force:  # beyond the path: continue its last secant
            slope = (largest - force_at(0.5 * (first + last))) / (0.5 * (last - first) or 1.0)
            return last + (force - largest) / (slope or 1.0), 2
        found, report = scipy.optimize.brentq(
            # powers of 2/3 are nearly straight over the approach (Hertz)
            lambda approach: force_at(approach) ** (2 / 3) - force ** (2 / 3),
            first,
            last,
            xtol=_APPROACH_TOLERANCE * (last - first),
            full_output=True,
        )
        return float(found), report.function_calls + 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmissivity:
    """Transmissivity T along x and y over the mean separation.

    Between rows the hydraulic gap T^(1/3) is interpolated monotonically (PCHIP). Over the largest
    of the table, it is closed where gaps of cells count as closed. Beyond the last row it grows as
    the separation, and below the first one it stays.

    Attributes:
        separation: Mean separations, rising, shape (m,) [mm].
        hydraulic_gap: T^(1/3) along x and y, 0 where closed, shape (m, 2) [mm].
        on_half: The same as far off as grids of half and a quarter as many cells a side tell, shape
            (m, 2) [mm].
        scatter: What T grows by as its hydraulic gap grows by the standard deviation of that among
            the samples of a law at the same mean pressure, shape (m, 2) [mm³]; 0 of one.

    Raises:
        InputError: When the columns do not fit each other, or separations do not rise.
    """

    separation: Array = field(metadata={"unit": "mm"})
    hydraulic_gap: Array = field(metadata={"unit": "mm", "axes": "xy"})
    on_half: Array = field(metadata={"unit": "mm", "axes": "xy"})
    scatter: Array = field(metadata={"unit": "mm^3", "axes": "xy"})

    def __post_init__(self) -> None:
        two = len(self.separation), 2
        shapes = {"separation": two[:1], "hydraulic_gap": two, "on_half": two, "scatter": two}
        _check(self, "a transmissivity", shapes)
        if (name := next((n for n in shapes if (getattr(self, n) < 0.0).any()), None)) is not None:
            raise InputError(f"a transmissivity needs a {name} ≥ 0")
        if (np.diff(self.separation) <= 0.0).any():
            raise InputError("a transmissivity needs separations that rise")

    def at(self, separation: Array) -> Array:
        """Return the transmissivities along x and y at mean separations, shape (n, 2) [mm³].

        Args:
            separation: Mean separations, shape (n,) [mm].
        """
        return self._interpolated(separation, self.separation, self.hydraulic_gap)

    def varied(self, cause: str | None, separation: Array, samples: float = 0.0) -> Array:
        """Return the transmissivities with one cause of error varied, shape (n, 2) [mm³].

        Args:
            cause: One of `CAUSES`: the grid; rows left out; what the mean of the samples
                may be too low by. None varies nothing.
            separation: Mean separations, shape (n,) [mm].
            samples: Error of the mean of samples over the standard deviation among them.
        """
        if cause is None:
            return self.at(separation)
        if cause == "grid":
            return self._interpolated(separation, self.separation, self.on_half)
        if cause == "samples":
            within = np.clip(separation, *self.separation[[0, -1]])
            scatter = self._interpolated(within, self.separation, np.cbrt(self.scatter))
            flow = self.at(within)
            wider = np.cbrt(flow + scatter) - np.cbrt(flow)
            return np.asarray((np.cbrt(self.at(separation)) + samples * wider) ** 3)
        whole, changes = self.at(separation), []
        closed = int((self.hydraulic_gap.max(axis=1) == 0.0).sum())
        for first in (1, 2):  # beginning next to closing
            kept = np.ones(len(self.separation), bool)
            kept[max(closed - 1, 0) + first : -1 : 2] = False
            rows = self.separation[kept], self.hydraulic_gap[kept]
            changes.append(np.abs(self._interpolated(separation, *rows) - whole))
        return np.asarray(whole + _OF_ROWS * np.maximum(*changes))

    @staticmethod
    def _interpolated(separation: Array, rows: Array, gaps: Array) -> Array:
        from patchlaw.micro.transport import open_gaps  # laws without a leak do without

        first, last = rows[[0, -1]]
        within, beyond = np.clip(separation, first, last), np.maximum(separation - last, 0.0)
        if len(rows) == 1:
            return np.asarray((gaps + beyond[:, None]) ** 3)
        gap: Any = scipy.interpolate.PchipInterpolator(rows, gaps)(within)
        return np.asarray((open_gaps(gap, gaps.max()) + beyond[:, None]) ** 3)


def _check(record: Any, name: str, shapes: dict[str, tuple[int, ...]]) -> None:
    """Refuse columns that are empty, not finite, or have other shapes."""
    for column, shape in shapes.items():
        values = getattr(record, column)
        if not len(values) or values.shape != shape or not np.all(np.isfinite(values)):
            raise InputError(
                f"{name} needs a finite {column}", value=values.shape, allowed=f"{shape}"
            )
