"""Patch laws on a block of which only the compliance under the patches is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.control import Control
from multiscale.dense_newton import DenseNewton, DenseState
from multiscale.history import LoadStep
from multiscale.law_files import LawTable

Array = NDArray[np.float64]

_ROUNDING = 1e-12  # of a law's range: its end is reached up to the rounding of an iteration


class CondensedCoupling:
    """The block is linear: under patchwise laws it is its compliance, and a load step is dense.

    Args:
        table: The laws.
        compliance: Mean displacement of patch i by unit pressure on patch j, (N, N) [mm/MPa].

    Raises:
        InputError: When the compliance does not fit the patches.
    """

    def __init__(self, table: LawTable, compliance: Array) -> None:
        self._table = table
        self._laws = table.packed
        self._newton = DenseNewton(self._laws, compliance, table.patches)
        self._last: DenseState | None = None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""
        state = self._newton.solve(control, self._last)
        self._check_range(control, state)
        self._last = state
        return self._step(state)
