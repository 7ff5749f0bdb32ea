"""What pressures of a body have to meet: their bounds and the loads of its free motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """Bounds 0 ≤ p ≤ H and loads of free motions.

    Args:
        motions: Motions of the body that are free, with their loads; none when not given.
        upper: Upper bound H of the pressures / E*.
    """

    motions: Motions | None = None
    upper: float = np.inf

    @property
    def turns(self) -> bool:
        """Whether slopes of the body are free."""
        return self.motions is not None and self.motions.turns

    @property
    def unloaded(self) -> bool:
        """Whether all free motions are without load: the approach is prescribed, not the tilt."""
        return self.motions is not None and not self.motions.loads.any()

    def met(self, pressure: Array, fixed: Flags | None = None) -> Array | None:
        """Return pressures within their bounds that meet the loads.

        Args:
            pressure: Pressures / E* ≥ 0 that may miss both, shape (nx, ny).
            fixed: Cells whose pressures stay as they are if that can be, shape (nx, ny).

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if self.motions is None:
            return pressure if self.upper == np.inf else np.minimum(pressure, self.upper)
        found = None
        if fixed is not None:
            found = self.motions.scaled_to_loads(pressure, self.upper, fixed)
        return self.motions.scaled_to_loads(pressure, self.upper) if found is None else found
