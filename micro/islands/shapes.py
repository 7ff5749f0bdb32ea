"""The Hertz contact that stands for a region above the plane, and the patches' shares in it.

A paraboloid cap of height w with principal radii R', R'' has the elliptic base of semi-axes
sqrt(2 R' w), sqrt(2 R'' w). Integrated over the cap,

    V = π sqrt(R' R'') w²,    ∫ X² dV / V = R' w/3,    ∫ Y² dV / V = R'' w/3,

X and Y from its centroid along the principal directions. Read backwards, the volume of any region
gives R = V/(π w²), the ratio of the principal moments gives R'/R'', their direction the ellipse's.

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, overlaps
from micro.closed_forms.hertz import shape_factors
from micro.interaction.patch_sums import EllipticContacts
from micro.islands.watersheds import Watersheds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_SLENDER = 1e4
_TIE = 1e-9  # of the shorter side: a point that is no further from a border lies on it


class Paraboloids(NamedTuple):
    """Paraboloid caps equivalent to m regions.

    Attributes:
        x: Abscissae of the centroids of volume, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the larger principal radii from the x axis, shape (m,) [rad].
        radius_major: Larger principal radii R', shape (m,) [mm].
        radius_minor: Smaller ones R'', shape (m,) [mm].
    """

    x: Array
    y: Array
    angle: Array
    radius_major: Array
    radius_minor: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Islands(EllipticContacts):
    """Connected regions above the plane as Hertz contacts at their centroids, for E* = 1 MPa.

    Args:
        member: Island of each of the n peaks, −1 below the plane, shape (n,).
        top: The highest peak of each island, shape (m,).
        depth: Heights w of the highest peaks above their level, shape (m,) [mm].
    """

    member: Indices
    top: Indices
    depth: Array

    def __len__(self) -> int:
        return len(self.depth)

    def kernel(self, x: Array, y: Array) -> Array:
        """Return the displacements of peaks by the forces that they are not part of, (n, m) [1/mm].

        A point force for each island, at most the displacement of its own centre.

        Args:
            x: Abscissae of the n peaks [mm].
            y: Their ordinates [mm].
        """
        distance = np.hypot(x[:, None] - self.x, y[:, None] - self.y)
        apart = self.member[:, None] != np.arange(len(self))
        limit = self.force / (np.pi * self.depth)
        return np.asarray((apart / np.maximum(distance, limit)) / np.pi)

    def under(self, depth: Array) -> Islands:
        """Return islands of the same shapes and other depths, shape (m,) [mm]."""
        share = depth / self.depth
        return replace(
            self,
            depth=depth,
            semi_axes=self.semi_axes * np.sqrt(share)[:, None],
            force=self.force * share**1.5,
        )


def islands(watersheds: Watersheds, height: Array, region: Indices) -> Islands:
    """Merge watersheds above their levels into islands.

    Args:
        watersheds: The n watersheds.
        height: Heights of the peaks above their levels, negative below, shape (n,) [mm].
        region: Numbers that are equal for watersheds of one island, shape (n,).
    """
    caps = watersheds.caps(np.maximum(height, 0.0))
    on = np.flatnonzero(caps[0] > 0.0)
    _, island = np.unique(region[on], return_inverse=True)
    member = np.full(len(watersheds), -1)
    member[on] = island
    count = int(member.max(initial=-1)) + 1
    depth = np.zeros(count)
    np.maximum.at(depth, island, height[on])
    top = np.zeros(count, dtype=np.intp)
    order = np.argsort(height[on], kind="stable")  # the highest is written last
    top[island[order]] = on[order]
    moments = from_origin(caps[:, on], watersheds.x[on], watersheds.y[on])
    total: Array = np.stack([np.bincount(island, part, count) for part in moments])
    found = equivalent(total, depth)
    shape = shape_factors(found.radius_major, found.radius_minor)
    radius = np.sqrt(found.radius_major * found.radius_minor)
    major = shape.axis * np.sqrt(radius * depth)
    return Islands(
        member=member,
        top=top,
        depth=depth,
        x=found.x,
        y=found.y,
        angle=found.angle,
        semi_axes=np.stack([major, major * shape.axis_ratio], axis=1),
        force=4.0 / 3.0 * np.sqrt(radius) * shape.force * depth**1.5,
    )


def total_force(watersheds: Watersheds, height: Array) -> float:
    """Return the force over E* of islands that do not displace each other [mm²].

    Args:
        watersheds: The n watersheds.
        height: Heights of the peaks above a plane, negative below, shape (n,) [mm].
    """
    region = watersheds.regions(watersheds.open_saddles(watersheds.z - height))
    return float(islands(watersheds, height, region).force.sum())


def equivalent(moments: Array, depth: Array) -> Paraboloids:
    """Return the paraboloids with the volume and the principal moments of regions.

    Args:
        moments: ∫ X^p Y^q dV for 1, X, Y, X², XY, Y² from any origin, shape (6, m) [mm³ … mm⁵].
        depth: Heights w > 0 of the regions, shape (m,) [mm].
    """
    volume: Array = moments[0]
    x, y, xx, xy, yy = list(moments[1:] / volume)
    mean, half = 0.5 * (xx - x**2 + yy - y**2), 0.5 * (xx - x**2 - yy + y**2)
    cross = xy - x * y
    spread = np.hypot(half, cross)
    largest = np.maximum(mean + spread, np.finfo(float).tiny)  # 0 for a single sample
    ratio = largest / np.clip(mean - spread, largest / _MOST_SLENDER, largest)
    radius = volume / (np.pi * depth**2)
    return Paraboloids(
        x=x,
        y=y,
        angle=np.mod(0.5 * np.arctan2(cross, half), np.pi),
        radius_major=radius * np.sqrt(ratio),
        radius_minor=radius / np.sqrt(ratio),
    )


def from_origin(moments: Array, x: Array, y: Array) -> Array:
    """Refer moments of volume to the origin instead of the peaks (parallel axes).

    Args:
        moments: Moments as `Watersheds.caps` gives them, shape (6, n).
        x: Abscissae of the peaks, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
    """
    volume, along, across, xx, xy, yy = moments
    return np.stack(
        [
            volume,
            along + x * volume,
            across + y * volume,
            xx + 2.0 * x * along + x**2 * volume,
            xy + x * across + y * along + x * y * volume,
            yy + 2.0 * y * across + y**2 * volume,
        ]
    )


def island_shares(
    patches: Partition,
    watersheds: Watersheds,
    islands: Islands,
    height: Array,
    lengths: tuple[float, float],
) -> tuple[Array, Array]:
    """Return the shares of N patches in the force and in the area of each island, (m, N).

    A sample at a height e above its level weighs as Hertz's pressure does in a paraboloid cap of
    height w, (2 e/w − 1)^½, in force, and as 1 in area where e > w/2. Samples that straddle a
    border are shared by area.

    Args:
        patches: The patches; every peak above the plane lies in one.
        watersheds: Watersheds of the surface.
        islands: The m islands.
        height: Heights of the n peaks above their own levels, negative below, shape (n,) [mm].
        lengths: Sides (Lx, Ly) of the surface [mm].
    """
    sheds = watersheds
    owner, sample, height = sheds.above(height)
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
