"""Patch laws: closure and mean pressure of a patch over its local rigid approach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from multiscale.law_pieces import AREA, CLOSURE, RELIEF, ROOT, inverted, pieces_of

Array = NDArray[np.float64]


class LawPoint(NamedTuple):
    """A law, or the laws of N patches, at a local rigid approach s.

    Attributes:
        closure: Closure c [mm].
        pressure: Mean pressure p [MPa].
        dclosure: dc/ds.
        dpressure: dp/ds [MPa/mm].
    """

    closure: Array
    pressure: Array
    dclosure: Array
    dpressure: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchLaw:
    """Closure, mean pressure, contact area and contacts of one patch over its local approach s.

    The closure c is the rigid approach at the patch minus the macroscopic displacement of its
    surface: the gap g_n of Waddad et al. 2016, section 3.2. Both c and p^(2/3) are interpolated
    over s (PCHIP): for Hertz' law p ~ (s - s_touch)^(3/2) the latter is a straight line, so that
    pressure and stiffness are right from the first touch on. Before it the pressure is zero and
    c grows as s; beyond the last row both go on along their tangents. Near full contact p is no
    function of c any more: the law over s goes on, `at` ends.

    Attributes:
        closure: Closures, shape (n,) [mm]; empty for a patch that stays open.
        pressure: Mean pressures, the first zero, shape (n,) [MPa].
        approach: Local rigid approaches of the rows, increasing from first touch on, (n,) [mm].
        contact_area_fraction: Real over nominal contact area, shape (n,).
        contacts: Number of contacts, shape (n,).
        relief: Mean displacement of the patch by its contacts beyond that by their mean pressure,
            shape (n,) [mm]: what the mean gap is wider than the closure alone tells.
        touch: Closure at first touch [mm]: the table's first, where an open patch would be touched
            first, or infinite when it has nothing to touch.
        reach: Rigid plane's height over the patch's mean plane at zero approach [mm]; the mean
            separation is reach − c + relief.
        interpolation_error: Largest error of the interpolated pressure half-way between rows,
            relative to the scale that the law's maker states.
        stiffness_error: The same of dp/dc, estimated by the change that the row half-way makes;
            NaN where nobody estimated it.
    """

    closure: Array
    pressure: Array
    approach: Array
    contact_area_fraction: Array
    contacts: NDArray[np.int64]
    relief: Array
    touch: float
    reach: float
    interpolation_error: float = 0.0
    stiffness_error: float = float("nan")

    def __post_init__(self) -> None:
        names = ("closure", "pressure", "approach", "contact_area_fraction", "contacts", "relief")
        for name in names:
            column = getattr(self, name)
            if column.shape != self.closure.shape:
                raise InputError("a patch law needs columns of one length")
            if not np.all(np.isfinite(column)):
                raise InputError(f"a patch law needs a finite {name}")
        if self.closure.size == 1:
            raise InputError("a patch law needs no row (open patch) or at least two")
        if np.any(np.diff(self.approach) <= 0):
            raise InputError("a patch law needs a strictly increasing approach")
        if np.any(self.pressure < 0) or np.any(self.pressure[:1] != 0.0):
            raise InputError("a patch law starts at zero pressure", value=self.pressure.min())

    @property
    def is_open(self) -> bool:
        """Whether the patch is touched nowhere in the law's range."""
        return self.closure.size == 0

    @property
    def is_function(self) -> bool:
        """Whether closure grows all along the rows, so that pressure is a function of it."""
        return bool(np.all(np.diff(self.closure) > 0))

    @property
    def range(self) -> tuple[float, float]:
        """Closures at first touch and at the end of what `at` answers [mm]."""
        return self.touch, self.touch if self.is_open else float(self.closure[self._last])

    @cached_property
    def _last(self) -> int:
        """Row that the increasing closures end at; where they turn, the slope is zero."""
        falls = np.flatnonzero(np.diff(self.closure) <= 0)
        return max(int(falls[0]) - 1, 0) if falls.size else self.closure.size - 1

    @cached_property
    def pieces(self) -> Array:
        """Cubic pieces over s of p^(2/3), closure, area fraction and relief, (4, n + 1, 4)."""
        root = self.pressure ** (2 / 3)
        columns = (root, self.closure, self.contact_area_fraction, self.relief)
        return pieces_of(self.approach, np.column_stack(columns))

    @cached_property
    def _growing(self) -> Array:
        """The pieces up to where closure stops growing, the tangent there as the last of them."""
        pieces = self.pieces.copy()
        pieces[:2, self._last + 1] = 0.0
        slope = pieces[2, self._last + 1, CLOSURE]
        pieces[2, self._last + 1, CLOSURE] = max(slope, 1e-6)  # flat where the table would turn
        return pieces

    def along(self, approach: ArrayLike) -> LawPoint:
        """Return the law at local approaches s of any shape [mm], in and beyond the table."""
        s = np.asarray(approach, dtype=float)
        piece, step = self._place(s)
        return _point(self.pieces[:, piece, :2], step)

    def at(self, closure: ArrayLike, *, extend: bool = False) -> tuple[Array, Array]:
        """Return pressure and stiffness, the exact derivative of the same interpolant.

        Args:
            closure: Closures of any shape [mm].
            extend: Continue along the tangents beyond the table instead of raising.

        Returns:
            Pressure [MPa] and its derivative over closure [MPa/mm], in the shape of `closure`.

        Raises:
            InputError: When a closure lies beyond the table, or where the pressure stops being a
                function of it, and `extend` is false.
        """
        closures = self._checked(closure, extend)
        if self.is_open:
            return np.zeros_like(closures), np.zeros_like(closures)
        piece, step = self._inverse(closures)
        point = _point(self._growing[:, piece, :2], step)
        return point.pressure, point.dpressure / point.dclosure

    def area_fraction_at(self, closure: ArrayLike, *, extend: bool = False) -> Array:
        """Return the real contact area over the nominal one; arguments and errors as in `at`."""
        closures = self._checked(closure, extend)
        if self.is_open:
            return np.zeros_like(closures)
        return np.asarray(np.clip(self._column(AREA, closures), 0.0, 1.0))

    def contacts_at(self, closure: ArrayLike, *, extend: bool = False) -> NDArray[np.int64]:
        """Return the number of contacts of the row at or before; arguments as in `at`."""
        closures = self._checked(closure, extend)
        row = np.searchsorted(self.closure[: self._last + 1], closures, side="right") - 1
        return np.where(row >= 0, np.append(self.contacts, 0)[row], 0)

    def separation_at(self, closure: ArrayLike, *, extend: bool = False) -> Array:
        """Return the mean gap of plane and displaced surface [mm]; arguments as in `at`."""
        closures = self._checked(closure, extend)
        if self.is_open:
            return self.reach - closures
        return np.asarray(self.reach - closures + self._column(RELIEF, closures))

    def _column(self, column: int, closures: Array) -> Array:
        piece, step = self._inverse(closures)
        return _cubic(self._growing[:, piece, column], step)

    def _place(self, s: Array) -> tuple[NDArray[np.intp], Array]:
        """Return the piece that holds each approach and the approach counted from its start."""
        if self.is_open:
            return np.zeros(s.shape, dtype=np.intp), s
        piece = np.searchsorted(self.approach, s, side="right")
        return piece, s - self.approach[np.maximum(piece - 1, 0)]

    def _inverse(self, closures: Array) -> tuple[NDArray[np.intp], Array]:
        """Return piece and step at closures, the same as `_place` at their approaches."""
        closure = self._growing[:, :, CLOSURE]
        return inverted(closure, self.approach, self.closure, self._last, closures)

    def _checked(self, closure: ArrayLike, extend: bool) -> Array:
        closures = np.asarray(closure, dtype=float)
        start, end = self.range
        # The end of a table is reached up to round-off of the closure's own computation.
        if not extend and np.any(closures > end * (1 + 1e-12)):
            problem = "closure beyond the end of the patch law"
            if not self.is_function:
                problem += ", where pressure stops being a function of closure"
            raise InputError(
                problem,
                value=float(np.max(closures)),
                allowed=f"closure up to {end:.6g} mm (first touch at {start:.6g} mm)",
            )
        return closures


@dataclass(frozen=True, slots=True)
class ExtendedLaw:
    """A patch law defined for every closure, as Newton's iterates need it.

    Whoever uses it checks the converged closures against the table.
    """

    law: PatchLaw

    def pressure(self, closure: ArrayLike) -> Array:
        """Return the pressure [MPa] at closures of any shape [mm]."""
        return self.law.at(closure, extend=True)[0]

    def stiffness(self, closure: ArrayLike) -> Array:
        """Return dp/dc [MPa/mm] at closures of any shape [mm]."""
        return self.law.at(closure, extend=True)[1]


class PatchLaws:
    """The laws of N patches at one local approach each, without a loop over patches.

    Args:
        laws: The N laws; their tables may have different lengths.
    """

    def __init__(self, laws: Sequence[PatchLaw]) -> None:
        most = max((law.approach.size for law in laws), default=0)
        self._knots = np.full((len(laws), most), np.inf)
        self._starts = np.zeros((len(laws), most + 1))
        self._pieces = np.zeros((len(laws), most + 1, 4, 4))  # patch, piece, power, column
        self._contacts = np.zeros((len(laws), most + 1), dtype=np.int64)
        for i, law in enumerate(laws):
            rows = law.approach.size
            self._knots[i, :rows] = law.approach
            self._starts[i, 0] = law.approach[0] if rows else 0.0
            self._starts[i, 1 : rows + 1] = law.approach
            self._pieces[i, : rows + 1] = law.pieces.transpose(1, 0, 2)
            self._contacts[i, 1 : rows + 1] = law.contacts
        self._reach = np.array([law.reach for law in laws])
        self._index = np.arange(len(laws))
        self.touch = np.array([law.approach[0] if law.approach.size else np.inf for law in laws])
        """Local approaches of first touch, infinite for open patches, shape (N,) [mm]."""
        self.end = np.array([law.approach[-1] if law.approach.size else np.inf for law in laws])
        """Local approaches that the tables end at, infinite for open patches, shape (N,) [mm]."""

    def along(self, approach: Array) -> LawPoint:
        """Return all laws at local approaches s, shape (N,) [mm], in and beyond the tables."""
        coefficients, step, _ = self._at(approach)
        return _point(coefficients[..., :2], step)

    def area_fraction(self, approach: Array) -> Array:
        """Return the real contact areas over the nominal ones at s (N,) [mm]."""
        coefficients, step, _ = self._at(approach)
        return np.asarray(np.clip(_cubic(coefficients[..., AREA], step), 0.0, 1.0))

    def separation(self, approach: Array) -> Array:
        """Return the mean gaps [mm] at s (N,) [mm]."""
        coefficients, step, _ = self._at(approach)
        closure = _cubic(coefficients[..., CLOSURE], step)
        return np.asarray(self._reach - closure + _cubic(coefficients[..., RELIEF], step))

    def contacts(self, approach: Array) -> NDArray[np.int64]:
        """Return the numbers of contacts of the rows at or before s (N,) [mm]."""
        return np.asarray(self._contacts[self._index, self._at(approach)[2]])

    def _at(self, approach: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        piece = np.sum(self._knots <= approach[:, None], axis=1)
        step = approach - self._starts[self._index, piece]
        return self._pieces[self._index, piece].transpose(1, 0, 2), step, piece


def _point(coefficients: Array, step: Array) -> LawPoint:
    """Return the point of pieces of p^(2/3) and closure, shape (4, ..., 2), at steps into them."""
    roots, closures = coefficients[..., ROOT], coefficients[..., CLOSURE]
    root = np.maximum(_cubic(roots, step), 0.0)
    power = np.sqrt(root)
    slope = 1.5 * power * _slope(roots, step)
    return LawPoint(_cubic(closures, step), root * power, _slope(closures, step), slope)


def _cubic(c: Array, x: Array) -> Array:
    return np.asarray(((c[0] * x + c[1]) * x + c[2]) * x + c[3])


def _slope(c: Array, x: Array) -> Array:
    return np.asarray((3.0 * c[0] * x + 2.0 * c[1]) * x + c[2])
