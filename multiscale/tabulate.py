"""Makes the isolated patch laws: each patch's asperities alone, as Waddad et al. 2016 do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import together
from geometry.errors import NotConverged
from geometry.patches import PatchGrid
from micro import MicroModel
from micro.love import love_centre, love_mean
from multiscale.law_files import LawTable
from multiscale.laws import PatchLaw

Array = NDArray[np.float64]
_FIRST_ROWS = 9
_MOST_ROWS = 400  # solutions of the micro model spent on one law
_LEAST_SCALE = 0.01  # of the largest pressure: below it an error counts as one of this much
_MOST_TRIALS = 40  # in search of the approach that gives a closure
_BEYOND_FALL = 0.25  # of a patch's own displacement, by which a block may be the softer under it
_UNEVEN = 1e-3  # of the range of closures: a fall below is no fall
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
        return float(self.model.datum - self.mean_height)

    def rows(self, approaches: Array) -> Array:
        """Return rows: approach, closure, pressure, area fraction, contacts, relief; (n, 6)."""
        response = self.model.respond(
            approaches, patches=self.patch, mean_heights=np.array([self.mean_height])
        )
        pressure = response.mean_pressure
        closure = approaches - self.compliance * pressure  # eq. 31
        area = response.contact_area_fraction
        # the block's closure is a mean over the patch, whichever displacement made the law's
        mean = love_mean(*self.patch.half_sizes) / (np.pi * self.model.contact_modulus)
        relief = response.patch_displacement[:, 0] - mean * pressure
        return np.column_stack((approaches, closure, pressure, area, response.contacts, relief))

    def law(self, closure_end: float, tolerance: float) -> PatchLaw:
        """Tabulate the law from first touch to a closure.

        Rows are added half-way between rows until the interpolated pressure agrees there with
        the micro model. Where the law stops being a function of closure (the patch's stiffness
        dp/dδ exceeds the inverse of its own compliance) it goes on over the approach.

        Args:
            closure_end: Largest closure that will be asked for [mm].
            tolerance: Error of the interpolated pressure half-way between rows, relative to the
                pressure there, or to a hundredth of the table's largest where that is more.

        Returns:
            The law; open when first touch lies beyond `closure_end`.

        Raises:
            NotConverged: When the pressure is a function of closure nowhere.
        """
        if self.touch >= closure_end:
            return _law(np.empty((0, 6)), self.touch, self.reach, 0.0)
        end = self._approach_at(closure_end)
        rows = self.rows(np.linspace(self.touch, end, _FIRST_ROWS, dtype=np.float64))
        rows[0, 1:] = self.touch, 0.0, 0.0, 0.0, 0.0  # whatever round-off makes of first touch
        rows = _increasing(rows)
        if len(rows) < 2 or rows[1, 1] <= rows[0, 1]:
            raise NotConverged(
                f"the law of the patch at {self.patch.origin} mm",
                reason="STIFFER_THAN_ITS_HALF_SPACE",
                iterations=_FIRST_ROWS,
                remedy="choose another micro.model or larger patches (patches.grid)",
            )
        rows, error = self._refined(rows, tolerance)
        return _law(rows, self.touch, self.reach, error)

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

    def _refined(self, rows: Array, tolerance: float) -> tuple[Array, float]:
        """Halve intervals until the pressure half-way is met within the tolerance."""
        halfway = 0.5 * (rows[:-1, 0] + rows[1:, 0])
        worst = missed = 0.0
        spent = len(rows)
        while halfway.size and spent < _MOST_ROWS:
            new = self.rows(halfway)
            spent += len(new)
            point = _law(rows, self.touch, self.reach, 0.0).along(new[:, 0])
            scale = np.maximum(new[:, 2], _LEAST_SCALE * rows[-1, 2])
            shifted = point.dpressure * np.abs(point.closure - new[:, 1])
            error = (np.abs(point.pressure - new[:, 2]) + shifted) / scale
            bad = error > tolerance
            worst = max(worst, float(error[~bad].max(initial=0.0)))
            missed = float(error.max())
            rows = _increasing(np.vstack((rows, new)))
            halfway = _around(rows[:, 0], new[bad, 0])
        return rows, max(worst, missed) if halfway.size else worst


def _increasing(rows: Array) -> Array:
    """Sort rows by approach and keep those whose pressure exceeds all before.

    A closure that falls for good is kept: the patch's stiffness has outgrown its own half-space.
    One a little below those before is an unevenness of the micro model, and left out.
    """
    rows = rows[np.argsort(rows[:, 0])]
    highest = np.maximum.accumulate(rows[:, 1:3], axis=0)
    fall = highest[:, 0] - rows[:, 1]
    uneven = (fall > 0.0) & (fall < _UNEVEN * np.ptp(rows[:, 1]))
    uneven |= np.concatenate(([False], (np.diff(highest[:, 0]) == 0.0) & (fall[1:] == 0.0)))
    uneven &= np.arange(len(rows)) < np.argmax(rows[:, 1])
    rising = np.concatenate(([True], highest[1:, 1] > highest[:-1, 1]))
    return rows[rising & ~uneven]


def _around(points: Array, centres: Array) -> Array:
    """Return the middles of the intervals on either side of some of the points."""
    index = np.searchsorted(points, centres[centres < points[-1]])
    return np.unique(
        0.5 * np.concatenate((points[index - 1], points[index + 1]))
        + 0.5 * np.tile(points[index], 2)
    )


def _law(rows: Array, touch: float, reach: float, error: float) -> PatchLaw:
    return PatchLaw(
        approach=rows[:, 0],
        closure=rows[:, 1],
        pressure=rows[:, 2],
        contact_area_fraction=rows[:, 3],
        contacts=rows[:, 4].astype(np.int64),
        relief=rows[:, 5],
        touch=touch,
        reach=reach,
        interpolation_error=error,
    )


def isolated_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    closure_ends: Array,
    love: str = "mean",
    tolerance: float = 1e-4,
    comm: Any = None,
) -> LawTable:
    """Tabulate the isolated laws of all patches.

    Args:
        model: Micro model of the whole surface.
        patches: Partition of the surface.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        closure_ends: Largest closure each law will be asked for, shape (N,) [mm].
        love: Displacement in the closure, ``mean`` or ``centre``.
        tolerance: Interpolation error of the pressure, see `IsolatedPatch.law`.
        comm: MPI communicator; the patches are dealt to its ranks.

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
        return isolated.law(float(closure_ends[index]), tolerance)

    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    # dealt in turn: neighbours, which tend to be as high as each other, go to different ranks
    mine = range(rank, patches.count, size)
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
    )
