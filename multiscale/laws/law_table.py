"""The laws of all patches of an interface, and what they say of themselves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from geometry.errors import InputError
from geometry.patches import PatchGrid
from multiscale.laws.interpolation import LawCurves, LawPoint
from multiscale.laws.patch_law import PatchLaw

Array = NDArray[np.float64]

PATCH_FACTOR = 20.0
"""Tolerance of a patch's pressure over that of the force."""

_APPROACH_TOLERANCE = 1e-15  # of an approach under a force, relative to the length of the path
_REPORTED_REPAIR = 1e-6  # smaller repairs are rounding and the tolerance of the micro model
_CLOSURE_AND_PRESSURE = slice(0, 2)  # among the curves of a law


class ContactValues(NamedTuple):
    """What laws give beside pressure and closure; every field has the shape (N,).

    Attributes:
        area_fraction: Real over nominal contact areas.
        separation: Mean gaps between the plane and the displaced surface [mm].
        contacts: Numbers of contacts.
    """

    area_fraction: Array
    separation: Array
    contacts: NDArray[np.int64]


class PatchLaws:
    """N patch laws, evaluated together at one local approach each.

    Args:
        laws: The laws, in the order of the flat patch index.

    Attributes:
        first_touch: Closures at first touch, infinite where there is nothing to touch, (N,) [mm].
        end: Local approaches up to which the laws are valid, shape (N,) [mm].
    """

    def __init__(self, laws: Sequence[PatchLaw]) -> None:
        self._index = np.arange(len(laws))
        self._curves = LawCurves.packed([law.curves for law in laws])
        self._contacts = np.zeros(self._curves.origins.shape, dtype=np.int64)
        for counts, law in zip(self._contacts, laws, strict=True):
            counts[1 : len(law.rows) + 1] = law.rows.contacts
        self._initial_separation = np.array([law.initial_separation for law in laws])
        self.first_touch = np.array([law.first_touch for law in laws])
        # without rows the local approach is the closure
        self.end = np.array(
            [law.first_touch if law.is_open else law.rows.approach[-1] for law in laws]
        )

    def along(self, approach: Array) -> LawPoint:
        """Return closures, pressures and their derivatives at local approaches, shape (N,)."""
        return LawPoint.of(*self._curves.at(self._index, approach, _CLOSURE_AND_PRESSURE))

    def contact(self, approach: Array) -> ContactValues:
        """Return area fractions, separations and contacts at local approaches of shape (N,).

        Contacts are those of the rows at or before the approaches.
        """
        (closure, _, area, displacement), _ = self._curves.at(self._index, approach)
        row = self._curves.rows_passed(self._index, approach)
        return ContactValues(
            area_fraction=np.asarray(np.clip(area, 0.0, 1.0)),
            separation=np.asarray(self._initial_separation - closure + displacement),
            contacts=self._contacts[self._index, row],
        )


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

    approach: Array
    tilt: Array
    force: Array
    moment: Array

    def __post_init__(self) -> None:
        count = len(self.approach)
        shapes = {"approach": (count,), "tilt": (count, 2), "force": (count,), "moment": (count, 2)}
        for name in (one.name for one in fields(self)):
            values = getattr(self, name)
            if not count or values.shape != shapes[name] or not np.all(np.isfinite(values)):
                raise InputError(
                    f"a path needs a finite {name}", value=values.shape, allowed=f"{shapes[name]}"
                )
        if np.any(np.diff(self.approach) <= 0.0):
            raise InputError("a path needs a strictly increasing approach")

    def tilt_at(self, approach: float) -> tuple[float, float]:
        """Return the slopes at an approach; beyond both ends they are those of the end."""
        return self._interpolated(self.tilt, approach)

    def moment_at(self, approach: float) -> tuple[float, float]:
        """Return the moments at an approach [N mm]."""
        return self._interpolated(self.moment, approach)

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
        found, report = brentq(
            # powers of 2/3 are nearly straight over the approach (Hertz)
            lambda approach: force_at(approach) ** (2 / 3) - force ** (2 / 3),
            first,
            last,
            xtol=_APPROACH_TOLERANCE * (last - first),
            full_output=True,
        )
        return float(found), report.function_calls + 1

    def _interpolated(self, values: Array, approach: float) -> tuple[float, float]:
        x, y = values[0]
        if len(self.approach) > 1:
            within = np.clip(approach, self.approach[0], self.approach[-1])
            x, y = PchipInterpolator(self.approach, values)(within)
        return float(x), float(y)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawTable:
    """The laws of all patches of an interface.

    Attributes:
        patches: The partition.
        laws: One law per patch, in the order of the flat patch index.
        made_by: How they were made: coupling, micro model, Love's displacement, tolerance, and the
            slopes of the plane that pressed the whole surface.
        force_error: Estimated error of the force between the rows, see
            `multiscale.laws.refinement`: of all patches together, or the largest where each was
            tabulated alone.
        path: The planes that pressed the whole surface, where they were free to turn; None where
            the tilt was prescribed, and for patches alone.

    Raises:
        InputError: When there is not one law per patch.
    """

    patches: PatchGrid
    laws: tuple[PatchLaw, ...]
    made_by: dict[str, str]
    force_error: float = float("nan")
    path: PlanePath | None = None

    def __post_init__(self) -> None:
        if len(self.laws) != self.patches.count:
            raise InputError("needs one law per patch", value=len(self.laws))

    def __getitem__(self, index: int) -> PatchLaw:
        return self.laws[index]

    def notes(self, tolerance: float) -> Iterator[str]:
        """Yield what a report says of the laws: their errors, and whether they were repaired.

        Args:
            tolerance: Error of the force that was asked for.
        """
        largest = max(law.interpolation_error for law in self.laws)
        yield (
            f"interpolation error of the laws between their rows: {self.force_error:.1e} of the "
            f"force, {largest:.1e} of a patch's pressure or the mean, if more"
        )
        reached = max(self.force_error, largest / PATCH_FACTOR)
        if reached > tolerance:
            yield (
                f"the laws miss coupling.table_tolerance = {tolerance:g} with all the rows that "
                f"are solved at most; what they reach is a tolerance of {reached:.1e}"
            )
        changes = [law.repaired for law in self.laws if law.repaired > _REPORTED_REPAIR]
        if changes:
            yield (
                f"monotone repair: in the laws of {len(changes)} of {len(self.laws)} patches "
                "pressure or closure fell as the plane came nearer; evened out, by up to "
                f"{max(changes):.1e} of their largest"
            )
