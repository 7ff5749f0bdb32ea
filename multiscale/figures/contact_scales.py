"""The ends of colour scales that maps of several contacts share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from patchlaw.multiscale.readable import usual_unit

_MOST = 0.99
"""Share of the loaded cells within the scale of pressures: few cells carry the largest ones."""


class ContactScales(NamedTuple):
    """Ends of the colour scales of contacts; 0 where there is nothing to show.

    Attributes:
        pressure: Of contact pressures [MPa].
        gap: Of gaps outside the contact [mm].
        depth: Of plastic depths [mm].
        spot: Of the largest pressures of spots [MPa].
    """

    pressure: float
    gap: float
    depth: float
    spot: float

    @property
    def pressure_unit(self) -> tuple[str, float]:
        """The unit of all pressures in a figure, and its size: that which suits the largest."""
        return usual_unit([self.pressure, self.spot], "MPa")

    @classmethod
    def of(cls, records: Iterable[Any]) -> ContactScales:
        """Return scales that suit all of some contacts.

        Args:
            records: Records of `multiscale.results.contacts.ContactRecord`.
        """
        ends = np.zeros((1, 4))
        for record in records:
            spot = np.max(record.peak_pressure_MPa, initial=0.0)
            pressure = gap = depth = 0.0
            if record.pressure_MPa is not None:
                loaded = np.asarray(record.pressure_MPa) > 0.0
                open_gap = np.asarray(record.gap_mm)[~loaded]
                gap = np.max(open_gap, initial=0.0)
                if loaded.any():
                    pressure = np.quantile(np.asarray(record.pressure_MPa)[loaded], _MOST)
            if record.plastic_depth_mm is not None:
                depth = np.max(record.plastic_depth_mm, initial=0.0)
            ends = np.vstack([ends, (pressure, gap, depth, spot)])
        return cls(*ends.max(axis=0).tolist())
