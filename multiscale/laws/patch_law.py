"""Patch laws: closure and mean pressure of a patch, tabulated over its local rigid approach.

Where a leak is asked for, a law also has the transmissivity of the face over its mean separation.

Theory: docs/theory.md, sections 10, 16 and 18.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry.spring_bed import SpringBed, coupling_of, springs_of
from patchlaw.multiscale.laws.interpolation import LawCurves, LawPoint
from patchlaw.multiscale.laws.rows import LawRows, Transmissivity, Untouched
from patchlaw.support import Array, Indices, InputError
from patchlaw.support.readable import Displayed, Table, column, of_columns, span, spread

_PLACES = np.union1d(np.linspace(0.0, 1.0, 401), np.geomspace(1e-12, 1.0, 361))
"""Places on a law, as shares of its range, that its closure under a pressure is read off between:
close to each other near first touch, where pressures are powers of the closure."""
ROUNDING = 1e-12
"""Share of the end of a table by which a converged closure or approach may exceed it."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PatchLaw(Displayed):
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
        sample_area: Nominal area that contacts are counted on [mm²]; NaN where that is the patch.
        stiffness_ratio: Mindlin's ratio of the normal to the tangential stiffness of the bodies,
            which friction takes; NaN where it is not known.
        transmissivity: What a fluid finds between the gaps; None where no leak was asked for.
        untouched: What displaces the patch before first touch; of laws that were made together.

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
    sample_area: float = float("nan")
    stiffness_ratio: float = float("nan")
    transmissivity: Transmissivity | None = None
    untouched: Untouched = field(default_factory=Untouched.nothing)

    def __post_init__(self) -> None:
        if len(self.rows) == 1:
            raise InputError("a patch law needs no row (open patch) or at least two")
        if np.any(np.diff(self.rows.approach) <= 0.0):
            raise InputError("a patch law needs a strictly increasing approach")
        if np.any(self.rows.pressure < 0.0):
            raise InputError("a patch law needs a pressure without tension")
        if len(self.rows) and self.rows.pressure[0] != 0.0:
            raise InputError("a patch law starts at zero pressure", value=self.rows.pressure[0])

    def displayed(self) -> tuple[str, Table]:
        """Return the range of the law in a line, and a table of some of its rows."""
        if self.is_open:
            return "PatchLaw of a patch that stays open", ((), ())
        rows = self.rows[np.array(spread(len(self.rows), 12))]
        line = (
            f"PatchLaw in {len(self.rows)} rows: pressure {span(self.rows.pressure, 'MPa')} at "
            f"closures {span(self.rows.closure, 'mm')}"
        )
        return line, of_columns(
            column("closure", rows.closure, "mm"),
            column("pressure", rows.pressure, "MPa"),
            column("stiffness", self.along(rows.approach).stiffness, "MPa/mm"),
            column("area", rows.contact_area_fraction, "%"),
            ["contacts", *map(str, rows.contacts)],
        )

    @property
    def is_open(self) -> bool:
        """Whether the patch is touched nowhere in the law's range."""
        return len(self.rows) == 0

    @property
    def is_function(self) -> bool:
        """Whether the pressure is a function of closure in the whole range of the law."""
        return self.rising_rows == len(self.rows)

    @property
    def is_flat(self) -> bool:
        """Whether closure falls from first touch on, as it does over a flat patch taken alone.

        Then the pressure is a function of closure nowhere.
        """
        return not self.is_open and self.rising_rows == 1

    @property
    def range(self) -> tuple[float, float]:
        """Closures between which the pressure is a function of closure [mm].

        The first is that of first touch.
        """
        end = self.first_touch if self.is_open else float(self.rows.closure[self.rising_rows - 1])
        return self.first_touch, end

    @cached_property
    def _alone(self) -> PatchLaws:
        return PatchLaws((self,))

    @property
    def curves(self) -> LawCurves:
        """The interpolants of the law over the local approach."""
        return self._alone.curves

    def along(self, approach: ArrayLike) -> LawPoint:
        """Return what the law gives at local rigid approaches of any shape.

        Args:
            approach: Local rigid approaches [mm].
        """
        return self.curves.at(0, np.asarray(approach, dtype=float))

    def at(self, closure: ArrayLike, *, extend: bool = False) -> LawPoint:
        """Return what the law gives at closures of any shape.

        Args:
            closure: Closures [mm].
            extend: Whether to continue along the tangent beyond the table instead of raising.

        Raises:
            InputError: When a closure lies beyond the law's range and `extend` is false.
        """
        return self._alone.at(0, np.asarray(closure, dtype=float), extend=extend)

    def pressure(self, closure: ArrayLike) -> Array:
        """Return the pressure at any closure, as an iteration needs it [MPa].

        Beyond the table it continues along the tangent: whoever uses it checks the converged
        closures with `at`.
        """
        return self.at(closure, extend=True).pressure

    def closure_under(self, pressure: ArrayLike) -> Array:
        """Return the closures under pressures of any shape, at most the last one [mm].

        Args:
            pressure: The pressures [MPa].
        """
        return np.asarray(np.interp(np.asarray(pressure, float), *self._places))

    @cached_property
    def _places(self) -> tuple[Array, Array]:
        """Pressures and closures that `closure_under` reads off between."""
        start, end = self.range
        closures = start + (end - start) * _PLACES
        return self.pressure(closures), closures

    def stiffness(self, closure: ArrayLike) -> Array:
        """Return the derivative of `pressure` over the closure [MPa/mm]."""
        return self.at(closure, extend=True).stiffness

    def interface_stiffness(self, point: LawPoint) -> Array:
        """Return the derivative −dp/dū over the mean gap ū at points of the law [MPa/mm].

        It differs from `stiffness` by plastic depth, and by what else displaces the surface under
        a patch than the macro model.

        Args:
            point: What the law gives there.
        """
        return self.curves.interface_stiffness(0, point)

    @cached_property
    def springs(self) -> SpringBed:
        """The springs behind the law, which give its shear stresses under friction."""
        if self.is_open:
            return springs_of(self.pressure, self.stiffness, *self.range)
        rows = self.rows[: self.rising_rows]

        def coupling(closure: Array) -> Array:
            return coupling_of(np.interp(closure, rows.closure, rows.contacts))

        return springs_of(self.pressure, self.stiffness, *self.range, coupling=coupling)

    def pressure_scatter(self, closure: ArrayLike) -> Array:
        """Return the standard deviation of the pressure among the samples of the law [MPa].

        Args:
            closure: Closures of any shape [mm]; beyond the rows it stays that of the last one.
        """
        closures = np.asarray(closure, dtype=float)
        if self.is_open:
            return np.zeros(closures.shape)
        rows = self.rows[: self.rising_rows]
        return np.interp(closures, rows.closure, rows.pressure_scatter, left=0.0)

    def transmissivities(self, closure: ArrayLike) -> Array:
        """Return the transmissivities along x and y at closures, shape (n, 2) [mm³].

        Args:
            closure: Closures, shape (n,) [mm]; beyond the rows the tangents continue.

        Raises:
            InputError: When the law knows none.
        """
        if self.transmissivity is None:
            raise InputError(
                "the law has no transmissivity",
                allowed="a law made with leak = True, or in a scene with [leak]",
            )
        return self.transmissivity.at(self.at(closure, extend=True).separation)

    def multiplied(self, factor: float) -> PatchLaw:
        """Return the law with other pressures at the same closures.

        Args:
            factor: What they are multiplied by.
        """
        return replace(self, rows=replace(self.rows, pressure=factor * self.rows.pressure))

    def shifted(self, distance: float) -> PatchLaw:
        """Return the law with approach and closure counted from a plane that is higher.

        Args:
            distance: How much higher it is [mm].
        """
        rows = self.rows
        return replace(
            self,
            rows=replace(rows, approach=rows.approach + distance, closure=rows.closure + distance),
            first_touch=self.first_touch + distance,
            untouched=replace(self.untouched, closure=self.untouched.closure + distance),
            initial_separation=self.initial_separation + distance,
        )

    @cached_property
    def rising_rows(self) -> int:
        """Number of rows before closure stops rising."""
        stops = np.flatnonzero(np.diff(self.rows.closure) <= 0.0)
        return int(stops[0]) + 1 if stops.size else len(self.rows)


class PatchLaws:
    """N patch laws, evaluated together: a `ContactLaws` of `macro`.

    Args:
        laws: The laws, in the order of the flat patch index.

    Attributes:
        laws: The laws.
        first_touch: Closures at first touch, infinite where there is nothing to touch, (N,) [mm].
        end: Local approaches up to which the laws are valid, shape (N,) [mm].
    """

    def __init__(self, laws: Sequence[PatchLaw]) -> None:
        self.laws = tuple(laws)
        self._index = np.arange(len(laws))
        rows, separations = [law.rows for law in laws], [law.initial_separation for law in laws]
        every = rows[0].joined(*rows[1:])
        untouched = [law.untouched for law in laws]
        self.curves = LawCurves.through(every, list(map(len, rows)), separations, untouched)
        self.first_touch = np.array([law.first_touch for law in laws])
        # without rows the local approach is the closure
        self.end = np.array(
            [law.first_touch if law.is_open else law.rows.approach[-1] for law in laws]
        )

    def __len__(self) -> int:
        return len(self.laws)

    def along(self, approach: Array) -> LawPoint:
        """Return what the laws give at local approaches, shape (N,) [mm]."""
        return self.curves.at(self._index, approach)

    def at(
        self,
        patch: Indices | int,
        closure: Array,
        depth: Array | None = None,
        *,
        extend: bool = False,
    ) -> LawPoint:
        """Return what laws give at closures, as `PatchLaw.at` does for one.

        Args:
            patch: Flat patch indices, shape (n,), or the patch of all closures.
            closure: Closures there, shape (n,) [mm].
            depth: Worn depths, of which these laws take no notice.
            extend: Whether to continue along the tangents beyond the tables instead of raising.

        Raises:
            InputError: When a closure lies beyond the range of its law and `extend` is false.
        """
        beyond = np.zeros(0, bool) if extend else closure > self._ends[patch]
        if beyond.any():
            of_each = np.broadcast_to(patch, np.shape(closure))
            first = int(of_each[beyond][0])
            law, problem = self.laws[first], "closure beyond the end of the patch law"
            if not law.is_function:
                problem += ", where pressure stops being a function of closure"
            start, end = law.range
            raise InputError(
                problem,
                value=float(closure[of_each == first].max()),
                allowed=f"closure up to {end:.6g} mm (first touch at {start:.6g} mm)",
            )
        return self.curves.rising.at_closure(patch, closure)

    def interface_stiffness(self, point: LawPoint, patch: Indices | None = None) -> Array:
        """Return −dp/dū at points of the laws of patches, or of one for each, as of `PatchLaw`."""
        return self.curves.interface_stiffness(self._index if patch is None else patch, point)

    def transmissivities(self, separation: Array, cause: str | None = None) -> Array:
        """Return the transmissivities of all laws along x and y, shape (N, 2) [mm³].

        Args:
            separation: Mean gaps, shape (N,) [mm].
            cause: As for `Transmissivity.varied`.
        """
        found = []
        for law, one in zip(self.laws, separation[:, None], strict=True):
            assert law.transmissivity is not None
            found.append(law.transmissivity.varied(cause, one))
        return np.concatenate(found)

    def pressures(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return pressures at closures of patches, with tangents beyond the tables, (n,) [MPa]."""
        return self.at(patch, closure, extend=True).pressure

    def stiffnesses(self, patch: Indices, closure: Array, depth: Array) -> Array:
        """Return the derivatives of `pressures` over the closures, shape (n,) [MPa/mm]."""
        return self.at(patch, closure, extend=True).stiffness

    def rates(self, patch: Indices, closure: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Return pressures and stiffnesses, by which wear lessens them; see `ContactLaws.rates`."""
        point = self.at(patch, closure, extend=True)
        return point.pressure, point.stiffness, point.stiffness

    @cached_property
    def _ends(self) -> Array:
        """Ends of the tables, with the rounding that converged closures may exceed them by."""
        ends = np.array([law.range[1] for law in self.laws])
        return np.asarray(ends + ROUNDING * np.abs(ends))


def repaired_law(law: PatchLaw) -> PatchLaw:
    """Return a law whose pressure rises; the same one where it does.

    Args:
        law: The law of a patch alone, as a table from elsewhere may have it.
    """
    if np.all(np.diff(law.rows.pressure) >= 0.0):
        return law
    rows, change = law.rows.with_rising_pressure()
    return replace(law, rows=rows, repaired=max(change, law.repaired))
