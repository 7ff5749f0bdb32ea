"""Laws of surfaces that have worn, as their roughness runs in.

Laws of a face lie between those of surfaces that have worn by some depths. The state of the
roughness under a point is the depth W that has worn off there, volume per area. Surfaces that wore
to the same depth under pressures of 1 to 4 have nearly the same law, and those that slid the same
distance do not (docs/wear.md). A law is a function of c − W, the closure of what is left, and
changes its shape with W, fast at first and ever more slowly. Between two depths its closure at
equal pressure, as curves that are steep lie beside each other, is linear in log W, and in W up to
the first; beyond the last it stays. Patches of one surface, which share their load, wear with the
distance that all of it has slid; their laws are taken along the path of the plane.

Theory: docs/theory.md, sections 10 and 18.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
import scipy

from patchlaw.multiscale.laws.interpolation import LawPoint, root_within
from patchlaw.multiscale.laws.patch_law import ROUNDING, PatchLaw, PatchLaws
from patchlaw.multiscale.laws.rows import LawRows, PlanePath
from patchlaw.support import Array, Indices, InputError

_STEEPEST = 0.1
"""Slope of the closure over q where a law begins and ends, over that of its piece, at least."""


class RunningInLaws:
    """N laws that depend on the depth that has worn off: a `ContactLaws` of `macro`.

    All are known over q = p^(2/3), from 0 on, at all depths on one grid of q.

    Args:
        levels: The N laws at every one of L depths.
        depths: These depths, rising from 0, shape (L, N) [mm].

    Attributes:
        laws: The laws of the new surfaces, whose springs rub. Springs are those at equal pressure.
        new: The same laws, evaluated together.
    """

    def __init__(self, levels: Sequence[Sequence[PatchLaw]], depths: Array) -> None:
        self.laws, self.new = tuple(levels[0]), PatchLaws(levels[0])
        self._depths = depths
        known = [_curves_through(laws) for laws in zip(*levels, strict=True)]
        self._touched = np.array([len(one) > 0 for one in known])
        self._separations = np.array([law.initial_separation for law in levels[0]])
        self._flows = [[law.transmissivity for law in laws] for laws in levels]
        self._row = np.cumsum(self._touched) - 1
        curves = [curve for one in known for curve in one]
        grid = reduce(np.union1d, [curve.x for curve in curves], np.empty(0))
        # tables end alike
        self._grid = grid[np.append(np.diff(grid) > ROUNDING * grid[1:], True)[: len(grid)]]
        found = np.array([_tabulated(curve, self._grid) for curve in curves])
        shape = int(self._touched.sum()), len(levels)  # N' and L
        found = found.reshape(*shape, 2, 4, len(self._grid))
        self._values, self._slopes = found.transpose(2, 3, 1, 0, 4)  # (4, L, N', G)
        ends = np.array([curve(curve.x[-1])[0] for curve in curves])
        self._ends = ends.reshape(*shape, 1).swapaxes(0, 1)  # (L, N', 1)

    def __len__(self) -> int:
        return len(self._touched)

    def at(self, patch: Indices, closure: Array, depth: Array, *, extend: bool = False) -> LawPoint:
        """Return what the laws give; derivatives are those by the closure, whose own is 1.

        Args:
            patch: Patches, shape (n,).
            closure: Closures of what is left there, shape (n,) [mm].
            depth: Worn depths, shape (n,) [mm].
            extend: Whether to continue along the tangents beyond the tables instead of raising.

        Raises:
            InputError: When a closure lies beyond the range of its law and `extend` is false.
        """
        *values, contacts, _ = self._at(patch, closure, depth, extend=extend)
        return LawPoint._make([*values, np.rint(contacts).astype(np.int64)])

    def _at(self, patch: Indices, closure: Array, depth: Array, *, extend: bool) -> Array:
        """Return the fields of `LawPoint`, and what the pressure changes by with the depth."""
        one, none = np.ones_like(closure), np.zeros_like(closure)
        gap = self._separations[patch] - closure
        found = np.array([closure, none, one, none, none, gap, -one, none, none])
        at = np.flatnonzero(self._touched[patch])
        if len(at):
            between = _between(self._depths[:, patch[at]], depth[at], self._row[patch[at]])
            if not extend:
                self._check(closure[at], between)
            found[:, at] = self._of_touched(closure[at], between)
        return found

    def at_pressures(
        self, patch: Indices, pressure: Array, depth: Array | float
    ) -> tuple[Array, Array]:
        """Return closures of what is left, (n,) [mm], and stiffnesses there, (n,) [MPa/mm].

        Args:
            patch: Patches, shape (n,).
            pressure: Pressures there, shape (n,) [MPa].
            depth: Worn depths, shape (n,) [mm].
        """
        found = np.stack([self._separations[patch], np.zeros_like(pressure)])
        if len(at := np.flatnonzero(self._touched[patch])):
            deep = np.broadcast_to(depth, pressure.shape)[at]
            between = _between(self._depths[:, patch[at]], deep, self._row[patch[at]])
            q = np.maximum(pressure[at], 0.0) ** (2 / 3)
            piece = np.searchsorted(self._grid[1:-1], q, side="right")
            start, width, closures = self._pieces(between, piece, 0)
            value, slope = _hermite((q - start) / width, *closures)
            found[:, at] = value, 1.5 * np.sqrt(q) * width / np.maximum(slope, 1e-300)
        return found[0], found[1]

    def interface_stiffness(self, point: LawPoint, patch: Indices | None = None) -> Array:
        """Return −dp/dū at points of the laws, (n,), dp/dc near full contact [MPa/mm]."""
        closes = -point.dseparation
        return np.asarray(point.dpressure / np.where(closes > 0.5, closes, 1.0))

    def leak(
        self,
        index: int,
        separation: Array,
        depth: Array,
        cause: str | None = None,
        samples: float = 0.0,
    ) -> Array:
        """Return the transmissivities of a law, shape (n, 2) [mm³], with one cause of error varied.

        Hydraulic gaps lie between those of two depths as closures do.

        Args:
            index: Number of the law.
            separation: Mean separations, shape (n,) [mm].
            depth: Worn depths, shape (n,) [mm].
            cause: As for `Transmissivity.varied`.
            samples: As for `Transmissivity.varied`.

        Raises:
            InputError: When the law knows none.
        """
        flows = [flow for laws in self._flows if (flow := laws[index]) is not None]
        if len(flows) < len(self._flows):
            raise InputError("the law has no transmissivity", allowed="a law made with leak = True")
        gaps = np.cbrt([flow.varied(cause, separation, samples) for flow in flows])
        every = np.arange(len(depth))
        level, share, *_ = _between(self._depths[:, [index]], depth, every)
        low, high = gaps[level, every], gaps[level + 1, every]
        return np.asarray((low + share[:, None] * (high - low)) ** 3)

    def transmissivities(
        self, patch: Indices, closure: Array, depth: Array, places: Array | None = None
    ) -> Array:
        """Return the transmissivities along x and y at closures, as `PatchLaw` does, (n, 2) [mm³].

        Args:
            patch: Patches, shape (n,).
            closure: Closures of what is left there, shape (n,) [mm].
            depth: Worn depths, shape (n,) [mm].
            places: Places on the face, of which these laws take no notice.
        """
        found = np.zeros((len(closure), 2))
        separation = self.at(patch, closure, depth, extend=True).separation
        for index in np.unique(patch):
            at = patch == index
            found[at] = self.leak(int(index), separation[at], depth[at])
        return found

    def pressures(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return the pressures, with tangents beyond the tables, see `ContactLaws.pressures`."""
        return self.rates(patch, closure, depth)[0]

    def stiffnesses(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return their derivatives by the closure, see `ContactLaws.stiffnesses`."""
        return self.rates(patch, closure, depth)[1]

    def rates(self, patch: Indices, closure: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Return pressures, derivatives, and what wear lessens them by; see `ContactLaws.rates`."""
        found = self._at(patch, closure, depth, extend=True)
        return found[1], found[3], np.maximum(found[3] - found[-1], 0.0)

    def know(self, name: str) -> bool:
        """Tell whether the laws have an attribute, see `SingleLaws.know`: all that laws have."""
        return True

    def read_off(self, name: str, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return a field of `LawPoint`, on tangents beyond the tables, shape (n,)."""
        return np.asarray(getattr(self.at(patch, closure, depth, extend=True), name))

    def check_range(self, patch: Indices, closure: Array, depth: Array) -> None:
        """Refuse closures beyond the tables; see `at`."""
        self.at(patch, closure, depth)

    def _check(self, closure: Array, between: Between) -> None:
        """Refuse closures beyond the end of the law."""
        ends = _blended(self._ends, between, np.zeros(len(closure), np.intp))
        beyond = closure > ends + ROUNDING * np.abs(ends)
        if beyond.any():
            worst = int(np.argmax(closure - ends))
            raise InputError(
                "closure beyond the end of the law of a worn face",
                value=float(closure[worst]),
                allowed=f"closure up to {ends[worst]:.6g} mm",
            )

    def _pieces(
        self, between: Between, piece: Indices, which: Any = slice(None)
    ) -> tuple[Any, ...]:
        """Return where pieces of the grid start, their widths, and the cubics of columns there."""
        both = piece, piece + 1
        start, end = (self._grid[at] for at in both)
        width, columns = end - start, (self._values[which], self._slopes[which])
        values, slopes = ([_blended(one, between, at) for at in both] for one in columns)
        return start, width, values + [width * one for one in slopes]

    def _of_touched(self, closure: Array, between: Between) -> Array:
        """Return the fields of `LawPoint`, and the derivative of the pressure by the depth.

        Args:
            closure: Closures of what is left, shape (n,) [mm].
            between: Where depths lie between the levels.
        """
        level, _, rate, row = between
        last, low = len(self._grid) - 1, np.zeros(len(closure), np.intp)
        high = np.full(len(closure), last)
        for _ in range(last.bit_length() + 1):
            middle = (low + high) // 2
            below = _blended(self._values[0], between, middle) <= closure
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        piece = np.minimum(low, last - 1)
        start, width, cubics = self._pieces(between, piece)
        t = _inverted(closure, *(one[0] for one in cubics))
        value, slope = _hermite(t, *cubics)
        slope = slope / width
        q = start + t * width
        touched = q > 0.0
        pressure = np.where(touched, q, 0.0) ** 1.5
        stiffness = 1.5 * np.sqrt(np.where(touched, q, 0.0)) / np.maximum(slope[0], 1e-300)
        levels = ((level, np.full_like(t, up), rate, row) for up in (0.0, 1.0))
        steps = [_hermite(t, *self._pieces(one, piece, 0)[2])[0] for one in levels]
        by_depth = -rate * (steps[1] - steps[0]) * stiffness
        per_closure = np.where(touched, slope[2] / np.maximum(slope[0], 1e-300), -1.0)
        gap = np.where(touched, value[2], cubics[0][2] + cubics[0][0] - closure)
        area, contacts = (np.where(touched, value[k], 0.0) for k in (1, 3))
        area = np.clip(area, 0.0, 1.0)  # tangents beyond the tables may leave it
        one = np.ones_like(closure)
        return np.array(
            [closure, pressure, one, stiffness, area, gap, per_closure, contacts, by_depth]
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WornLaws:
    """The laws of an interface that has worn, as functions of the closure of what is left.

    Attributes:
        depth: Depths that have worn off, volume per area of every patch or region, (N,) [mm].
        laws: One law for each, whose closures are less by these depths.
        slid: Distance that the whole surface has slid by then [mm], which laws of patches depend
            on; None of those that depend on the depth.
        path: The planes that pressed the whole surface; None where laws are those of samples.
    """

    depth: Array
    laws: tuple[PatchLaw, ...]
    slid: float | None = None
    path: PlanePath | None = None

    @property
    def planes(self) -> PlanePath:
        """The planes that pressed the whole surface."""
        assert self.path is not None, "laws of whole surfaces have paths"
        return self.path

    @property
    def end(self) -> float:
        """The largest approach that laws were made for [mm]."""
        return float(self.planes.approach[-1])


Level = tuple[WornLaws, PatchLaws]
"""What a surface has become by a distance, and its laws together."""


class SlidLaws:
    """Laws along the path of the plane that they were made under, of a surface that has slid.

    A patch that touches late, or whose neighbours take over its load, does not tell by its own
    depth how they have worn. Laws and path are therefore those of the distance that the surface has
    slid as a whole. Between two distances they are linear in the worn volume, at approaches equally
    far from those of the largest load. The volume is cubic in the distance, with the rates of wear
    at both ends: at a held approach it grows by less and less.

    Args:
        levels: What the surface has become by these distances, the new one first.
        slid: The distance [mm].
        lean: Local approaches of the patches less that of the middle, (N,) [mm]; zero where a free
            plane presses, as rows then know the middle alone.
        rate: Returns the mean depth that wears off per distance slid; None where it is the same at
            both distances.

    Attributes:
        worn: Depths that have worn off the patches, shape (N,) [mm].
        path: How the plane turns.
    """

    def __init__(
        self,
        levels: Sequence[Level],
        slid: float,
        lean: Array | float = 0.0,
        rate: Callable[[SlidLaws], float] | None = None,
    ) -> None:
        distances = [one.slid or 0.0 for one, _ in levels]
        place = float(np.interp(slid, distances, np.arange(len(distances))))
        below, share = int(place), place % 1.0
        if share and rate is not None:
            ends = [SlidLaws([levels[one]], distances[one], lean) for one in (below, below + 1)]
            share = worn_share(share, float(np.diff(distances)[below]), ends, rate)
        parts = [(1.0 - share, *levels[below]), *((share, *one) for one in levels[below + 1 :])]
        self._parts, self.slid, self._lean = parts[: 1 + (share > 0.0)], slid, lean
        self.worn: Array = np.sum([part * one.depth for part, one, _ in self._parts], axis=0)
        self._end = float(sum(part * one.end for part, one, _ in self._parts))
        path, *further = (one.planes.shifted(-one.end) for _, one, _ in self._parts)
        self.path = (path.mixed(further[0], share) if further else path).shifted(self._end)

    def along(self, approach: float) -> LawPoint:
        """Return what the laws give at an approach."""
        return self._mixed(lambda one, laws: self._along(one, laws, approach))

    def untouched(self, closure: Array) -> LawPoint:
        """Return what the laws give at closures, (N,) [mm], up to first touch."""
        return self._mixed(lambda _, laws: _untouched(laws, closure))

    def interface_stiffness(self, approach: float) -> Array:
        """Return −dp/dū of the patches at an approach, shape (N,) [MPa/mm]."""
        each = (
            part * laws.interface_stiffness(self._along(one, laws, approach))
            for part, one, laws in self._parts
        )
        return np.sum(list(each), axis=0)

    def transmissivities(
        self, approach: float, closure: Array, cause: str | None = None, wider: float = 0.0
    ) -> Array:
        """Return the transmissivities along x and y, shape (N, 2) [mm³].

        Hydraulic gaps are linear between those of two distances.

        Args:
            approach: The approach [mm].
            closure: Closures of what is left, which patches without load have gaps by, (N,) [mm].
            cause: Cause of error that is varied, as for `Transmissivity.varied`.
            wider: What is added to the mean gaps [mm].
        """
        gaps: Any = 0.0
        for part, one, laws in self._parts:
            point = self._along(one, laws, approach)
            free = _untouched(laws, closure).separation
            separation = np.where(point.pressure > 0.0, point.separation, free) + wider
            gaps = gaps + part * np.cbrt(laws.transmissivities(separation, cause))
        return np.asarray(gaps**3)

    def _along(self, one: WornLaws, laws: PatchLaws, approach: float) -> LawPoint:
        """Return what laws of one distance give, equally far from the end of their rows."""
        return laws.along(approach - self._end + one.end + self._lean - one.depth)

    def _mixed(self, evaluate: Callable[[WornLaws, PatchLaws], LawPoint]) -> LawPoint:
        found = ((part, evaluate(one, laws)) for part, one, laws in self._parts)
        points = ([part * field for field in point] for part, point in found)
        return LawPoint._make(np.sum(fields, axis=0) for fields in zip(*points, strict=True))


def _untouched(laws: PatchLaws, closure: Array) -> LawPoint:
    """Return what laws give at closures, (N,) [mm], up to first touch."""
    return laws.at(np.arange(len(closure)), np.minimum(closure, laws.first_touch))


def worn_share(
    share: float, way: float, ends: Sequence[SlidLaws], rate: Callable[[SlidLaws], float]
) -> float:
    """Return the part of the volume worn between two distances by a part of the way [mm].

    It is Hermite's cubic, with slopes within thrice the mean so that it rises (Fritsch & Carlson
    1980, doi:10.1137/0717021).
    """
    wears = float(ends[1].worn.mean() - ends[0].worn.mean())
    if not wears > 0.0:
        return share
    first, last = (min(rate(one) * way / wears, 3.0) for one in ends)
    return share * (first + share * (3.0 - 2.0 * first - last + share * (first + last - 2.0)))


Between = tuple[Indices, Array, Array, Indices]
"""Level below, share of the way to the next, its change with the depth [1/mm], law; (n,) each."""


def _between(levels: Array, depth: Array, law: Indices) -> Between:
    """Return where depths lie between levels, which rise from 0, shape (L, n) or (L, 1) [mm].

    Shares of the way are in logarithms, as levels double, but for the first.
    """
    level = np.clip((levels <= depth).sum(axis=0) - 1, 0, len(levels) - 2)
    low, high = np.take_along_axis(levels, np.array([level, level + 1]), axis=0)
    inside, first = depth < high, levels[1]
    start, part, end = (
        np.minimum(one / first - 1.0, np.log(np.maximum(one / first, 1.0)))
        for one in (low, depth, high)
    )
    width = np.where(inside, end - start, 1.0)
    share = np.where(inside, (part - start) / width, 1.0)
    return level, share, inside / (width * np.maximum(first, depth)), law


def _curves_through(laws: Sequence[PatchLaw]) -> list[Any]:
    """Interpolate closure, area, mean gap and contacts of a law over q, at all depths (PCHIP).

    At depths at which a patch stays open it has the law of the nearest one at which it does not,
    from where its plane comes no further. There are none where it stays open at all.
    """
    known = [_rows_of(law) for law in laws]
    touched = [level for level, rows in enumerate(known) if len(rows) > 1]
    curves = []
    for level, law in enumerate(laws if touched else ()):
        nearest = min(touched, key=lambda one: abs(one - level))
        rows, moved = known[nearest], law.first_touch - known[nearest].closure[0]
        closure = rows.closure + (0.0 if nearest == level else moved)
        q, once = np.unique(rows.pressure ** (2 / 3), return_index=True)
        gap = law.initial_separation - closure + rows.unresolved_displacement
        columns = closure, rows.contact_area_fraction, gap, rows.contacts
        rows_at = np.array(columns, float)[:, once]
        curves.append(scipy.interpolate.PchipInterpolator(q, rows_at, axis=1))
    return curves


def _rows_of(law: PatchLaw) -> LawRows:
    """Return the rows of a law whose pressures and closures rise."""
    if law.is_open:
        return law.rows
    rising = replace(law, rows=law.rows.rising()[0])
    return rising.rows[: rising.rising_rows]


def _tabulated(curve: Any, grid: Array) -> tuple[Array, Array]:
    """Return columns and their slopes on a grid, straight beyond the end, (4, G) each.

    Limiters may end closures flat.
    """
    inside = np.minimum(grid, curve.x[-1])
    values, slopes = curve(inside), curve(inside, 1)
    for at, side in ((curve.x[0], curve.x[:2]), (curve.x[-1], curve.x[-2:])):
        secant = float(np.diff(curve(side)[0])[0] / np.diff(side)[0])
        steep = np.maximum(slopes[0], _STEEPEST * secant)
        slopes[0] = np.where(inside == at, steep, slopes[0])
    return values + slopes * (grid - inside), slopes


def _blended(values: Array, between: Between, at: Indices) -> Array:
    """Return values of shape (…, L, N', G) at depths between levels and places of the grid."""
    level, share, _, law = between
    low, high = values[..., level, law, at], values[..., level + 1, law, at]
    return np.asarray((1.0 - share) * low + share * high)


def _hermite(t: Array, a: Array, b: Array, da: Array, db: Array) -> tuple[Array, Array]:
    """Return cubics by their ends and tangents, and their slopes; straight beyond the ends."""
    within = np.clip(t, 0.0, 1.0)
    bend = 2.0 * (a - b) + da + db, 3.0 * (b - a) - 2.0 * da - db
    value = ((bend[0] * within + bend[1]) * within + da) * within + a
    slope = (3.0 * bend[0] * within + 2.0 * bend[1]) * within + da
    return value + slope * (t - within), slope


def _inverted(aim: Array, a: Array, b: Array, da: Array, db: Array) -> Array:
    """Return where rising cubics reach values: beyond their ends along the tangents, 0 below."""
    rise = np.maximum(b - a, 1e-300)
    bend = 2.0 * (a - b) + da + db, 3.0 * (b - a) - 2.0 * da - db
    within = np.clip(aim, a, b)
    t = root_within([one / rise for one in (*bend, da, a - within)], 1.0)
    return np.where(aim > b, 1.0 + (aim - b) / np.maximum(db, 1e-300), np.where(aim < a, 0.0, t))
