"""The Hertz contact that stands for a region above the plane, from its volume and moments.

A paraboloid cap of height w with principal radii R', R'' has the elliptic base of semi-axes
sqrt(2 R' w), sqrt(2 R'' w). Integrated over the cap,

    V = π sqrt(R' R'') w²,    ∫ X² dV / V = R' w/3,    ∫ Y² dV / V = R'' w/3,

X and Y from its centroid along the principal directions. Read backwards, the volume of any region
gives R = V/(π w²), the ratio of the principal moments gives R'/R'', their direction the ellipse's.

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from micro.closed_forms.ellipse import shape_factors
from micro.islands.watersheds import Watersheds

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LARGEST_AREA_FRACTION = 0.08
"""Contact area fraction up to which the model is within its stated error."""

GROWN_AREA_FRACTION = 0.04
"""The same where one island holds more than `LARGEST_SHARE` of the contact area."""

LARGEST_SHARE = 0.5

_MOST_SLENDER = 1e4


class Paraboloids(NamedTuple):
    """Paraboloid caps equivalent to m regions.

    Attributes:
        x: Abscissae of the centroids of volume, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the larger principal radii from the x axis, shape (m,) [rad].
        radius: R = sqrt(R' R''), shape (m,) [mm].
        ratio: R'/R'' ≥ 1, shape (m,).
    """

    x: Array
    y: Array
    angle: Array
    radius: Array
    ratio: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Islands:
    """Connected regions above the plane as Hertz contacts, for E* = 1 MPa.

    Args:
        member: Island of each of the n peaks, −1 below the plane, shape (n,).
        top: The highest peak of each island, shape (m,).
        depth: Heights w of the highest peaks above their level, shape (m,) [mm].
        x: Abscissae of the centroids of volume, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the major axes from the x axis, shape (m,) [rad].
        semi_axes: Semi-axes of contact (a, b), shape (m, 2) [mm].
        force: Forces over E*, shape (m,) [mm²].
    """

    member: Indices
    top: Indices
    depth: Array
    x: Array
    y: Array
    angle: Array
    semi_axes: Array
    force: Array

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
    shape = shape_factors(found.ratio, np.ones(count))
    major = shape.axis * np.sqrt(found.radius * depth)
    return Islands(
        member=member,
        top=top,
        depth=depth,
        x=found.x,
        y=found.y,
        angle=found.angle,
        semi_axes=np.stack([major, major * np.sqrt(shape.axis_ratio_squared)], axis=1),
        force=4.0 / 3.0 * np.sqrt(found.radius) * shape.force * depth**1.5,
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
    radius = np.hypot(half, cross)
    largest = np.maximum(mean + radius, np.finfo(float).tiny)  # 0 for a single sample
    return Paraboloids(
        x=x,
        y=y,
        angle=np.mod(0.5 * np.arctan2(cross, half), np.pi),
        radius=volume / (np.pi * depth**2),
        ratio=largest / np.clip(mean - radius, largest / _MOST_SLENDER, largest),
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IslandState:
    """Contacts of m islands at one approach.

    Args:
        approach: Rigid approach δ at the centre [mm].
        x: Abscissae of the contacts, shape (m,) [mm].
        y: Ordinates, shape (m,) [mm].
        angle: Directions of the major semi-axes from the x axis, shape (m,) [rad].
        indentation: Heights w of the displaced islands above the plane, shape (m,) [mm].
        semi_axes: Semi-axes (a, b) of the contacts, shape (m, 2) [mm].
        contact_area: Areas π a b, shape (m,) [mm²].
        force: Forces, shape (m,) [N].
        merged: Number of peaks that belong to an island with a higher peak.
        nominal_area: Area of the surface [mm²].
        iterations: Iterations made.
        residual: Last change of a displacement relative to the largest interference.
    """

    approach: float
    x: Array
    y: Array
    angle: Array
    indentation: Array
    semi_axes: Array
    contact_area: Array
    force: Array
    merged: int
    nominal_area: float
    iterations: int
    residual: float

    @property
    def warning(self) -> str:
        """Why the result lies outside the model's range of validity; empty within it.

        Outside means a contact area above 8 % of the nominal one, or above 4 % with more than
        half of it in one island. The regions then grow together across the surface, and the force
        may be tens of per cent low and the area as much too large.
        """
        total = float(self.contact_area.sum())
        fraction = total / self.nominal_area
        share = float(self.contact_area.max(initial=0.0)) / (total or 1.0)
        grown = fraction > GROWN_AREA_FRACTION and share > LARGEST_SHARE
        if fraction <= LARGEST_AREA_FRACTION and not grown:
            return ""
        return (
            f"at an approach of {self.approach:.4g} mm the islands cover {fraction:.1%} of the"
            f" surface, the largest {share:.0%} of it: they grow together, and the model islands"
            f" stands for up to {LARGEST_AREA_FRACTION:.0%}"
            f" ({GROWN_AREA_FRACTION:.0%} when one holds more than half)"
        )
