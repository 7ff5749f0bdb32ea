"""From islands to the response of the surface and its patches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Partition
from micro.compliance.body_modes import BodyModes
from micro.pairs.body_points import BodyPoints
from micro.patch_displacement import patch_displacements
from micro.plane import RigidPlane
from micro.regions.island_passes import Settled
from micro.regions.island_state import IslandState
from micro.regions.relief import Relief

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class IslandSums:
    """Sums and means over patches of what the islands do.

    Args:
        relief: Catchments of the surface.
        lengths: Sides (Lx, Ly) of the surface [mm].
        highest: Highest point z_M of the surface [mm].
        patches: Patches; every peak above the plane lies in one.
        mean_heights: Mean heights of the patches, shape (N,) [mm].
        contact_modulus: E* [MPa].
        body: What a finite body adds to the half-space; None on a half-space.
    """

    relief: Relief
    lengths: tuple[float, float]
    highest: float
    patches: Partition
    mean_heights: Array
    contact_modulus: float
    body: BodyModes | None = None

    def row(self, plane: RigidPlane, settled: Settled, state: IslandState) -> dict[str, Any]:
        """Return the fields of a response for one approach.

        Raises:
            InputError: When a peak above the plane lies outside the patches.
        """
        force_share, area_share = self._shares(settled)
        displacement = self._displacement(state)
        separation = self.highest - plane.means(self.patches) - self.mean_heights
        separation = separation + displacement
        return {
            "approach": plane.approach,
            "force": state.force.sum(),
            "moment": plane.moment(state.x, state.y, state.force),
            "contact_area": state.contact_area.sum(),
            "contacts": len(state.force),
            "mean_separation": np.average(separation, weights=self.patches.areas),
            "iterations": state.iterations,
            "residual": state.residual,
            "engulfed": state.merged,
            "patch_force": state.force @ force_share,
            "patch_contact_area": state.contact_area @ area_share,
            "patch_contacts": np.bincount(self._homes(settled), minlength=self.patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": state.warning,
        }

    def _homes(self, settled: Settled) -> NDArray[np.intp]:
        """Return the patch with the highest peak of each island, shape (m,)."""
        peaks = np.flatnonzero(settled.islands.member >= 0)
        owner = np.zeros(len(self.relief), dtype=np.intp)
        owner[peaks] = self.patches.index_of(self.relief.x[peaks], self.relief.y[peaks])
        return owner[settled.islands.top]

    def _shares(self, settled: Settled) -> tuple[Array, Array]:
        """Return the shares of each patch in the force and in the area of each island, (m, N).

        A sample at a height e above its level weighs as Hertz's pressure does in a paraboloid cap
        of height w, (2 e/w − 1)^½, in force, and as 1 in area where e > w/2.
        """
        found = settled.islands
        catchment, sample, height = self.relief.above(settled.height)
        kept = found.member[catchment] >= 0
        island = found.member[catchment[kept]]
        row, column = np.divmod(sample[kept], self.relief.grid[1])
        patch = self._rows[row] * self.patches.shape[1] + self._columns[column]
        pressed = 2.0 * height[kept] / found.depth[island] - 1.0
        place = island * self.patches.count + patch
        home = self._homes(settled)
        force, area = (
            self._share(place, weight, home)
            for weight in (np.sqrt(np.maximum(pressed, 0.0)), (pressed > 0.0).astype(float))
        )
        return force, area

    def _share(self, place: NDArray[np.intp], weight: Array, home: NDArray[np.intp]) -> Array:
        """Sum up weights and norm them; an island without weight counts for its home."""
        shape = len(home), self.patches.count
        share = np.bincount(place, weight, minlength=shape[0] * shape[1]).reshape(shape)
        empty = np.flatnonzero(share.sum(axis=1) == 0.0)
        share[empty, home[empty]] = 1.0
        return share / share.sum(axis=1, keepdims=True)

    @cached_property
    def _rows(self) -> NDArray[np.intp]:
        return self._intervals(0, self.patches.borders_x)

    @cached_property
    def _columns(self) -> NDArray[np.intp]:
        return self._intervals(1, self.patches.borders_y)

    def _intervals(self, axis: int, borders: Array) -> NDArray[np.intp]:
        cells = self.relief.grid[axis]
        centres = (np.arange(cells) + 0.5) * self.lengths[axis] / cells
        return np.searchsorted(borders[1:-1], centres, side="right")

    def _displacement(self, state: IslandState) -> Array:
        found = patch_displacements(
            self.patches,
            np.stack([state.x, state.y], axis=1),
            state.semi_axes,
            state.angle,
            state.force,
            self.contact_modulus,
        )
        if self.body is None:
            return found
        points = BodyPoints.at(self.body, state.x, state.y, self.contact_modulus)
        moment = state.force / (np.pi * self.contact_modulus)
        return found + points.patch_means(self.patches, moment)
