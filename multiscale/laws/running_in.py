"""Laws of a face whose roughness runs in: between those of surfaces that have worn by some depths.

The state of the roughness under a point is the depth W that has worn off there, volume per area.
Surfaces that wore to the same depth under pressures of 1 to 4 have nearly the same law, and those
that slid the same distance do not (docs/wear.md). A law is a function of c − W, the closure of what
is left, and changes its shape with W. Between two depths its closure is interpolated linearly at
equal pressure, as curves that are steep lie beside each other; beyond the last depth it stays.

Theory: docs/theory.md, section 18.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from scipy.interpolate import PchipInterpolator

from patchlaw.multiscale.laws.interpolation import LawPoint
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.errors import InputError

_STEPS, _CLOSE = 60, 1e-15
"""Steps to a pressure within its piece at most, and change that ends them."""
_STEEPEST = 0.1
"""Slope of the closure over q where a law begins and ends, over that of its piece, at least."""
_ROUNDING = 1e-12
"""Share of the end of a law by which a converged closure may exceed it."""


class RunningInLaws:
    """N laws that depend on the depth that has worn off: a `ContactLaws` of `macro`.

    Args:
        levels: The N laws at every one of L depths.
        depths: These depths, rising from 0, shape (L, N) [mm].
    """

    def __init__(self, levels: Sequence[Sequence[PatchLaw]], depths: Array) -> None:
        self._depths = depths
        self._curves = [_Curves.through(laws) for laws in zip(*levels, strict=True)]

    def __len__(self) -> int:
        return len(self._curves)

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
        found = np.zeros((len(LawPoint._fields), len(closure)))
        for number in np.unique(patch):
            at = np.flatnonzero(patch == number)
            curves, between = self._curves[number], _between(self._depths[:, number], depth[at])
            if not extend:
                curves.check(closure[at], between)
            found[:, at] = curves.at(closure[at], between)[: len(found)]
        *values, contacts = found
        return LawPoint._make([*values, np.rint(contacts).astype(np.int64)])

    def worn(self, patch: Indices, closure: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Return pressures [MPa], and what they change by with closure and with depth [MPa/mm].

        Beyond the tables the tangents continue.

        Args:
            patch: Patches, shape (n,).
            closure: Closures of what is left there, shape (n,) [mm].
            depth: Worn depths, shape (n,) [mm].

        Returns:
            Pressures, their derivatives by the closure, and by the depth where the closure stays;
            shape (n,) each.
        """
        found = np.zeros((3, len(closure)))
        for number in np.unique(patch):
            at = np.flatnonzero(patch == number)
            between = _between(self._depths[:, number], depth[at])
            values = self._curves[number].at(closure[at], between)
            found[:, at] = values[1], values[3], values[-1]
        return found[0], found[1], found[2]

    def pressures(self, patch: Indices, closure: Array) -> Array:
        """Return the pressures where nothing has worn off, see `ContactLaws.pressures`."""
        return self.worn(patch, closure, np.zeros_like(closure))[0]

    def stiffnesses(self, patch: Indices, closure: Array) -> Array:
        """Return their derivatives, see `ContactLaws.stiffnesses`."""
        return self.worn(patch, closure, np.zeros_like(closure))[1]


Between = tuple[Indices, Array, Array]
"""Level below, share of the way to the next, and its change with the depth [1/mm]; shape (n,)."""


def _between(levels: Array, depth: Array) -> Between:
    """Return where depths lie between levels, which rise or stay, shape (L,) [mm]."""
    level = np.clip(np.searchsorted(levels, depth, side="right") - 1, 0, len(levels) - 2)
    low, high = levels[level], levels[level + 1]
    inside = depth < high
    width = np.where(inside, high - low, 1.0)
    return level, np.where(inside, (depth - low) / width, 1.0), inside / width


@dataclass(frozen=True, eq=False)
class _Curves:
    """What a law is over q = p^(2/3), at all depths on one grid of q.

    Attributes:
        grid: Values of q, from 0, shape (G,) [MPa^(2/3)].
        values: Closures, contact area fractions, mean gaps and contacts, shape (4, L, G).
        slopes: Their derivatives by q.
    """

    grid: Array
    values: Array
    slopes: Array

    @classmethod
    def through(cls, laws: Sequence[PatchLaw]) -> _Curves:
        """Interpolate the rows of the laws at all depths (PCHIP)."""
        curves = []
        for law in laws:
            rows = law.rows[: law.rising_rows]
            q, once = np.unique(rows.pressure ** (2 / 3), return_index=True)
            gap = law.initial_separation - rows.closure + rows.unresolved_displacement
            columns = rows.closure, rows.contact_area_fraction, gap, rows.contacts
            curves.append(PchipInterpolator(q, np.array(columns, float)[:, once], axis=1))
        end = min(curve.x[-1] for curve in curves)
        grid = reduce(np.union1d, [curve.x[curve.x <= end] for curve in curves])
        values = np.stack([curve(grid) for curve in curves], axis=1)
        slopes = np.stack([curve(grid, 1) for curve in curves], axis=1)
        for at, side in ((0, slice(0, 2)), (-1, slice(-2, None))):  # limiters may end them flat
            secant = np.diff(values[0][:, side], axis=1)[:, 0] / np.diff(grid[side])
            slopes[0, :, at] = np.maximum(slopes[0, :, at], _STEEPEST * secant)
        return cls(grid, values, slopes)

    def check(self, closure: Array, between: Between) -> None:
        """Refuse closures beyond the end of the law."""
        ends = _blended(self.values[0, :, -1:], between, np.zeros(len(closure), np.intp))
        beyond = closure > ends + _ROUNDING * np.abs(ends)
        if beyond.any():
            worst = int(np.argmax(closure - ends))
            raise InputError(
                "closure beyond the end of the law of a worn face",
                value=float(closure[worst]),
                allowed=f"closure up to {ends[worst]:.6g} mm",
            )

    def at(self, closure: Array, between: Between) -> Array:
        """Return the fields of `LawPoint`, and the derivative of the pressure by the depth.

        Args:
            closure: Closures of what is left, shape (n,) [mm].
            between: Where depths lie between the levels.
        """
        grid, (level, _, rate) = self.grid, between
        low, high = np.zeros(len(closure), np.intp), np.full(len(closure), len(grid) - 1)
        for _ in range(len(grid).bit_length()):
            middle = (low + high) // 2
            below = _blended(self.values[0], between, middle) <= closure
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        piece = np.minimum(low, len(grid) - 2)
        width = grid[piece + 1] - grid[piece]
        ends = [_blended(self.values, between, at) for at in (piece, piece + 1)]
        tangents = [width * _blended(self.slopes, between, at) for at in (piece, piece + 1)]
        t = _inverted(closure, *(one[0] for one in (*ends, *tangents)))
        value, slope = _hermite(t, *ends, *tangents)
        slope = slope / width
        q = grid[piece] + t * width
        touched = q > 0.0
        pressure = np.where(touched, q, 0.0) ** 1.5
        stiffness = 1.5 * np.sqrt(np.where(touched, q, 0.0)) / np.maximum(slope[0], 1e-300)
        steps = [
            _hermite(t, *(one[0, level + up, piece + right] * scale for one, right, scale in (
                (self.values, 0, 1.0), (self.values, 1, 1.0),
                (self.slopes, 0, width), (self.slopes, 1, width),
            )))[0]
            for up in (0, 1)
        ]  # fmt: skip
        by_depth = -rate * (steps[1] - steps[0]) * stiffness
        per_closure = np.where(touched, slope[2] / np.maximum(slope[0], 1e-300), -1.0)
        gap = np.where(touched, value[2], ends[0][2] + ends[0][0] - closure)
        area, contacts = (np.where(touched, value[k], 0.0) for k in (1, 3))
        area = np.clip(area, 0.0, 1.0)  # tangents beyond the tables may leave it
        one = np.ones_like(closure)
        return np.array(
            [closure, pressure, one, stiffness, area, gap, per_closure, contacts, by_depth]
        )


def _blended(values: Array, between: Between, at: Indices) -> Array:
    """Return values of shape (…, L, G) at depths between the levels and places of the grid."""
    level, share, _ = between
    return np.asarray((1.0 - share) * values[..., level, at] + share * values[..., level + 1, at])


def _hermite(t: Array, a: Array, b: Array, da: Array, db: Array) -> tuple[Array, Array]:
    """Return cubics by their ends and tangents, and their slopes; straight beyond the ends."""
    within = np.clip(t, 0.0, 1.0)
    bend = 2.0 * (a - b) + da + db, 3.0 * (b - a) - 2.0 * da - db
    value = ((bend[0] * within + bend[1]) * within + da) * within + a
    slope = (3.0 * bend[0] * within + 2.0 * bend[1]) * within + da
    return value + slope * (t - within), slope


def _inverted(aim: Array, a: Array, b: Array, da: Array, db: Array) -> Array:
    """Return where rising cubics reach values; beyond their ends along the tangents."""
    beyond = aim > b
    t = np.where(
        beyond, 1.0 + (aim - b) / np.maximum(db, 1e-300), (aim - a) / np.maximum(b - a, 1e-300)
    )
    low, high = np.where(beyond, t, 0.0), np.where(beyond, t, 1.0)
    t = np.where(aim < a, 0.0, t)
    for _ in range(_STEPS):
        value, slope = _hermite(t, a, b, da, db)
        low, high = (
            np.where(value < aim, np.maximum(t, low), low),
            np.where(value > aim, np.minimum(t, high), high),
        )
        newton = t + (aim - value) / np.maximum(slope, 1e-300)
        inside = (newton >= low) & (newton <= high)
        before, t = t, np.where(beyond, t, np.where(inside, newton, 0.5 * (low + high)))
        if np.all(np.abs(t - before) <= _CLOSE):
            break
    return np.where(aim < a, 0.0, t)
