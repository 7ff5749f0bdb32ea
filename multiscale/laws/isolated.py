"""Makes the isolated patch laws: each patch's asperities alone, as Waddad et al. 2016 do.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from patchlaw.geometry import PatchGrid, stacked
from patchlaw.micro import MicroModel, press_along
from patchlaw.micro.closed_forms.love import love_centre, love_mean
from patchlaw.multiscale.laws.interpolation import rising_curves
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import MOST_ROWS, refined
from patchlaw.multiscale.laws.rows import LawRows as SolvedRows
from patchlaw.multiscale.readable import Observer
from patchlaw.support.arrays import Array
from patchlaw.support.parallel import shared

_MOST_TRIALS = 40
"""Contact problems at most in search of the approach that gives a closure."""

_BEYOND_FALL = 0.25
"""Share of a patch's own displacement by which the block under it may be displaced further."""

_LOVE = {"mean": love_mean, "centre": love_centre}


@dataclass(frozen=True, slots=True, kw_only=True)
class IsolatedPatch:
    """One patch of a rough surface, pressed alone by a rigid plane on its own half-space.

    Attributes:
        model: Micro model of the patch alone; its approach counts from the highest point of the
            whole surface.
        patch: The patch as a grid of one.
        mean_height: Mean height of the surface over the patch [mm].
        love: Which displacement of the patch's surface enters the closure: its ``mean``, or the
            one at its ``centre`` (Waddad et al. 2016, eq. 30 at x = y = 0).
    """

    model: MicroModel
    patch: PatchGrid
    mean_height: float
    love: str = "mean"

    @property
    def compliance(self) -> float:
        """Displacement of the patch by a uniform unit pressure on it [mm/MPa] (eq. 29)."""
        return self._displacement(self.love)

    @property
    def first_touch(self) -> float:
        """Approach, and closure, at first touch [mm]; infinite when nothing can touch."""
        return self.model.first_touch

    def rows(self, approaches: Array) -> SolvedRows:
        """Return rows at approaches of shape (n,) [mm], columns of the same shape."""
        states = press_along(
            self.model, approaches, patches=self.patch, mean_heights=np.array([self.mean_height])
        )
        # exactly nothing before and at first touch, without the rounding of a solution
        loaded = approaches > self.first_touch
        pressure = np.where(loaded, stacked(states, "mean_pressure"), 0.0)
        # the block's closure is a mean over the patch, whichever displacement made the law's
        unresolved = (
            stacked(states, "patch_displacement")[:, 0] - self._displacement("mean") * pressure
        )
        return SolvedRows(
            approach=approaches,
            closure=approaches - self.compliance * pressure,  # eq. 31
            pressure=pressure,
            contact_area_fraction=np.where(loaded, stacked(states, "contact_area_fraction"), 0.0),
            contacts=np.where(loaded, stacked(states, "contacts"), 0),
            unresolved_displacement=np.where(loaded, unresolved, 0.0),
            outside_range=stacked(states, "warning") != "",
        )

    def law(self, closure_end: float, tolerance: float, most_rows: int = MOST_ROWS) -> PatchLaw:
        """Tabulate the law from first touch to a closure.

        Where the law stops being a function of closure (the patch's stiffness dp/dδ exceeds the
        inverse of its own compliance) it continues over the approach.

        Args:
            closure_end: Largest closure that the law will be used for [mm].
            tolerance: Interpolation error of the pressure, see `refinement.refined`.
            most_rows: Rows that are solved at most.

        Returns:
            The law; open when first touch lies beyond `closure_end`.
        """
        touch, separation = self.first_touch, self.model.reference_height - self.mean_height
        if touch >= closure_end:
            return PatchLaw.of(SolvedRows.none(), touch, separation)

        made = refined(
            lambda approaches: self.rows(approaches)[:, None],
            rising_curves,
            touch,
            self._approach_at(closure_end),
            compliance=np.array([[self.compliance]]),
            tolerance=tolerance,
            most_rows=most_rows,
        )
        rising, change = made.rows[:, 0].rising()
        return PatchLaw.of(rising, touch, separation, **made.of_law(0), repaired=change)

    def _displacement(self, love: str) -> float:
        return float(_LOVE[love](*self.patch.half_sizes) / (np.pi * self.model.contact_modulus))

    def _approach_at(self, closure: float) -> float:
        """Return the approach that closes the patch by `closure`, or by as much as it can be."""
        approach = closure
        for _ in range(_MOST_TRIALS):
            reached = self.rows(np.array([approach])).closure[0]
            if reached >= closure:
                return float(approach)
            if reached <= self.first_touch:
                break
            approach += 1.05 * (closure - reached) + 1e-3 * closure
        # closure falls again before it: continue as far as the block's own displacement allows
        pressure = self.rows(np.array([closure])).pressure[0]
        return float(closure + _BEYOND_FALL * self.compliance * pressure)


def isolated_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    closure_ends: Array,
    love: str = "mean",
    tolerance: float = 1e-3,
    most_rows: int = MOST_ROWS,
    comm: Any = None,
    observe: Observer | None = None,
) -> LawTable:
    """Tabulate the isolated laws of all patches.

    Args:
        model: Micro model of the whole surface.
        patches: Partition of the surface.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        closure_ends: Largest closure that each law will be used for, shape (N,) [mm].
        love: Displacement in the closure, ``mean`` or ``centre``.
        tolerance: Interpolation error of the pressure, see `refinement.refined`.
        most_rows: Rows that are solved at most for one law.
        comm: MPI communicator; its ranks share the patches. A patch is solved alone, so that its
            law does not depend on the number of ranks.
        observe: Called as laws are made.

    Returns:
        All laws, on every rank.

    Note:
        Collective.

    Source:
        Waddad et al. 2016, section 3.2, eq. 29-31, doi 10.1016/j.triboint.2015.12.023.
    """
    count = patches.count
    touch = shared(comm, count, lambda index: model.of_patch(patches, index)[0].first_touch)
    # a patch takes the longer the further it is closed, and one that stays open takes nothing
    costs = np.maximum(closure_ends - touch, 0.0).tolist()

    def make(index: int) -> PatchLaw:
        alone, patch = model.of_patch(patches, index)
        isolated = IsolatedPatch(
            model=alone, patch=patch, mean_height=float(mean_heights[index]), love=love
        )
        return isolated.law(float(closure_ends[index]), tolerance, most_rows)

    watch = (lambda done: observe("laws of patches", done, count)) if observe else None
    laws = tuple(shared(comm, count, make, costs=costs, observe=watch))
    return LawTable(
        patches=patches,
        laws=laws,
        made_by={
            "coupling": "isolated",
            "model": model.name,
            "love": love,
            "tolerance": f"{tolerance:g}",
        },
        force_error=max(law.interpolation_error for law in laws),
    )
