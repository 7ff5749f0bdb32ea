"""How fast this machine is, from two benchmarks of a few milliseconds."""

from __future__ import annotations

import timeit
from functools import cached_property

import numpy as np
from scipy import fft
from scipy.sparse import csr_matrix

_TRANSFORM, _PRODUCT, _REPETITIONS = 0.51e-3, 2.8e-3, 30
"""Times of the two benchmarks of `Machine` where all other times were measured [s], and how often
they are repeated. The shortest time counts, so that other programs hardly matter."""


class Machine:
    """How many times longer work takes here than on the machine where it was measured.

    Both ratios are measured when they are first needed and then kept.
    """

    @cached_property
    def arrays(self) -> float:
        """Ratio for numpy, from a real transform of 384 × 384 points."""
        points: np.ndarray = np.ones((384, 384))
        times = timeit.repeat(lambda: fft.rfft2(points), number=1, repeat=_REPETITIONS)
        return min(times) / _TRANSFORM

    @cached_property
    def sparse(self) -> float:
        """Ratio for sparse products, from a matrix of 2.4 million entries times a vector."""
        order, bands = 60_000, 40
        columns = (np.arange(order)[:, None] + np.arange(bands)) % order
        starts, vector = bands * np.arange(order + 1), np.ones(order)
        matrix = csr_matrix((np.ones(columns.size), columns.ravel(), starts), (order, order))
        return min(timeit.repeat(lambda: matrix @ vector, number=1, repeat=_REPETITIONS)) / _PRODUCT


THIS_MACHINE = Machine()
"""The machine that runs this process."""
