"""Patch laws on a block of which only the compliance under the patches is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.rigid_plane import Control
from multiscale.couplings.dense_newton import DenseNewton, DenseState
from multiscale.couplings.load_steps import beyond_law, embedded_step
from multiscale.laws.files import LawTable
from multiscale.laws.packed import PatchLaws
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.storage.serialisation import Arrays, packed, unpacked

Array = NDArray[np.float64]

_ROUNDING = 1e-12  # of a law's end: it is reached up to the rounding of an iteration


class CondensedCoupling:
    """The block is linear: under patchwise laws it is its compliance, and a load step is dense.

    Args:
        table: The laws.
        compliance: Mean displacement of patch i of the block by unit pressure on patch j, shape
            (N, N) [mm/MPa].

    Raises:
        InputError: When the compliance does not fit the patches.
    """

    def __init__(self, table: LawTable, compliance: Array) -> None:
        self._patches, self._made_for = table.patches, table.made_by.get("coupling")
        self._laws = PatchLaws(table.laws)
        self._newton = DenseNewton(self._laws, compliance, table.patches)
        self._last: DenseState | None = None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""
        state = self._newton.solve(control, self._last)
        self._check_range(control, state.local)
        self._last = state
        return self._step(state)

    def state(self) -> Arrays:
        """Return the latest equilibrium; see `Restorable`."""
        return packed(self._last)

    def restore(self, state: Arrays) -> None:
        """Go on from an equilibrium; see `Restorable`."""
        self._last = unpacked(state, (DenseState,))

    def _check_range(self, control: Control, local: Array) -> None:
        """Refuse a state that stands on what was made up beyond the end of a law."""
        over = local > self._laws.end * (1.0 + _ROUNDING)
        if over.any():
            worst = int(np.argmax(np.where(over, local - self._laws.end, -np.inf)))
            raise beyond_law(
                control,
                f"patch {self._patches.unravel(worst)} at a local approach of "
                f"{local[worst]:.6g} mm (allowed: up to {self._laws.end[worst]:.6g} mm)",
                self._made_for,
            )

    def _step(self, state: DenseState) -> LoadStep:
        return embedded_step(
            self._patches,
            approach=state.plane[0],
            tilt=state.plane[1:],
            moment=state.load[1:],
            force=state.load[0],
            mean_separation_mm=float(np.mean(self._laws.separation(state.local))),
            contacts=int(self._laws.contacts(state.local).sum()),
            newton_iterations=state.iterations,
            linear_iterations=0,
            reason="CONVERGED",
            patches=PatchState(
                closure_mm=state.closure,
                pressure_MPa=state.pressure,
                contact_area_fraction=self._laws.area_fraction(state.local),
            ),
            residuals=state.residuals,
        )
