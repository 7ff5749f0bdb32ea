"""Patch laws: closure and mean pressure of a patch, tabulated over its local rigid approach."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from multiscale.laws.interpolation import FLATTEST, Curves

Array = NDArray[np.float64]


class LawPoint(NamedTuple):
    """Laws at local approaches.

    Attributes:
        closure: Closures [mm].
        pressure: Mean pressures [MPa].
        dclosure: Derivative of the closure over the local approach.
        dpressure: Derivative of the pressure over the local approach [MPa/mm].
    """

    closure: Array
    pressure: Array
    dclosure: Array
    dpressure: Array

    @classmethod
    def of(cls, values: Array, slopes: Array) -> LawPoint:
        """Return the point of closure and p^(2/3), the first two of some curves."""
        root = np.maximum(values[1], 0.0)
        half = np.sqrt(root)
        return cls(values[0], half * root, slopes[0], 1.5 * half * slopes[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchLaw:
    """Mean pressure, contact area and contacts of one patch.

    The closure c is the rigid approach at the patch minus the macroscopic displacement of its
    surface: the gap g_n of Waddad et al. 2016, section 3.2. The rows are over the local rigid
    approach s that they were computed at, and so are the interpolants: where a patch alone comes
    near full contact, its pressure is no function of its closure any more, yet closure and
    pressure are of s. Before the first touch pressure is zero and closure grows as s. Between rows
    the interpolants are monotone where the rows are: p^(2/3) is interpolated (PCHIP), for Hertz'
    law p ~ (s - s_touch)^(3/2) is a straight line in it, so that pressure and stiffness are right
    from the first touch on. Beyond the rows the tangents go on.

    Attributes:
        closure: Closures from the first touch on, shape (n,) [mm]; empty for a patch that stays
            open: such a law is zero as far as it goes.
        pressure: Mean pressures, the first zero, shape (n,) [MPa].
        approach: Local rigid approaches s, increasing, shape (n,) [mm]; where the plane was free to
            turn, its approaches at the middle.
        contact_area_fraction: Real over nominal contact area, shape (n,).
        contacts: Number of asperities in contact, shape (n,).
        relief: Mean displacement of the patch by its contacts beyond that by their mean pressure,
            shape (n,) [mm]: what the mean gap is wider than the closure alone tells.
        touch: Closure at first touch [mm]: the table's first, where an open patch would be touched
            first, or infinite when it has no asperity.
        reach: Rigid plane's height over the patch's mean plane at zero approach [mm]; the mean
            separation is reach − c + relief.
        interpolation_error: Estimated error of the interpolated pressure against the micro model,
            see `refinement.Errors`.
        stiffness_error: The same of the stiffness; NaN where nobody estimated it.
        warned_from: Mean pressure from which on the micro model warned that the contacts lie
            outside its range of validity [MPa]; infinite when it never did.
        repaired: Largest change that made falling rows rise, see `repair.evened`.
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
    warned_from: float = np.inf
    repaired: float = 0.0

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
        if np.any(np.diff(self.approach) <= 0.0):
            raise InputError("a patch law needs a strictly increasing approach")
        if np.any(self.pressure < 0.0):
            raise InputError("a patch law needs a pressure without tension")
        if self.closure.size and self.pressure[0] != 0.0:
            raise InputError("a patch law starts at zero pressure", value=self.pressure[0])

    @property
    def is_open(self) -> bool:
        """Whether the patch is touched nowhere in the law's range."""
        return self.closure.size == 0

    @property
    def is_function(self) -> bool:
        """Whether the pressure is a function of closure in the whole range of the law."""
        return self._rising == len(self.closure)

    @property
    def is_punch(self) -> bool:
        """Whether closure falls from first touch on, as it does over a flat patch taken alone.

        Then the pressure is a function of closure nowhere.
        """
        return not self.is_open and self._rising == 1

    @property
    def range(self) -> tuple[float, float]:
        """Closures at first touch and at the end of the pressure's being a function of it [mm]."""
        return self.touch, self.touch if self.is_open else float(self.closure[self._rising - 1])

    @cached_property
    def curves(self) -> Curves:
        """Closure, p^(2/3), area fraction and relief over the local approach."""
        columns = (
            self.closure, self.pressure ** (2 / 3), self.contact_area_fraction, self.relief,
        )  # fmt: skip
        return Curves.through(self.approach, columns, before=(1.0, 0.0, 0.0, 0.0))

    def along(self, approach: ArrayLike) -> LawPoint:
        """Return closure, pressure and their derivatives at local approaches.

        Args:
            approach: Local rigid approaches of any shape [mm].
        """
        given = np.asarray(approach, dtype=float)
        values, slopes = self.curves.of_one(*self.curves.placed(given.ravel()))
        return LawPoint.of(values.reshape(-1, *given.shape), slopes.reshape(-1, *given.shape))

    def at(self, closure: ArrayLike, *, extend: bool = False) -> tuple[Array, Array]:
        """Return pressure and stiffness, the exact derivative of the same interpolant.

        Args:
            closure: Closures of any shape [mm].
            extend: Continue along the tangent beyond the table instead of raising.

        Returns:
            Pressure [MPa] and its derivative over closure [MPa/mm], in the shape of `closure`.

        Raises:
            InputError: When a closure lies beyond the law's range and `extend` is false.
        """
        closures = self._checked(closure, extend)
        point = LawPoint.of(*self._over_closure(closures))
        return point.pressure, point.dpressure / np.maximum(point.dclosure, FLATTEST)

    def area_fraction_at(self, closure: ArrayLike, *, extend: bool = False) -> Array:
        """Return the real contact area over the nominal one.

        Args:
            closure: Closures of any shape [mm].
            extend: Go on beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the table and `extend` is false.
        """
        area = self._over_closure(self._checked(closure, extend))[0][2]
        return np.asarray(np.clip(area, 0.0, 1.0))

    def contacts_at(self, closure: ArrayLike, *, extend: bool = False) -> NDArray[np.int64]:
        """Return the number of contacts of the table row at or before each closure.

        Args:
            closure: Closures of any shape [mm].
            extend: Keep the last row's number beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the table and `extend` is false.
        """
        closures = self._checked(closure, extend)
        row = np.searchsorted(self.closure[: self._rising], closures, side="right") - 1
        return np.where(row >= 0, np.append(self.contacts, 0)[row], 0)

    def separation_at(self, closure: ArrayLike, *, extend: bool = False) -> Array:
        """Return the mean gap between the plane and the patch's displaced surface [mm].

        Args:
            closure: Closures of any shape [mm].
            extend: Go on beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the table and `extend` is false.
        """
        closures = self._checked(closure, extend)
        return np.asarray(self.reach - closures + self._over_closure(closures)[0][3])

    @cached_property
    def _rising(self) -> int:
        """Number of rows before closure stops to rise."""
        stops = np.flatnonzero(np.diff(self.closure) <= 0.0)
        return int(stops[0]) + 1 if stops.size else len(self.closure)

    @cached_property
    def _risen(self) -> Curves:
        """The curves up to where closure stops to rise, and their tangents there."""
        return self.curves.cut(self._rising)

    def _over_closure(self, closures: Array) -> tuple[Array, Array]:
        """Return values and derivatives over the approach at closures (…), shapes (f, …)."""
        given = closures.ravel()
        piece, into = np.zeros(given.size, dtype=np.intp), given.copy()
        if not self.is_open:
            rows = self.closure[: self._rising]
            into -= rows[0]
            beyond = given >= rows[-1]
            slope = max(float(self._risen.coefficients[0, -1, 2, 0]), FLATTEST)
            piece[beyond], into[beyond] = len(rows), (given[beyond] - rows[-1]) / slope
            within = (given > rows[0]) & ~beyond
            piece[within], into[within] = self._risen.inverted(0, rows, given[within])
        values, slopes = self._risen.of_one(piece, into)
        return values.reshape(-1, *closures.shape), slopes.reshape(-1, *closures.shape)

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
