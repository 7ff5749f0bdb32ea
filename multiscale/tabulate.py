"""Makes the isolated patch laws: each patch's asperities alone, as Waddad et al. 2016 do."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from geometry.collective import together
from geometry.patches import PatchGrid
from micro.asperity_models import AsperityModel
from micro.love import love_centre, love_mean
from multiscale.law_files import LawTable
from multiscale.laws import PatchLaw

Array = NDArray[np.float64]
_FIRST_ROWS = 9
_MOST_ROWS = 500
_LOVE = {"mean": love_mean, "centre": love_centre}


@dataclass(frozen=True, slots=True, kw_only=True)
class IsolatedPatch:
    """One patch of an asperity model, pressed alone by a rigid plane on its own half-space.

    Attributes:
        model: Asperity model of the patch's own asperities.
        patch: The patch as a grid of one.
        mean_height: Mean height of the surface over the patch [mm].
        love: Which displacement of the patch's surface enters the closure: its ``mean``, or the
            one at its ``centre`` (Waddad et al. 2016, eq. 30 at x = y = 0).
    """

    model: AsperityModel
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
        """Approach, and closure, at first touch [mm]; infinite without asperities."""
        heights = self.model.asperities.z
        return float(self.model.asperities.highest - heights.max()) if heights.size else np.inf

    @property
    def reach(self) -> float:
        """Height of the plane over the patch's mean plane at zero approach [mm]."""
        return float(self.model.asperities.highest - self.mean_height)

    def rows(self, approaches: Array) -> Array:
        """Return rows (approach, closure, pressure, area fraction, contacts), shape (n, 5)."""
        response = self.model.respond(
            approaches, patches=self.patch, mean_heights=np.array([self.mean_height])
        )
        pressure = response.mean_pressure
        closure = approaches - self.compliance * pressure  # eq. 31
        area = response.contact_area_fraction
        return np.column_stack((approaches, closure, pressure, area, response.contacts))

    def law(self, closure_end: float, tolerance: float) -> PatchLaw:
        """Tabulate the law from first touch to a closure.

        Rows are added half-way between rows until the interpolated pressure agrees there with
        the micro model. Where the law stops being a function of closure (the patch's stiffness
        dp/dδ exceeds the inverse of its own compliance) the table ends.

        Args:
            closure_end: Largest closure that will be asked for [mm].
            tolerance: Error of the interpolated pressure relative to the table's largest one.

        Returns:
            The law; open when first touch lies beyond `closure_end`.
        """
        if self.touch >= closure_end:
            return _law(np.empty((0, 5)), self.touch, self.reach, 0.0)
        end = self._approach_at(closure_end)
        rows = self.rows(np.linspace(self.touch, end, _FIRST_ROWS, dtype=np.float64))
        rows[0, 1:] = self.touch, 0.0, 0.0, 0.0  # whatever round-off makes of first touch
        rows, error = self._refined(_increasing(rows), tolerance)
        return _law(rows, self.touch, self.reach, error)

    def _approach_at(self, closure: float) -> float:
        """Find the approach that closes the patch by at least `closure`, where there is one."""
        approach, reached = closure, -np.inf
        for _ in range(60):
            row = self.rows(np.array([approach]))[0]
            if row[1] >= closure or row[1] <= reached:
                break
            reached = row[1]
            approach += 1.05 * (closure - reached) + 1e-3 * closure
        return float(approach)

    def _refined(self, rows: Array, tolerance: float) -> tuple[Array, float]:
        """Halve intervals until the pressure half-way is met within the tolerance."""
        halfway = 0.5 * (rows[:-1, 0] + rows[1:, 0])
        worst = missed = 0.0
        while halfway.size and len(rows) < _MOST_ROWS:
            new = self.rows(halfway)
            root = PchipInterpolator(rows[:, 1], rows[:, 2] ** (2 / 3))
            error = np.abs(np.maximum(root(new[:, 1]), 0.0) ** 1.5 - new[:, 2]) / rows[-1, 2]
            bad = error > tolerance
            worst = max(worst, float(error[~bad].max(initial=0.0)))
            missed = float(error.max())
            rows = _increasing(np.vstack((rows, new)))
            halfway = _around(rows[:, 0], new[bad, 0])
        return rows, max(worst, missed) if halfway.size else worst


def _increasing(rows: Array) -> Array:
    """Sort rows by approach and cut them where closure or pressure stops to increase."""
    rows = rows[np.argsort(rows[:, 0])]
    falls = np.flatnonzero(np.any(np.diff(rows[:, 1:3], axis=0) <= 0, axis=1))
    return rows[: falls[0] + 1] if falls.size else rows


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
        touch=touch,
        reach=reach,
        interpolation_error=error,
    )


def isolated_laws(
    model: AsperityModel,
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
        patches: Partition of the surface; each asperity belongs to the patch of its summit.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        closure_ends: Largest closure each law will be asked for, shape (N,) [mm].
        love: Displacement in the closure, ``mean`` or ``centre``.
        tolerance: Interpolation error of the pressure, relative to each law's largest pressure.
        comm: MPI communicator; the patches are shared over its ranks by number of summits.

    Returns:
        All laws, on every rank.

    Note:
        Collective.

    Source:
        Waddad et al. 2016, section 3.2, eq. 29-31, doi 10.1016/j.triboint.2015.12.023.
    """
    owner = patches.index_of(model.asperities.x, model.asperities.y)
    work = np.bincount(owner, minlength=patches.count)

    def make(index: int) -> PatchLaw:
        patch = IsolatedPatch(
            model=replace(model, asperities=model.asperities.subset(owner == index)),
            patch=patches.single(index),
            mean_height=float(mean_heights[index]),
            love=love,
        )
        return patch.law(float(closure_ends[index]), tolerance)

    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    mine = _shares(work, size)[rank]
    made = together(comm, lambda: {index: make(index) for index in mine})
    parts = [made] if comm is None else comm.allgather(made)
    laws = {index: law for part in parts for index, law in part.items()}
    return LawTable(
        patches=patches,
        laws=tuple(laws[index] for index in range(patches.count)),
        made_by={"coupling": "isolated", "love": love, "tolerance": f"{tolerance:g}"},
    )


def _shares(work: NDArray[np.int64], size: int) -> list[list[int]]:
    """Deal jobs to ranks, the largest first, each to the rank with the least work so far."""
    shares: list[list[int]] = [[] for _ in range(size)]
    loads = np.zeros(size)
    for job in np.argsort(-work, kind="stable"):
        rank = int(np.argmin(loads))
        shares[rank].append(int(job))
        loads[rank] += work[job] ** 2 + 1  # a dense interaction matrix per solution
    return shares
