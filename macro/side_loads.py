"""Nodal forces of tractions on the sides of a block, by rules refined towards the loads.

The tractions are those of pressures on rectangles of the top. They bend on the scale of the
rectangles, and change at once in the corners of a rectangle that adjoins the side: the rules are
finer than the rectangles along the top and grow geometrically into the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.partition import Partition
from geometry.smooth_shape import SmoothShape

Array = NDArray[np.float64]

ORDER = 4
"""Gauss points in each interval."""

_FINEST = 0.02
"""First step into the depth, in sides of a rectangle."""
_GROWTH = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class LineRule:
    """Quadrature along one grid line with the quadratic shape functions of its nodes.

    Args:
        points: Coordinates, shape (n,) [mm].
        shapes: Weights times shape functions, shape (n, nodes) [mm].
    """

    points: Array
    shapes: Array

    @classmethod
    def between(cls, ticks: Array, breaks: Array, order: int = ORDER) -> LineRule:
        """Place Gauss points between all ticks and breaks.

        Args:
            ticks: Grid planes, ascending [mm]; nodes lie on them and half-way between.
            breaks: Further places where the integrand may bend [mm].
            order: Gauss points in each interval.
        """
        slack = 1e-9 * (ticks[-1] - ticks[0])
        inside = breaks[(breaks > ticks[0]) & (breaks < ticks[-1])]
        ends = np.unique(np.concatenate([ticks, inside]))
        ends = ends[np.concatenate([[True], np.diff(ends) > slack])]
        nodes, weights = np.polynomial.legendre.leggauss(order)
        half = 0.5 * np.diff(ends)[:, None]
        points = (0.5 * (ends[1:] + ends[:-1])[:, None] + half * nodes).ravel()
        return cls(points, (half * weights).reshape(-1, 1) * _quadratics(ticks, points))


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One side plane of a block: its points, where its nodes are, and how to integrate over it.

    Args:
        axis: 0 for a plane across x, 1 across y.
        outward: −1.0 for the lower plane, 1.0 for the upper.
        along: Rule along the top's edge.
        down: Rule along z.
        place: Coordinate of the plane [mm].
        nodes: Grid indices (i, j, k) of its nodes, shape (nodes along, nodes in z, 3).
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
        """Integrate values at the points, shape (n, m), against the nodes' shape functions.

        Returns:
            Integrals, shape (nodes along, nodes in z, m).
        """
        shape = len(self.along.points), len(self.down.points), -1
        part = np.tensordot(self.along.shapes, values.reshape(shape), axes=(0, 0))
        return np.asarray(np.tensordot(part, self.down.shapes, axes=(1, 0)).transpose(0, 2, 1))


def sides(shape: SmoothShape, loads: Partition, order: int = ORDER) -> list[Side]:
    """Return the four side planes of a block, with rules for loads on its top.

    Args:
        shape: The block.
        loads: The rectangles under pressure.
        order: Gauss points in each interval.
    """
    ticks, counts = shape.ticks, [len(nodes) for nodes in shape.nodes]
    narrowest = min(np.diff(loads.borders_x).min(), np.diff(loads.borders_y).min())
    steps = narrowest * _FINEST * _GROWTH ** np.arange(64)
    down = LineRule.between(ticks[2], -steps[steps < shape.height], order)
    found = []
    for axis in (0, 1):
        borders = loads.borders_y if axis == 0 else loads.borders_x
        along = LineRule.between(ticks[1 - axis], borders, order)
        for end, outward in ((0, -1.0), (counts[axis] - 1, 1.0)):
            edge, depth = np.indices((counts[1 - axis], counts[2]))
            across = np.full_like(edge, end)
            nodes = (across, edge, depth) if axis == 0 else (edge, across, depth)
            place = float(shape.nodes[axis][end])
            found.append(Side(axis, outward, along, down, place, np.stack(nodes, axis=2)))
    return found


def _quadratics(ticks: Array, points: Array) -> Array:
    """Return the quadratic shape functions of all nodes at points, shape (n, nodes)."""
    cell = np.clip(np.searchsorted(ticks, points) - 1, 0, len(ticks) - 2)
    t = (points - ticks[cell]) / np.diff(ticks)[cell]
    values = np.zeros((len(points), 2 * len(ticks) - 1))
    parts = ((1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0))
    for place, part in enumerate(parts):
        values[np.arange(len(points)), 2 * cell + place] = part
    return values
