"""Interpolation over the distance from a side, on nodes evenly spaced in its logarithm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Array = NDArray[np.float64]

_STEP = 0.4
"""Distance of the nodes, in the logarithm; cubics between them err by 1e-3 of 1/(x + x')."""
_GAUSS = np.polynomial.legendre.leggauss(4)


def distance_nodes(nearest: float, farthest: float) -> Array:
    """Return nodes from one distance to another at least, ascending [mm].

    Args:
        nearest: First node [mm]; what is interpolated is taken for constant below it.
        farthest: A distance within the nodes [mm].
    """
    count = int(np.ceil(np.log(farthest / nearest) / _STEP)) + 1
    return np.asarray(nearest * np.exp(_STEP * np.arange(max(count, 4))))


def values_at(nodes: Array, distances: Array) -> csr_array:
    """Return the cubic interpolation from nodes to distances, shape (distances, nodes).

    Args:
        nodes: Of `distance_nodes`, shape (a,) [mm].
        distances: Shape (n,) [mm].
    """
    place = np.log(np.clip(distances, nodes[0], nodes[-1]) / nodes[0]) / _STEP
    first = np.clip(place.astype(np.intp) - 1, 0, len(nodes) - 4)
    t = place - first
    entries = np.stack(
        [
            -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0,
            t * (t - 2.0) * (t - 3.0) / 2.0,
            -t * (t - 1.0) * (t - 3.0) / 2.0,
            t * (t - 1.0) * (t - 2.0) / 6.0,
        ],
        axis=1,
    )
    columns = first[:, None] + np.arange(4)
    rows = np.repeat(np.arange(len(distances)), 4)
    shape = len(distances), len(nodes)
    return csr_array((entries.ravel(), (rows, columns.ravel())), shape=shape)


def means_over(nodes: Array, borders: Array) -> csr_array:
    """Return the means of the interpolation over intervals, shape (intervals, nodes).

    Args:
        nodes: Of `distance_nodes`, shape (a,) [mm].
        borders: Of the intervals, ascending [mm].
    """
    inside = nodes[(nodes > borders[0]) & (nodes < borders[-1])]
    ends = np.union1d(borders, inside)  # the interpolation bends at the nodes
    half = 0.5 * np.diff(ends)[:, None]
    points = (0.5 * (ends[1:] + ends[:-1])[:, None] + half * _GAUSS[0]).ravel()
    owner = np.searchsorted(borders, points) - 1
    weights = (half * _GAUSS[1]).ravel() / np.diff(borders)[owner]
    sums = csr_array((weights, (owner, np.arange(points.size))))
    return csr_array(sums @ values_at(nodes, points))
