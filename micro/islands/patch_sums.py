"""From islands to the response of the surface and its patches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, overlaps
from geometry.rigid_plane import RigidPlane
from micro.compliance.body_modes import BodyModes
from micro.islands.passes import Settled
from micro.islands.state import IslandState
from micro.islands.volumes import Relief
from micro.pairs.body_points import BodyPoints
from micro.patch_displacement import patch_displacements

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_TIE = 1e-9  # of a side: a point that is no further from a border lies on it


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
        tops, owner = self._tops(settled)
        force_share, area_share = self._shares(settled, tops)
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
            "patch_contacts": np.bincount(owner, minlength=self.patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": state.warning,
        }

    def _tops(self, settled: Settled) -> tuple[Array, Indices]:
        """Return the places of the highest peaks of the islands, (m, 2) [mm], and their patches."""
        top = settled.islands.top
        x, y = self.relief.x[top], self.relief.y[top]
        return np.stack([x, y], axis=1), self.patches.index_of(x, y)

    def _shares(self, settled: Settled, tops: Array) -> tuple[Array, Array]:
        """Return the shares of each patch in the force and in the area of each island, (m, N).

        A sample at a height e above its level weighs as Hertz's pressure does in a paraboloid cap
        of height w, (2 e/w − 1)^½, in force, and as 1 in area where e > w/2. Samples that straddle
        a border are shared by area.
        """
        found = settled.islands
        catchment, sample, height = self.relief.above(settled.height)
        kept = found.member[catchment] >= 0
        island = found.member[catchment[kept]]
        sample, pressed = sample[kept], 2.0 * height[kept] / found.depth[island] - 1.0
        force, area = (
            self._share(island, sample, weight, tops)
            for weight in (np.sqrt(np.maximum(pressed, 0.0)), (pressed > 0.0).astype(float))
        )
        return force, area

    def _share(self, island: Indices, sample: Indices, weight: Array, tops: Array) -> Array:
        """Sum up the weights of samples over patches and norm them."""
        on = np.flatnonzero(weight > 0.0)
        island, weight = island[on], weight[on]
        row, column = np.divmod(sample[on], self.relief.grid[1])
        count, total = self.patches.count, np.zeros(len(tops) * self.patches.count)
        for (ix, along), (iy, across) in product(self._rows, self._columns):
            place = island * count + ix[row] * self.patches.shape[1] + iy[column]
            parts = weight * along[row] * across[column]
            total += np.bincount(place, parts, minlength=len(total))
        share = total.reshape(len(tops), count)
        empty = np.flatnonzero(share.sum(axis=1) == 0.0)
        share[empty] = self._at(tops[empty])
        return share / share.sum(axis=1, keepdims=True)

    def _at(self, point: Array) -> Array:
        """Return the shares of the patches in points, which those on a border halve, (m, N)."""
        x, y = self.patches.borders_x, self.patches.borders_y
        slack = _TIE * min(self.lengths)
        share = np.zeros((len(point), self.patches.count))
        for offset in product((-slack, slack), repeat=2):
            inside = np.clip(point + offset, (x[0], y[0]), (x[-1], y[-1]))
            np.add.at(share, (np.arange(len(point)), self.patches.index_of(*inside.T)), 0.25)
        return share

    @cached_property
    def _rows(self) -> list[tuple[Indices, Array]]:
        return self._intervals(0, self.patches.borders_x)

    @cached_property
    def _columns(self) -> list[tuple[Indices, Array]]:
        return self._intervals(1, self.patches.borders_y)

    def _intervals(self, axis: int, borders: Array) -> list[tuple[Indices, Array]]:
        """Return the first, second, … interval that every sample reaches into, and its share."""
        cells, length = self.relief.grid[axis], self.lengths[axis]
        share = overlaps(borders, length, cells) * (cells / length)
        first, most = np.argmax(share > 0.0, axis=0), int((share > 0.0).sum(axis=0).max())
        place = first + np.arange(most)[:, None]
        inside = np.minimum(place, len(share) - 1)
        parts = np.where(place == inside, np.take_along_axis(share, inside, axis=0), 0.0)
        return list(zip(inside, parts, strict=True))

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
