"""Nodal forces of tractions on the sides of a block, by rules refined towards the loads.

The tractions are those of pressures on rectangles of the top. They bend on the scale of the
rectangles, and change at once in the corners of a rectangle that adjoins the side: the rules are
finer than the rectangles along the top and grow geometrically into the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.meshes import BlockShape
from geometry.patches import PatchGrid

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_FINEST = 0.02
"""First step into the depth, in sides of a rectangle."""
_GROWTH = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class LineRule:
    """Quadrature along one grid line with the hat functions of its ticks.

    Args:
        points: Coordinates, shape (n,) [mm].
        hats: Weights times hat functions, shape (n, ticks) [mm].
    """

    points: Array
    hats: Array

    @classmethod
    def between(cls, ticks: Array, breaks: Array) -> LineRule:
        """Place Gauss points between all ticks and breaks.

        Args:
            ticks: Grid planes, ascending [mm].
            breaks: Further places where the integrand may bend [mm].
        """
        slack = 1e-9 * (ticks[-1] - ticks[0])
        inside = breaks[(breaks > ticks[0]) & (breaks < ticks[-1])]
        ends = np.unique(np.concatenate([ticks, inside]))
        ends = ends[np.concatenate([[True], np.diff(ends) > slack])]
        half = 0.5 * np.diff(ends)[:, None]
        points = (0.5 * (ends[1:] + ends[:-1])[:, None] + half * _NODES).ravel()
        weights = (half * _WEIGHTS).ravel()
        hats = np.stack([np.interp(points, ticks, unit) for unit in np.eye(len(ticks))], axis=1)
        return cls(points, weights[:, None] * hats)


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side plane of a block: its points, where its nodes are, and how to integrate over it.

    Args:
        axis: 0 for a plane across x, 1 across y.
        outward: −1.0 for the lower plane, 1.0 for the upper.
        along: Rule along the top's edge.
        down: Rule along z.
        place: Coordinate of the plane [mm].
        nodes: Grid indices (i, j, k) of its nodes, shape (ticks along, ticks in z, 3).
    """

    axis: int
    outward: float
    along: LineRule
    down: LineRule
    place: float
    nodes: NDArray[np.intp]

    @property
    def points(self) -> tuple[Array, Array, Array]:
        """Abscissae, ordinates and depths of all points, along the edge first, flat [mm]."""
        along, down = np.meshgrid(self.along.points, self.down.points, indexing="ij")
        across = np.full(along.size, self.place)
        x, y = (across, along.ravel()) if self.axis == 0 else (along.ravel(), across)
        return x, y, -down.ravel()

    def nodal(self, values: Array) -> Array:
        """Integrate values at the points, shape (n, m), against the nodes' hats.

        Returns:
            Integrals, shape (ticks along, ticks in z, m).
        """
        shape = len(self.along.points), len(self.down.points), -1
        part = np.tensordot(self.along.hats, values.reshape(shape), axes=(0, 0))
        return np.asarray(np.tensordot(part, self.down.hats, axes=(1, 0)).transpose(0, 2, 1))


def sides(shape: BlockShape, loads: PatchGrid) -> list[Side]:
    """Return the four side planes of a block, with rules for loads on its top.

    Args:
        shape: The block.
        loads: The rectangles under pressure.
    """
    ticks = shape.ticks
    smallest = min(loads.size)
    steps = smallest * _FINEST * _GROWTH ** np.arange(64)
    depths = steps[steps < shape.height]
    down = LineRule.between(ticks[2], -depths)
    found = []
    for axis in (0, 1):
        edge = ticks[1 - axis]
        borders = loads.borders_y if axis == 0 else loads.borders_x
        along = LineRule.between(edge, borders)
        for end, outward in ((0, -1.0), (len(ticks[axis]) - 1, 1.0)):
            grid = np.meshgrid(np.arange(len(edge)), np.arange(len(ticks[2])), indexing="ij")
            across = np.full_like(grid[0], end)
            nodes = (across, *grid) if axis == 0 else (grid[0], across, grid[1])
            place = float(ticks[axis][end])
            found.append(Side(axis, outward, along, down, place, np.stack(nodes, axis=2)))
    return found
