"""Compliance that free sides add to the half-space, between patches of the rectangle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import Partition
from micro.compliance.distance_nodes import distance_nodes, means_over
from micro.compliance.free_sides import FreeSides

Array = NDArray[np.float64]

_SHORTEST = 8.0  # waves on the narrowest patch along a side
_NEAREST = 1.0 / 256.0  # of the narrowest patch across it: the first node


def side_patches(sides: FreeSides, patches: Partition) -> Array:
    """Return the mean displacement of patches by unit pressure on patches, for E* = 1.

    Args:
        sides: The free sides.
        patches: N patches that fill the rectangle between them.

    Returns:
        Patch i by patch j; symmetric for patches of equal area, shape (N, N) [mm].
    """
    x, y = patches.borders_x, patches.borders_y
    total = _by_two(sides, 0, x, y).transpose(0, 2, 1, 3)
    total += _by_two(sides, 1, y, x).transpose(2, 0, 3, 1)
    return np.asarray(total.reshape(patches.count, patches.count))


def _by_two(sides: FreeSides, axis: int, across: Array, along: Array) -> Array:
    """Return what two opposite sides add, by intervals across them and along."""
    length, period = sides.lengths[axis], 2.0 * sides.lengths[1 - axis]
    widths, middles = np.diff(along), 0.5 * (along[1:] + along[:-1])
    waves = np.arange(int(np.ceil(_SHORTEST * period / widths.min())))
    nodes = distance_nodes(_NEAREST * float(np.diff(across).min()), length)
    compliance = sides.compliance(axis, nodes, waves)
    lines = 0.0
    for seen in (means_over(nodes, across), means_over(nodes, length - across[::-1])[::-1]):
        lines = lines + seen.toarray() @ compliance @ (seen.toarray() * np.diff(across)[:, None]).T
    # cosine series of the period: means of waves over intervals
    mean = np.exp(2j * np.pi / period * np.multiply.outer(waves, middles))
    mean *= np.sinc(np.multiply.outer(waves / period, widths))
    mean *= np.sqrt(np.where(waves == 0, 1.0, 2.0) / period)[:, None]
    both = (mean[:, :, None] * mean[:, None, :].conj()).real * widths
    return np.tensordot(lines, both, axes=(0, 0))
