"""Patch laws: closure and mean pressure of a patch, tabulated over its local rigid approach."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from multiscale.laws.interpolation import LEAST_SLOPE, LawCurves, LawPoint
from multiscale.laws.rows import LawRows

Array = NDArray[np.float64]


class LawValues(NamedTuple):
    """What a law gives at closures, in their shape.

    Attributes:
        pressure: Mean pressure of the patch [MPa].
        stiffness: Its exact derivative over the closure [MPa/mm].
        contact_area_fraction: Real over nominal contact area.
        separation: Mean gap between the plane and the patch's displaced surface [mm].
        contacts: Number of contacts in the last row at or before the closure.
    """

    pressure: Array
    stiffness: Array
    contact_area_fraction: Array
    separation: Array
    contacts: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchLaw:
    """Mean pressure, contact area and contacts of one patch: a contact law of `macro`.

    The closure c is the rigid approach at the patch minus the macroscopic displacement of its
    surface: the gap g_n of Waddad et al. 2016, section 3.2. The law is interpolated over the local
    rigid approach s of its rows, because near full contact the pressure of a patch taken alone is
    no function of its closure any more, while closure and pressure remain functions of s.

    Before first touch the pressure is zero and the closure grows as s. Between rows the
    interpolants are monotone where the rows are (PCHIP). What is interpolated is p^(2/3): Hertz'
    law p ~ (s - s_touch)^(3/2) is a straight line in it, so that pressure and stiffness are right
    from first touch on. Beyond the rows the tangents continue.

    Attributes:
        rows: The rows from first touch on, the first without pressure. A patch that stays open has
            none, and its pressure is zero.
        first_touch: Closure at first touch [mm]: that of the first row, or where an open patch
            would be touched first; infinite when it has nothing to touch.
        initial_separation: Height of the rigid plane over the patch's mean plane at zero approach
            [mm]. The mean separation is this less the closure, plus the unresolved displacement.
        interpolation_error: Estimated error of the interpolated pressure against the micro model,
            see `multiscale.laws.refinement`.
        stiffness_error: The same of the stiffness; NaN where it was not estimated.
        warning_pressure: Mean pressure from which on the micro model warned that it is outside
            its range of validity [MPa]; infinite when it never did.
        repaired: Largest change that made falling rows rise, see `LawRows.rising`.

    Raises:
        InputError: When the rows are no law.
    """

    rows: LawRows
    first_touch: float
    initial_separation: float
    interpolation_error: float = 0.0
    stiffness_error: float = float("nan")
    warning_pressure: float = np.inf
    repaired: float = 0.0

    def __post_init__(self) -> None:
        if len(self.rows) == 1:
            raise InputError("a patch law needs no row (open patch) or at least two")
        if np.any(np.diff(self.rows.approach) <= 0.0):
            raise InputError("a patch law needs a strictly increasing approach")
        if np.any(self.rows.pressure < 0.0):
            raise InputError("a patch law needs a pressure without tension")
        if len(self.rows) and self.rows.pressure[0] != 0.0:
            raise InputError("a patch law starts at zero pressure", value=self.rows.pressure[0])

    @property
    def is_open(self) -> bool:
        """Whether the patch is touched nowhere in the law's range."""
        return len(self.rows) == 0

    @property
    def is_function(self) -> bool:
        """Whether the pressure is a function of closure in the whole range of the law."""
        return self._rising == len(self.rows)

    @property
    def is_flat(self) -> bool:
        """Whether closure falls from first touch on, as it does over a flat patch taken alone.

        Then the pressure is a function of closure nowhere.
        """
        return not self.is_open and self._rising == 1

    @property
    def range(self) -> tuple[float, float]:
        """Closures between which the pressure is a function of closure [mm].

        The first is that of first touch.
        """
        end = self.first_touch if self.is_open else float(self.rows.closure[self._rising - 1])
        return self.first_touch, end

    @cached_property
    def curves(self) -> LawCurves:
        """Closure, p^(2/3), area fraction and unresolved displacement over the local approach."""
        rows = self.rows
        columns = (
            rows.closure,
            rows.pressure ** (2 / 3),
            rows.contact_area_fraction,
            rows.unresolved_displacement,
        )
        return LawCurves.through(rows.approach, columns, before=(1.0, 0.0, 0.0, 0.0))

    def along(self, approach: ArrayLike) -> LawPoint:
        """Return closure, pressure and their derivatives at local rigid approaches of any shape.

        Args:
            approach: Local rigid approaches [mm].
        """
        local = np.asarray(approach, dtype=float)
        found = (part.reshape(-1, *local.shape) for part in self.curves.at(0, local.ravel()))
        return LawPoint.of(*found)

    def at(self, closure: ArrayLike, *, extend: bool = False) -> LawValues:
        """Return what the law gives at closures of any shape.

        Args:
            closure: Closures [mm].
            extend: Whether to continue along the tangent beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the law's range and `extend` is false.
        """
        closures = np.asarray(closure, dtype=float)
        if not extend:
            self._check_range(closures)
        values, slopes = self._over_closure(closures)
        point = LawPoint.of(values, slopes)
        row = np.searchsorted(self.rows.closure[: self._rising], closures, side="right") - 1
        return LawValues(
            pressure=point.pressure,
            stiffness=point.dpressure / np.maximum(point.dclosure, LEAST_SLOPE),
            contact_area_fraction=np.asarray(np.clip(values[2], 0.0, 1.0)),
            separation=np.asarray(self.initial_separation - closures + values[3]),
            contacts=np.where(row >= 0, np.append(self.rows.contacts, 0)[row], 0),
        )

    def pressure(self, closure: ArrayLike) -> Array:
        """Return the pressure at any closure, as an iteration needs it [MPa].

        Beyond the table it continues along the tangent: whoever uses it checks the converged
        closures with `at`.
        """
        return self.at(closure, extend=True).pressure

    def stiffness(self, closure: ArrayLike) -> Array:
        """Return the derivative of `pressure` over the closure [MPa/mm]."""
        return self.at(closure, extend=True).stiffness

    @cached_property
    def _rising(self) -> int:
        """Number of rows before closure stops rising."""
        stops = np.flatnonzero(np.diff(self.rows.closure) <= 0.0)
        return int(stops[0]) + 1 if stops.size else len(self.rows)

    @cached_property
    def _rising_curves(self) -> LawCurves:
        """The curves up to where closure stops rising, and their tangents there."""
        return self.curves.cut(self._rising)

    def _over_closure(self, closures: Array) -> tuple[Array, Array]:
        """Return values and derivatives over the approach at closures (…), shapes (f, …)."""
        given = closures.ravel()
        piece, distance = np.zeros(given.size, dtype=np.intp), given.copy()
        if not self.is_open:
            rows = self.rows.closure[: self._rising]
            distance -= rows[0]
            beyond = given >= rows[-1]
            slope = max(float(self._rising_curves.coefficients[0, -1, 2, 0]), LEAST_SLOPE)
            piece[beyond], distance[beyond] = len(rows), (given[beyond] - rows[-1]) / slope
            within = (given > rows[0]) & ~beyond
            inverse = self._rising_curves.inverted(0, rows, given[within])
            piece[within], distance[within] = inverse
        values, slopes = self._rising_curves.within(0, piece, distance)
        return values.reshape(-1, *closures.shape), slopes.reshape(-1, *closures.shape)

    def _check_range(self, closures: Array) -> None:
        start, end = self.range
        # a converged closure may exceed the end of the table by its own rounding
        if np.any(closures > end * (1 + 1e-12)):
            problem = "closure beyond the end of the patch law"
            if not self.is_function:
                problem += ", where pressure stops being a function of closure"
            raise InputError(
                problem,
                value=float(np.max(closures)),
                allowed=f"closure up to {end:.6g} mm (first touch at {start:.6g} mm)",
            )
