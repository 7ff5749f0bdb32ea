"""Patch laws on the displacements of a block's patches alone, without its mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from geometry.rigid_plane import Control, RigidPlane
from multiscale.couplings.dense_newton import DenseNewton
from multiscale.couplings.load_steps import beyond_law
from multiscale.couplings.loaded_patches import DenseState
from multiscale.laws.consistent import Displacements
from multiscale.laws.interpolation import LawPoint
from multiscale.laws.law_table import LawTable, PatchLaws
from multiscale.loading.load_step import LoadStep
from multiscale.storage import Arrays, packed, unpacked

Array = NDArray[np.float64]

_ROUNDING = 1e-12
"""Share of a law's end by which a converged approach may exceed it."""

_OTHER_MODEL = 0.05
"""Residual of closures, relative to the largest local approach, that shows that the laws were made
for another macro model; between their rows it is hundredths of that."""


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
        self._table, self._laws = table, PatchLaws(table.laws)
        self._newton = DenseNewton(self._laws, compliance, table.patches)
        self._last: DenseState | None = None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""
        state = self._newton.solve(control, self._last)
        end = self._laws.end
        beyond = state.local > end * (1.0 + _ROUNDING)
        if beyond.any():
            worst = int(np.argmax(np.where(beyond, state.local - end, -np.inf)))
            patch = self._table.patches.unravel(worst)
            problem = (
                f"patch {patch} at a local approach of {state.local[worst]:.6g} mm (allowed: up to "
                f"{end[worst]:.6g} mm)"
            )
            raise beyond_law(control, problem, self._table)
        self._last = state
        return LoadStep.of_patches(
            self._table.patches,
            plane=state.plane,
            load=state.load,
            closure=state.closure,
            pressure=state.pressure,
            **self._laws.contact(state.local)._asdict(),
            newton_iterations=state.iterations,
            residuals=state.residuals,
        )

    def state(self) -> Arrays:
        """Return the latest equilibrium; see `Restorable`."""
        return packed(self._last)

    def restore(self, state: Arrays) -> None:
        """Start from an equilibrium; see `Restorable`."""
        self._last = unpacked(state, (DenseState, LawPoint))


class FreePlaneCoupling:
    """Consistent laws under a plane without moment.

    It is the contacts that balance such a plane, not the mean pressures of patches at their
    centres: laws of few large patches do not determine how it turns, and a single law not at all.
    Therefore it turns as it did in the rows of the laws, and the macro model that the laws were
    made for is in equilibrium with their pressures there.

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
        self._table, self._path, self._laws = table, table.path, PatchLaws(table.laws)
        self._displacements = displacements

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `Coupling.press`.

        Raises:
            NotConverged: Also when the laws were made for another macro model.
        """
        path, patches = self._path, self._table.patches
        approach, evaluations = control.approach, 0
        if approach is None:
            approach, evaluations = path.approach_under(control.force or 0.0, self._force)
        end = float(path.approach[-1])
        if approach > end + _ROUNDING * abs(end):
            problem = f"the plane at an approach of {approach:.6g} mm (allowed: up to {end:.6g} mm)"
            raise beyond_law(control, problem, self._table)
        everywhere, tilt = np.full(patches.count, approach), path.tilt_at(approach)
        point = self._laws.along(everywhere)
        local = RigidPlane.above(patches, approach, tilt).means(patches)
        closure = local - self._displacements(point.pressure[None])[0]
        residual = np.abs(np.where(point.pressure > 0.0, closure - point.closure, 0.0)).max()
        residual /= float(np.abs(local).max()) or 1.0
        if residual > _OTHER_MODEL:
            raise NotConverged(
                f"the patches at {control}",
                reason="OTHER_BODY",
                iterations=0,
                remedy=f"their closures miss {residual:.1%} of the approach: make the laws for "
                "this block and mesh",
            )
        return LoadStep.of_patches(
            patches,
            plane=(approach, *tilt),
            load=(self._force(approach), *path.moment_at(approach)),
            closure=closure,
            pressure=point.pressure,
            **self._laws.contact(everywhere)._asdict(),
            newton_iterations=evaluations,
            residuals=(float(residual),),
        )

    def _force(self, approach: float) -> float:
        everywhere = np.full(self._table.patches.count, approach)
        return self._table.patches.area * float(self._laws.along(everywhere).pressure.sum())
