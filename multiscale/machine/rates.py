"""How fast this machine does the few kinds of work that a run consists of, measured on demand."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache, cached_property

import numpy as np
from scipy import fft, linalg
from scipy.sparse import csr_array

_ENOUGH = 0.04  # seconds that a rate is measured for, at most a few repetitions more
_LEAST = 3  # repetitions


class Machine:
    """Seconds for a unit of each kind of work, on one core of the machine as it is now.

    A rate is measured when it is first asked for, a tenth of a second or less each, and then kept.
    It is the smallest of repeated measurements: other work on the machine does not count.
    """

    @cached_property
    def call(self) -> float:
        """Seconds for one call into numpy that does next to nothing: interpreted work."""
        small: np.ndarray = np.ones(8)

        def calls() -> None:
            for _ in range(1000):
                np.add(small, small)

        return _seconds(calls) / 1000

    @cached_property
    def passes(self) -> float:
        """Seconds to add two numbers of long arrays."""
        many: np.ndarray = np.ones(1 << 20)
        out = np.empty_like(many)
        return _seconds(lambda: np.add(many, many, out=out)) / many.size

    @cached_property
    def transform(self) -> float:
        """Seconds of a real transform in two dimensions of N points over N log2 N."""
        points: np.ndarray = np.ones((384, 384))
        work = points.size * np.log2(points.size)
        return _seconds(lambda: fft.rfft2(points)) / float(work)

    @cached_property
    def function(self) -> float:
        """Seconds to evaluate a logarithm of a long array's numbers."""
        many = np.linspace(1.0, 2.0, 1 << 15)
        return _seconds(lambda: np.log(many)) / many.size

    @cached_property
    def flop(self) -> float:
        """Seconds for an operation of a dense factorisation, which runs at the speed of products.

        Sparse direct factorisations do nearly all of their work in dense fronts.
        """
        order = 500
        matrix = np.eye(order) + 1e-3
        spent = _seconds(lambda: linalg.cho_factor(matrix, check_finite=False))
        return spent / (order**3 / 3)

    @cached_property
    def product(self) -> float:
        """Seconds per entry of a sparse matrix, larger than caches, times a vector."""
        order, bands = 60_000, 40
        starts = np.arange(0, (order + 1) * bands, bands)
        columns = np.clip(np.arange(order)[:, None] + np.arange(bands), 0, order - 1).ravel()
        matrix = csr_array((np.ones(columns.size), columns, starts), shape=(order, order))
        vector = np.ones(order)
        return _seconds(lambda: matrix @ vector) / matrix.nnz


@cache
def this_machine() -> Machine:
    """Return the machine that runs this process; its rates are measured once per process."""
    return Machine()


def _seconds(work: Callable[[], object]) -> float:
    """Return the smallest time of repeated work [s]."""
    work()  # what is made on first use does not count
    best, spent, count = np.inf, 0.0, 0
    while count < _LEAST or spent < _ENOUGH:
        start = time.perf_counter()
        work()
        taken = time.perf_counter() - start
        best, spent, count = min(best, taken), spent + taken, count + 1
    return float(best)
