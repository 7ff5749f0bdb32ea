"""Makes the isolated patch laws: each patch's asperities alone, as Waddad et al. 2016 do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import together
from geometry.patches import PatchGrid
from micro import MicroModel
from micro.closed_forms.love import love_centre, love_mean
from multiscale.laws.files import LawTable
from multiscale.laws.patch_law import PatchLaw
from multiscale.laws.refinement import MOST_ROWS, law_of, refined
from multiscale.laws.repair import evened

Array = NDArray[np.float64]
_MOST_TRIALS = 40  # in search of the approach that gives a closure
_BEYOND_FALL = 0.25  # of a patch's own displacement, by which a block may be the softer under it
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
        half_sizes = self.patch.half_sizes
        return float(_LOVE[self.love](*half_sizes) / (np.pi * self.model.contact_modulus))

    @property
    def touch(self) -> float:
        """Approach, and closure, at first touch [mm]; infinite when nothing can touch."""
        return self.model.first_touch

    @property
    def reach(self) -> float:
        """Height of the plane over the patch's mean plane at zero approach [mm]."""
        return float(self.model.reference_height - self.mean_height)

    def rows(self, approaches: Array) -> Array:
        """Return rows, shape (n, 7), with the columns of `refinement.refined`."""
        response = self.model.respond(
            approaches, patches=self.patch, mean_heights=np.array([self.mean_height])
        )
        pressure = response.mean_pressure
        closure = approaches - self.compliance * pressure  # eq. 31
        area = response.contact_area_fraction
        # the block's closure is a mean over the patch, whichever displacement made the law's
        mean = love_mean(*self.patch.half_sizes) / (np.pi * self.model.contact_modulus)
        relief = response.patch_displacement[:, 0] - mean * pressure
        columns = (approaches, closure, pressure, area, response.contacts, relief)
        return np.column_stack((*columns, response.warning != ""))

    def law(self, closure_end: float, tolerance: float, most_rows: int = MOST_ROWS) -> PatchLaw:
        """Tabulate the law from first touch to a closure.

        Where the law stops being a function of closure (the patch's stiffness dp/dδ exceeds the
        inverse of its own compliance) it goes on over the approach.

        Args:
            closure_end: Largest closure that will be asked for [mm].
            tolerance: Interpolation error of the pressure, see `refinement.refined`.
            most_rows: Rows that are solved at most.

        Returns:
            The law; open when first touch lies beyond `closure_end`.
        """
        if self.touch >= closure_end:
            return law_of(np.empty((0, 7)), self.touch, self.reach)

        def rows(approaches: Array) -> Array:
            made = self.rows(approaches)
            made[approaches <= self.touch, 1:6] = self.touch, 0.0, 0.0, 0.0, 0.0  # not round-off's
            return made[:, None]

        def laws(made: Array) -> list[PatchLaw]:
            kept, change = evened(made[:, 0])
            return [replace(law_of(kept, self.touch, self.reach), repaired=change)]

        made, _ = refined(
            rows,
            laws,
            self.touch,
            self._approach_at(closure_end),
            compliance=np.array([[self.compliance]]),
            tolerance=tolerance,
            most_rows=most_rows,
        )
        return made[0]

    def _approach_at(self, closure: float) -> float:
        """Find the approach that closes the patch by `closure`, or by as much as it can be."""
        approach = closure
        for _ in range(_MOST_TRIALS):
            reached = self.rows(np.array([approach]))[0, 1]
            if reached >= closure:
                return float(approach)
            if reached <= self.touch:
                break
            approach += 1.05 * (closure - reached) + 1e-3 * closure
        # closure falls again before it: go as far as the block lets the patch's surface sink
        pressure = self.rows(np.array([closure]))[0, 2]
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
) -> LawTable:
    """Tabulate the isolated laws of all patches.

    Args:
        model: Micro model of the whole surface.
        patches: Partition of the surface.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        closure_ends: Largest closure each law will be asked for, shape (N,) [mm].
        love: Displacement in the closure, ``mean`` or ``centre``.
        tolerance: Interpolation error of the pressure, see `refinement.refined`.
        most_rows: Rows that are solved at most for one law.
        comm: MPI communicator; the patches are dealt to its ranks by predicted work. A patch is
            solved alone, so that its law does not depend on the number of ranks.

    Returns:
        All laws, on every rank.

    Note:
        Collective.

    Source:
        Waddad et al. 2016, section 3.2, eq. 29-31, doi 10.1016/j.triboint.2015.12.023.
    """

    def make(index: int) -> PatchLaw:
        alone, patch = model.of_patch(patches, index)
        isolated = IsolatedPatch(
            model=alone, patch=patch, mean_height=float(mean_heights[index]), love=love
        )
        return isolated.law(float(closure_ends[index]), tolerance, most_rows)

    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    mine = _dealt(_work(model, patches, closure_ends), size)[rank]
    made = together(comm, lambda: {index: make(index) for index in mine})
    parts = [made] if comm is None else comm.allgather(made)
    laws = {index: law for part in parts for index, law in part.items()}
    return LawTable(
        patches=patches,
        laws=tuple(laws[index] for index in range(patches.count)),
        made_by={
            "coupling": "isolated",
            "model": model.name,
            "love": love,
            "tolerance": f"{tolerance:g}",
        },
        force_error=max(law.interpolation_error for law in laws.values()),
    )


def _work(model: MicroModel, patches: PatchGrid, closure_ends: Array) -> Array:
    """Return the number of cells or summits that each law can touch, shape (N,)."""
    surface, summits = getattr(model, "surface", None), getattr(model, "asperities", None)
    if surface is not None:
        x, y = (part.ravel() for part in np.meshgrid(surface.x, surface.y, indexing="ij"))
        z = surface.heights.ravel()
    elif summits is not None:
        x, y, z = summits.x, summits.y, summits.z
    else:
        return np.ones(patches.count)
    owner = patches.index_of(x, y)
    reached = model.reference_height - z < closure_ends[owner]
    return np.bincount(owner[reached], minlength=patches.count).astype(float)


def _dealt(work: Array, ranks: int) -> list[list[int]]:
    """Deal patches to ranks, the heaviest first, each to the rank with the least so far."""
    hands: list[list[int]] = [[] for _ in range(ranks)]
    loads = np.zeros(ranks)
    for index in np.argsort(-work, kind="stable"):
        rank = int(np.argmin(loads))
        hands[rank].append(int(index))
        loads[rank] += work[index] + 1.0
    return hands
