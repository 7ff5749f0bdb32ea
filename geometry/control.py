"""What is prescribed of the rigid plane at a load step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """Approach or force, and tilt or zero moment, of the rigid plane at one load step.

    Args:
        approach: Approach at the middle of the interface, from first touch [mm]; None when the
            force is prescribed.
        force: Normal force, ≥ 0 [N]; None when the approach is prescribed.
        tilt: Slopes (tx, ty) of the approach about the middle of the interface [mm/mm]; None lets
            the plane turn until the pressures have no moment about the middle.

    Raises:
        InputError: When not exactly one of approach and force is given, or a number is not finite
            or the force negative.
    """

    approach: float | None = None
    force: float | None = None
    tilt: tuple[float, float] | None = (0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.approach is None) == (self.force is None):
            raise InputError(
                "a load step prescribes either the approach or the force",
                value=(self.approach, self.force),
                allowed="exactly one of them",
            )
        if self.approach is not None and not np.isfinite(self.approach):
            raise InputError("the approach must be finite", value=self.approach, allowed="mm")
        if self.force is not None and not (np.isfinite(self.force) and self.force >= 0.0):
            raise InputError("the force must not be negative", value=self.force, allowed="≥ 0 N")
        if self.tilt is not None and not np.all(np.isfinite(self.tilt)):
            raise InputError(
                "the tilt must be two finite slopes", value=self.tilt, allowed="(tx, ty) in mm/mm"
            )
