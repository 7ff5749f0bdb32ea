"""Patch laws under a plane that turns as it did where they were made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from geometry.rigid_plane import Control, RigidPlane
from multiscale.couplings.load_steps import beyond_law, embedded_step
from multiscale.laws.files import LawTable
from multiscale.laws.packed import PatchLaws
from multiscale.laws.whole_surface import Displacements
from multiscale.loading.load_step import LoadStep, PatchState

Array = NDArray[np.float64]

_ROUNDING = 1e-12  # of the end of the laws
_OTHER_BODY = 0.05
"""Share of the largest local approach that closures may miss where laws are made for the macro
model; between their rows they miss hundredths of it."""


class TurningCoupling:
    """Consistent laws of a plane without moment.

    The contacts balance such a plane, and not the mean pressures of patches at their centres: laws
    of few large patches do not tell how it turns, and a single one not at all. So it turns as it
    did in the rows of the laws, which the macro model finds again because they were made for it:
    under that plane their pressures are in equilibrium with the displacements that they cause.

    Args:
        table: The laws, with the path of the plane.
        displacements: Mean displacements of the patches by their pressures in the macro model.
            Collective.

    Raises:
        ValueError: When the laws have no path.
    """

    def __init__(self, table: LawTable, displacements: Displacements) -> None:
        if table.path is None:
            raise ValueError("the laws were made under a plane of given tilt")
        self._patches, self._path = table.patches, table.path
        self._made_for = table.made_by.get("coupling")
        self._laws = PatchLaws(table.laws)
        self._displacements = displacements

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `Coupling.press`.

        Raises:
            NotConverged: Also when the laws were made for another macro model.
        """
        approach, steps = control.approach, 0
        if approach is None:
            approach, steps = self._path.approach_under(control.force or 0.0, self._force)
        end = float(self._path.approach[-1])
        if approach > end + _ROUNDING * abs(end):
            raise beyond_law(
                control,
                f"the plane at an approach of {approach:.6g} mm (allowed: up to {end:.6g} mm)",
                self._made_for,
            )
        return self._step(control, approach, steps)

    def _along(self, approach: float) -> Array:
        return np.full(self._patches.count, approach)

    def _force(self, approach: float) -> float:
        return self._patches.area * float(self._laws.along(self._along(approach)).pressure.sum())

    def _step(self, control: Control, approach: float, steps: int) -> LoadStep:
        along, tilt = self._along(approach), self._path.tilt_at(approach)
        point = self._laws.along(along)
        local = RigidPlane.above(self._patches, approach, tilt).means(self._patches)
        closure = local - self._displacements(point.pressure[None])[0]
        touched = point.pressure > 0.0
        missed = np.abs(np.where(touched, closure - point.closure, 0.0)).max()
        missed /= float(np.abs(local).max()) or 1.0
        if missed > _OTHER_BODY:
            raise NotConverged(
                f"the patches at {control}",
                reason="OTHER_BODY",
                iterations=0,
                remedy=f"their closures miss {missed:.1%} of the approach: make the laws for this "
                "block and mesh",
            )
        force = self._force(approach)
        return embedded_step(
            self._patches,
            approach=approach,
            tilt=tilt,
            moment=self._path.moment_at(approach),
            force=force,
            mean_separation_mm=float(np.mean(self._laws.separation(along))),
            contacts=int(self._laws.contacts(along).sum()),
            newton_iterations=steps,
            linear_iterations=0,
            reason="CONVERGED",
            patches=PatchState(
                closure_mm=closure,
                pressure_MPa=point.pressure,
                contact_area_fraction=self._laws.area_fraction(along),
            ),
            residuals=(float(missed),),
        )
