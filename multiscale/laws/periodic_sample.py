"""One periodic sample of a rough face under planes at prescribed mean separations.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Control
from micro import HalfSpaceModel, Start, press_along

Array = NDArray[np.float64]


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

    def full_contact_pressure(self) -> float:
        """Return the mean pressure that just closes the sample [MPa].

        In full contact pressures differ from their mean by what flattens the sample, whatever the
        mean. Under a hardness it is the mean pressure at a separation of 0.
        """
        surface = self.model.surface
        if self.yields:
            return self.model.press(Control(approach=self.reference)).force / self.area
        slopes = np.gradient(surface.heights, *surface.spacing)
        pressure = self.model.contact_modulus * float(np.sqrt(np.mean(np.square(slopes))))
        while True:
            pressure *= 2.0
            cells = self.model.press(Control(force=pressure * self.area)).pressures
            if cells.min() > 0.0:
                return float(cells.mean() - cells.min())

    def separation_under(self, pressure: float) -> float:
        """Return the mean separation under a mean pressure [mm]; exactly 0 in full contact.

        Args:
            pressure: The mean pressure [MPa].
        """
        if self.model.hardness is not None and pressure >= self.model.hardness:
            return 0.0
        state = self._rough_model.press(Control(force=pressure * self.area))
        if not self.yields and state.pressures.min() > 0.0:  # what is left is rounding
            return 0.0
        if self.quick:
            self._starts[state.approach] = state.guess
        return max(self.reference - state.approach, 0.0)

    def rows(self, separations: Array, full: float) -> list[SampleRow]:
        """Return rows at separations, each solved from those next to it.

        Args:
            separations: Mean separations, falling [mm].
            full: Mean pressure that just closes the sample, for a separation of 0 [MPa].
        """
        approaches = {
            separation: float(self.reference - separation)
            for separation in separations.tolist()
            if separation < self.first_touch and (separation > 0.0 or self.yields)
        }
        states = press_along(self._rough_model, list(approaches.values()), known=self._starts)
        if self.quick:
            self._starts.update((state.approach, state.guess) for state in states)
        found = {
            separation: SampleRow(
                pressure=state.mean_pressure,
                contact_area_fraction=state.contact_area_fraction,
                contacts=state.contacts,
                outside_range=bool(state.warning),
            )
            for separation, state in zip(approaches, states, strict=True)
        }
        closed = {0.0: SampleRow(full, 1.0, 1)}
        return [(found.get(one) or closed.get(one) or SampleRow()) for one in separations.tolist()]
