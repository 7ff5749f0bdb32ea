"""Consistent laws under a plane without moment, which turns as it did in their rows.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

import numpy as np

from geometry import Control, NotConverged, RigidPlane
from micro.model import Stiffness
from multiscale.law_solvers.law_solver import ROUNDING, LawSolver
from multiscale.laws.consistent import Displacements
from multiscale.laws.interpolation import LawPoint
from multiscale.laws.law_table import LawTable
from multiscale.laws.patch_law import PatchLaws
from multiscale.loading.load_step import LoadStep


class FreePlaneLaws(LawSolver):
    """Consistent laws under a plane without moment.

    The moment of the contacts decides how such a plane turns. Mean pressures of few large patches
    do not tell that moment, and a single law knows nothing of it. Therefore the plane turns as it
    did in the rows of the laws, where the macro model that the laws were made for is in equilibrium
    with their pressures.

    Every load step is found without those before it.

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
        super().__init__(table)
        self._path, self._laws = table.path, PatchLaws(table.laws)
        self._displacements = displacements
        self._approach: float | None = None

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `StepSolver.press`.

        Raises:
            NotConverged: Also when the laws were made for another macro model.
        """
        path, patches = self._path, self.table.grid
        approach, evaluations = control.approach, 0
        if approach is None:
            approach, evaluations = path.approach_under(control.force or 0.0, self._force)
        end = float(path.approach[-1])
        if approach > end + ROUNDING * abs(end):
            problem = f"the plane at an approach of {approach:.6g} mm (allowed: up to {end:.6g} mm)"
            raise self.beyond_law(control, problem)
        tx, ty, *moment = map(float, path.at(approach))
        point = self._along(approach)
        xc, yc = map(float, patches.middle)
        local = RigidPlane(approach=approach, tilt=(tx, ty), centre=(xc, yc)).means(patches)
        closure = local - self._displacements(point.pressure[None])[0]
        residual = np.abs(np.where(point.pressure > 0.0, closure - point.closure, 0.0)).max()
        residual /= float(np.abs(local).max()) or 1.0
        if residual > 0.05:  # between rows of laws of this macro model it is hundredths of that
            raise NotConverged(
                f"the patches at {control}",
                reason="OTHER_BODY",
                iterations=0,
                remedy=f"their closures miss {residual:.1%} of the approach: make the laws for "
                "this block and mesh",
            )
        self._approach = approach
        return LoadStep.of_patches(
            patches,
            plane=(approach, tx, ty),
            load=(self._force(approach), *moment),
            closure=closure,
            pressure=point.pressure,
            area_fraction=point.contact_area_fraction,
            separation=point.separation,
            contacts=point.contacts,
            stiffness=point.stiffness,
            newton_iterations=evaluations,
        )

    def stiffness(self) -> Stiffness:
        """Return dF/dδ at the latest load step, from the laws alone."""
        if self._approach is None:
            return Stiffness(None, 0)
        rates = self._along(self._approach).dpressure
        return Stiffness(self.table.grid.area * float(rates.sum()), 0)

    def _force(self, approach: float) -> float:
        return self.table.grid.area * float(self._along(approach).pressure.sum())

    def _along(self, approach: float) -> LawPoint:
        return self._laws.along(np.full(self.table.grid.count, approach))
