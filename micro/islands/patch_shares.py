"""Shares of patches in the forces and areas of islands, by the heights above their levels.

A sample at a height e above its level weighs as Hertz's pressure does in a paraboloid cap of
height w, (2 e/w − 1)^½, in force, and as 1 in area where e > w/2. Samples that straddle a border
are shared by area.

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, overlaps
from micro.islands.equilibrium import IslandEquilibrium
from micro.islands.watersheds import Watersheds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_TIE = 1e-9  # of the shorter side: a point that is no further from a border lies on it


def island_shares(
    patches: Partition,
    watersheds: Watersheds,
    found: IslandEquilibrium,
    lengths: tuple[float, float],
) -> tuple[Array, Array]:
    """Return the shares of N patches in the force and in the area of each island, (m, N).

    Args:
        patches: The patches; every peak above the plane lies in one.
        watersheds: Watersheds of the surface.
        found: The m islands.
        lengths: Sides (Lx, Ly) of the surface [mm].
    """
    islands, sheds = found.islands, watersheds
    owner, sample, height = sheds.above(found.height)
    island = islands.member[owner]
    inside = island >= 0
    island, sample, height = island[inside], sample[inside], height[inside]
    pressed = 2.0 * height / islands.depth[island] - 1.0
    row, column = np.divmod(sample, sheds.grid[1])
    rows = _intervals(patches.borders_x, lengths[0], sheds.grid[0])
    columns = _intervals(patches.borders_y, lengths[1], sheds.grid[1])
    tops = np.stack([sheds.x[islands.top], sheds.y[islands.top]], axis=1)
    shares = []
    for weight in (np.sqrt(np.maximum(pressed, 0.0)), (pressed > 0.0).astype(float)):
        total = np.zeros(len(tops) * patches.count)
        for (ix, along), (iy, across) in product(rows, columns):
            place = island * patches.count + ix[row] * patches.shape[1] + iy[column]
            parts = weight * along[row] * across[column]
            total += np.bincount(place, parts, minlength=len(total))
        share = total.reshape(len(tops), patches.count)
        empty = np.flatnonzero(share.sum(axis=1) == 0.0)
        share[empty] = _point_shares(patches, tops[empty], _TIE * min(lengths))
        shares.append(share / share.sum(axis=1, keepdims=True))
    return shares[0], shares[1]


def _point_shares(patches: Partition, point: Array, slack: float) -> Array:
    """Return the shares of the patches in points; a border halves a point on it, (m, N)."""
    x, y = patches.borders_x, patches.borders_y
    share = np.zeros((len(point), patches.count))
    for offset in product((-slack, slack), repeat=2):
        inside = np.clip(point + offset, (x[0], y[0]), (x[-1], y[-1]))
        np.add.at(share, (np.arange(len(point)), patches.index_of(*inside.T)), 0.25)
    return share


def _intervals(borders: Array, length: float, cells: int) -> list[tuple[Indices, Array]]:
    """Return the first, second, … interval that every cell reaches into, and its share there."""
    share = overlaps(borders, length, cells) * (cells / length)
    first, most = np.argmax(share > 0.0, axis=0), int((share > 0.0).sum(axis=0).max())
    place = first + np.arange(most)[:, None]
    inside = np.minimum(place, len(share) - 1)
    parts = np.where(place == inside, np.take_along_axis(share, inside, axis=0), 0.0)
    return list(zip(inside, parts, strict=True))
