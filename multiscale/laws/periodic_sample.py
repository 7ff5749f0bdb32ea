"""One periodic sample of a rough face under planes at prescribed mean separations.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from patchlaw.geometry import Control
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro import HalfSpaceModel, Start, press_along
from patchlaw.support.arrays import Array

FULL_CONTACT = 0.01
"""Compliance of a law in full contact, relative to its mean one up to there. The interface itself
has none left; without any, the pressure would be no function of closure."""

_NEARLY_FULL = 0.8
"""Contact area fraction from which on the law of a sample with finite slopes may have ended; the
least one where the approach turned back was 0.89."""
_ROUNDING = 1e-12
"""Separations that differ by no more, over the largest, are one."""
_MOST = 0.9
"""Largest mean pressure under which finite slopes are solved for, over the Young's modulus."""
_PART = 2e-3
"""Error of the mean pressure where such a law ends, over that which closes the flat sample."""


class SampleRow(NamedTuple):
    """What one sample gives at one separation.

    Attributes:
        pressure: Mean pressure [MPa].
        contact_area_fraction: Real over nominal contact area.
        contacts: Number of contacts.
        outside_range: Whether the model warned that it is outside its range of validity.
    """

    pressure: float = 0.0
    contact_area_fraction: float = 0.0
    contacts: int = 0
    outside_range: bool = False


class Closed(NamedTuple):
    """Where the law of a sample ends.

    Attributes:
        separation: The mean separation of the undeformed planes [mm].
        row: What the sample gives there.
    """

    separation: float
    row: SampleRow


@dataclass(frozen=True, eq=False)
class PeriodicSample:
    """A sample that continues periodically on a half-space.

    Its displacements count from their mean, so that the mean separation is z_M less the mean height
    and the approach.

    Args:
        model: Its periodic model.
        error: Error of the pressures of rows that does no harm, over them.
    """

    model: HalfSpaceModel
    error: float = 0.0
    _starts: dict[float, Start] = field(default_factory=dict, init=False)

    @property
    def quick(self) -> bool:
        """Whether its rows take so little that one rank solves them all."""
        return self.model.quick_up_to(Control(approach=self.reference)) is not None

    @property
    def _rough_model(self) -> HalfSpaceModel:
        return replace(self.model, tolerance=max(self.model.tolerance, self.error))

    @property
    def area(self) -> float:
        """Nominal area [mm²]."""
        return self.model.surface.area

    @property
    def reference(self) -> float:
        """Separation at zero approach, z_M less the mean height [mm]."""
        return self.model.reference_height - self.model.surface.mean_height

    @property
    def first_touch(self) -> float:
        """Separation at first touch of a cell [mm]."""
        return self.reference - self.model.first_touch

    @property
    def yields(self) -> bool:
        """Whether its pressures are bounded by a hardness; then no load closes all gaps."""
        return self.model.hardness is not None

    @cached_property
    def closed(self) -> Closed:
        """Where the law of the sample ends.

        It is full contact, at a separation of 0. Under a hardness the plane is at the mean plane
        there. Of a sample with finite slopes the separation falls as long as the pressure rises
        until shortly before full contact, when it is a little below 0; its law ends where the
        compliance is a hundredth of the mean one.
        """
        model = self.model
        if self.yields:
            state = model.press(Control(approach=self.reference))
            return Closed(0.0, self._row(state))
        if not model.slopes:
            return Closed(0.0, SampleRow(self._flattening_pressure(), 1.0, 1))
        flat = PeriodicSample(replace(model, slopes=()))
        young = min(one.material.young_modulus for one in model.slopes)
        most = min(flat.closed.row.pressure, _MOST * young)
        least = FULL_CONTACT * self.first_touch / most
        states: dict[float, ContactState] = {}

        def above(pressure: float) -> float:
            """Return the separation, and what the law in full contact would take off it."""
            near = min(states, key=lambda known: abs(known - pressure), default=None)
            start = None if near is None else states[near].guess
            control = Control(force=pressure * self.area)
            states[pressure] = self._rough_model.press(control, start=start)
            return least * pressure - states[pressure].approach

        options = {"xatol": _PART * most}
        end = minimize_scalar(above, bounds=(0.0, most), method="bounded", options=options).x
        return Closed(self.reference - states[end].approach, self._row(states[end]))

    def _flattening_pressure(self) -> float:
        """Return the mean pressure that just closes a sample of small slopes [MPa].

        In full contact pressures differ from their mean by what flattens the sample, whatever the
        mean.
        """
        surface = self.model.surface
        slopes = np.gradient(surface.heights, *surface.spacing)
        pressure = self.model.contact_modulus * float(np.sqrt(np.mean(np.square(slopes))))
        while True:
            pressure *= 2.0
            cells = self.model.press(Control(force=pressure * self.area)).pressures
            if cells.min() > 0.0:
                return float(cells.mean() - cells.min())

    def separation_under(self, pressure: float) -> float:
        """Return the mean separation under a mean pressure [mm], no less than that of `closed`.

        Args:
            pressure: The mean pressure [MPa].
        """
        model = self.model
        if model.hardness is not None and pressure >= model.hardness:
            return 0.0
        if any(pressure >= _MOST * one.material.young_modulus for one in model.slopes):
            return self.closed.separation
        state = self._rough_model.press(Control(force=pressure * self.area))
        if not self.yields and state.pressures.min() > 0.0:  # what is left is rounding
            return self.closed.separation if model.slopes else 0.0
        nearly = bool(model.slopes) and state.contact_area_fraction > _NEARLY_FULL
        if nearly and pressure >= self.closed.row.pressure:
            return self.closed.separation
        if self.quick:
            self._starts[state.approach] = state.guess
        separation = self.reference - state.approach
        return separation if model.slopes else max(separation, 0.0)

    def rows(self, separations: Array, closed: Closed | None) -> list[SampleRow]:
        """Return rows at separations, each solved from those next to it.

        Args:
            separations: Mean separations, falling [mm].
            closed: Where its law ends; None where no separation is that small.
        """
        end = -np.inf
        if closed is not None and not self.yields:
            end = closed.separation + _ROUNDING * self.reference
        approaches = {
            separation: float(self.reference - separation)
            for separation in separations.tolist()
            if end < separation < self.first_touch
        }
        states = press_along(self._rough_model, list(approaches.values()), known=self._starts)
        if self.quick:
            self._starts.update((state.approach, state.guess) for state in states)
        found = {one: self._row(state) for one, state in zip(approaches, states, strict=True)}
        if closed is not None:
            found |= {one: closed.row for one in separations.tolist() if one <= end}
        return [found.get(one, SampleRow()) for one in separations.tolist()]

    @staticmethod
    def _row(state: ContactState) -> SampleRow:
        return SampleRow(
            pressure=state.mean_pressure,
            contact_area_fraction=state.contact_area_fraction,
            contacts=state.contacts,
            outside_range=bool(state.warning),
        )
