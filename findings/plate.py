"""A closed plate with a rough face, for findings in programs that work on triangles."""

import numpy as np


def plate(n):
    """Return points and triangles of a plate of 100 by 100 by 10 with waves of amplitude 1 on top.

    Args:
        n: Points a side.

    Returns:
        Points, shape (2 n², 3), those of the top first, and triangles that face outwards.
    """
    at = np.linspace(0, 100, n)
    x, y = np.meshgrid(at, at, indexing="ij")
    height = 10 + np.cos(0.06 * np.pi * x) * np.cos(0.04 * np.pi * y)
    points = np.vstack([np.stack([x, y, z], -1).reshape(-1, 3) for z in (height, 0 * x)])
    place = np.arange(n * n).reshape(n, n)
    corners = place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]
    a, b, c, d = (one.ravel() for one in corners)
    top = np.vstack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    rim = np.concatenate([place[:-1, 0], place[-1, :-1], place[:0:-1, -1], place[0, :0:-1]])
    after = np.roll(rim, -1)
    sides = [
        np.stack([rim, rim + n * n, after + n * n], 1),
        np.stack([rim, after + n * n, after], 1),
    ]
    return points, np.vstack([top, top[:, ::-1] + n * n, *sides])


def volume(points, triangles):
    """Return the volume within triangles that face outwards."""
    corners = np.asarray(points, float)[triangles]
    return np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
