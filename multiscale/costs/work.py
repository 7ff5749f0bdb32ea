"""Work, in seconds on the machine where it was measured, and how much slower this machine is."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy import fft
from scipy.sparse import csr_array

_TRANSFORM, _PRODUCT = 0.51e-3, 2.8e-3
"""Times of the two benchmarks on one core of an Intel Xeon (Rocket Lake, 3 GHz), on which all work
was measured [s]."""
_LEAST_TIME, _LEAST_REPETITIONS = 0.04, 3
"""Time [s] and repetitions that a benchmark takes at least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """Time that something takes on one core of the machine where work was measured.

    Attributes:
        arrays: Time of numpy: transforms, dense matrices and interpreted calls [s].
        sparse: Time of products with sparse matrices, which the memory's speed limits [s].
    """

    arrays: float = 0.0
    sparse: float = 0.0

    def __add__(self, other: Work) -> Work:
        return Work(arrays=self.arrays + other.arrays, sparse=self.sparse + other.sparse)

    def __mul__(self, times: float) -> Work:
        return Work(arrays=times * self.arrays, sparse=times * self.sparse)

    __rmul__ = __mul__


class Machine:
    """How many times longer work takes here than on the machine where it was measured.

    Both ratios are measured when they are first needed and then kept. Each takes a tenth of a
    second. The shortest of several repetitions counts, so that other programs hardly matter.
    """

    @cached_property
    def arrays(self) -> float:
        """Ratio for numpy, from a real transform of 384 × 384 points."""
        points: np.ndarray = np.ones((384, 384))
        return _shortest(lambda: fft.rfft2(points)) / _TRANSFORM

    @cached_property
    def sparse(self) -> float:
        """Ratio for sparse products, from a matrix of 2.4 million entries times a vector."""
        order, bands = 60_000, 40
        starts = np.arange(0, (order + 1) * bands, bands)
        columns = np.clip(np.arange(order)[:, None] + np.arange(bands), 0, order - 1).ravel()
        matrix = csr_array((np.ones(columns.size), columns, starts), shape=(order, order))
        vector = np.ones(order)
        return _shortest(lambda: matrix @ vector) / _PRODUCT

    def seconds(self, work: Work) -> float:
        """Return the time that work takes here [s]; only ratios that it needs are measured."""
        arrays = work.arrays * self.arrays if work.arrays else 0.0
        return arrays + (work.sparse * self.sparse if work.sparse else 0.0)


@cache
def this_machine() -> Machine:
    """Return the machine that runs this process, whose ratios are measured once."""
    return Machine()


def _shortest(work: Callable[[], object]) -> float:
    """Return the shortest time of repeated work [s]; the first time is not counted."""
    work()
    times: list[float] = []
    while len(times) < _LEAST_REPETITIONS or sum(times) < _LEAST_TIME:
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)
