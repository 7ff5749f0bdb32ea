"""What leaks at one load step, along one way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

WAYS: Mapping[str, str] = MappingProxyType(
    {"x": "along x", "y": "along y", "face": "over the contact face"}
)
"""Where a fluid may flow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Leak:
    """The leak along one way.

    Attributes:
        way: A key of `WAYS`.
        rate: Flow rate from the first side, or the inlet, to the opposite one, or the outlet; 0
            where the gap is closed [mm³/s].
        error: Error of the flow rate; None where it was not measured [mm³/s].
        causes: Causes of the error, and how much each may change the flow rate [mm³/s]; empty where
            they were not measured, and where the leak was read back.
        transmissivity: T = 12 η Q L/(W ΔP) of the gap; None over a contact face [mm³].
        flow_factor: T/ḡ³ of the mean separation ḡ; None over a contact face, and without a gap.
        constriction: Part of the flow through the channel of the narrowest constriction; None where
            nothing flows, and where gaps of cells are not known.
    """

    way: str
    rate: float
    error: float | None = None
    causes: tuple[tuple[str, float], ...] = ()
    transmissivity: float | None = None
    flow_factor: float | None = None
    constriction: float | None = None

    @property
    def hydraulic_gap(self) -> float | None:
        """Gap between parallel plates that lets as much through, T^(1/3) [mm]."""
        return None if self.transmissivity is None else float(np.cbrt(self.transmissivity))

    @property
    def percolates(self) -> int:
        """1 where an open path leads through the gap, 0 where it is closed."""
        return int(self.rate != 0.0)

    def with_errors(self, causes: Mapping[str, float]) -> Leak:
        """Return the leak with its error, the sum of its causes.

        Args:
            causes: How much each may change the flow rate [mm³/s].
        """
        return Leak(
            way=self.way,
            rate=self.rate,
            error=sum(causes.values()),
            causes=tuple(causes.items()),
            transmissivity=self.transmissivity,
            flow_factor=self.flow_factor,
            constriction=self.constriction,
        )
