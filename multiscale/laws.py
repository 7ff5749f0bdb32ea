"""Patch laws: mean pressure of a patch tabulated against its closure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from geometry.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchLaw:
    """Mean pressure, contact area and contacts of one patch over its closure.

    The closure c is the rigid approach at the patch minus the macroscopic displacement of its
    surface: the gap g_n of Waddad et al. 2016, section 3.2. Before the first touch everything is
    zero. Between table points the interpolant is monotone: p^(2/3) is interpolated (PCHIP), for
    Hertz' law p ~ (c - c_touch)^(3/2) is a straight line in it, so that pressure and stiffness
    are right from the first touch on.

    Attributes:
        closure: Closures, increasing from the first touch on, shape (n,) [mm]; empty for a patch
            that stays open: such a law is zero as far as it goes.
        pressure: Mean pressures, increasing from zero, shape (n,) [MPa].
        approach: Local rigid approaches that the rows were computed at, shape (n,) [mm].
        contact_area_fraction: Real over nominal contact area, shape (n,).
        contacts: Number of asperities in contact, shape (n,).
        touch: Closure at first touch [mm]: the table's first, where an open patch would be touched
            first, or infinite when it has no asperity.
        reach: Rigid plane's height over the patch's mean plane at zero approach [mm], so that
            reach − c is the mean separation.
        interpolation_error: Largest error of the interpolated pressure against the micro model
            between the table points, relative to the largest pressure of the table.
    """

    closure: Array
    pressure: Array
    approach: Array
    contact_area_fraction: Array
    contacts: NDArray[np.int64]
    touch: float
    reach: float
    interpolation_error: float = 0.0

    def __post_init__(self) -> None:
        columns = (self.pressure, self.approach, self.contact_area_fraction, self.contacts)
        if any(column.shape != self.closure.shape for column in columns):
            raise InputError("a patch law needs columns of one length")
        if self.closure.size == 1:
            raise InputError("a patch law needs no row (open patch) or at least two")
        for name in ("closure", "pressure"):
            column = getattr(self, name)
            if not np.all(np.isfinite(column)) or np.any(np.diff(column) <= 0):
                raise InputError(f"a patch law needs a finite, strictly increasing {name}")
        if self.closure.size and self.pressure[0] != 0.0:
            raise InputError("a patch law starts at zero pressure", value=self.pressure[0])

    @property
    def is_open(self) -> bool:
        """Whether the patch is touched nowhere in the law's range."""
        return self.closure.size == 0

    @property
    def range(self) -> tuple[float, float]:
        """Closures at first touch and at the end of the law's validity [mm]."""
        return self.touch, self.touch if self.is_open else float(self.closure[-1])

    @cached_property
    def _root(self) -> PchipInterpolator:
        """Interpolant of p^(2/3) over closure, the end's tangent continued beyond the table."""
        return _with_tangent(PchipInterpolator(self.closure, self.pressure ** (2 / 3)))

    @cached_property
    def _area(self) -> PchipInterpolator:
        return _with_tangent(PchipInterpolator(self.closure, self.contact_area_fraction))

    def at(self, closure: ArrayLike, *, extend: bool = False) -> tuple[Array, Array]:
        """Return pressure and stiffness, the exact derivative of the same interpolant.

        Args:
            closure: Closures of any shape [mm].
            extend: Continue p^(2/3) along its tangent beyond the table instead of raising.

        Returns:
            Pressure [MPa] and its derivative over closure [MPa/mm], in the shape of `closure`.

        Raises:
            InputError: When a closure lies beyond the table and `extend` is false.
        """
        closures = self._checked(closure, extend)
        if self.is_open:
            return np.zeros_like(closures), np.zeros_like(closures)
        inside = np.maximum(closures, self.closure[0])
        root = np.maximum(self._root(inside), 0.0)
        slope = np.where(closures > self.closure[0], self._root(inside, 1), 0.0)
        return root**1.5, 1.5 * np.sqrt(root) * slope

    def area_fraction_at(self, closure: ArrayLike, *, extend: bool = False) -> Array:
        """Return the real contact area over the nominal one.

        Args:
            closure: Closures of any shape [mm].
            extend: Go on beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the table and `extend` is false.
        """
        closures = self._checked(closure, extend)
        if self.is_open:
            return np.zeros_like(closures)
        return np.asarray(np.clip(self._area(np.maximum(closures, self.closure[0])), 0.0, 1.0))

    def contacts_at(self, closure: ArrayLike, *, extend: bool = False) -> NDArray[np.int64]:
        """Return the number of contacts of the table row at or before each closure.

        Args:
            closure: Closures of any shape [mm].
            extend: Keep the last row's number beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the table and `extend` is false.
        """
        closures = self._checked(closure, extend)
        row = np.searchsorted(self.closure, closures, side="right") - 1
        return np.where(row >= 0, np.append(self.contacts, 0)[row], 0)

    def separation_at(self, closure: ArrayLike) -> Array:
        """Return the mean gap between the plane and the patch's surface [mm]."""
        return self.reach - np.asarray(closure, dtype=float)

    def _checked(self, closure: ArrayLike, extend: bool) -> Array:
        closures = np.asarray(closure, dtype=float)
        start, end = self.range
        # The end of a table is reached up to round-off of the closure's own computation.
        if not extend and np.any(closures > end * (1 + 1e-12)):
            raise InputError(
                "closure beyond the end of the patch law",
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


def _with_tangent(interpolant: PchipInterpolator) -> PchipInterpolator:
    """Append the end's tangent as a last, unbounded piece."""
    end = interpolant.x[-1]
    piece = np.array([[0.0], [0.0], [interpolant(end, 1)], [interpolant(end)]])
    interpolant.extend(piece, np.array([end + 1.0]))
    return interpolant
