"""How fast this machine is, from benchmarks of a fraction of a second, made anew for every plan.

Nothing is kept between processes: the speed of a shared machine changes from hour to hour, and that
of threads with their number. The shortest of several times, on the wall and of the threads
themselves, tells how fast idle cores are. What other programs take of the cores meanwhile is
measured beside (`busy_cores`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from scipy import fft
from scipy.sparse import csr_matrix

from geometry.cores import cores
from micro.compliance.half_space_grid import HalfSpaceGrid
from multiscale.planning.busy_cores import Clocks, Competition

_TRANSFORM, _PRODUCT = 0.51e-3, 2.8e-3
"""Times of two benchmarks of `Machine` where all other times were measured [s]."""
_WATCHED, _REPETITIONS = 0.25, 5
"""Time that the first benchmark is repeated for, long enough to count what others use [s], and how
often the others are repeated."""
_EVEN = 1.1
"""Time of work in threads over the mean of what each of them is busy with, on idle cores."""
_SIDES = (32, 128, 512, 1024)
"""Cells along a side of the grids that products are timed on."""


class Machine:
    """How many times longer work takes here than on the machine where it was measured.

    All is measured when it is first needed and then kept by the instance.

    Args:
        clocks: The clocks that tell what other programs use.
    """

    def __init__(self, clocks: Clocks | None = None) -> None:
        self._clocks = clocks or Clocks()
        self._products: dict[tuple[int, int], float] = {}

    @property
    def measured(self) -> frozenset[str]:
        """What has been measured so far."""
        kept = {"_arrays": "arrays", "sparse": "sparse"}
        found = {kept[name] for name in vars(self) if name in kept}
        return frozenset(found | {"products"} if self._products else found)

    @cached_property
    def _arrays(self) -> tuple[float, Competition]:
        """Shortest time of a real transform of 384 × 384 points, and what others did meanwhile."""
        points: np.ndarray = np.ones((384, 384))
        found: list[Competition] = []
        times: list[float] = []
        with self._clocks.around(found):
            until = self._clocks.wall() + _WATCHED
            while not times or self._clocks.wall() < until:
                times.append(self._shortest(lambda: fft.rfft2(points), repetitions=1))
        return min(times), found[0]

    @property
    def competition(self) -> Competition:
        """What other programs take of the cores."""
        return self._arrays[1]

    @property
    def arrays(self) -> float:
        """Ratio for numpy, on idle cores."""
        return self._arrays[0] / _TRANSFORM

    @cached_property
    def sparse(self) -> float:
        """Ratio for sparse products on idle cores, from one of 2.4 million entries."""
        order, bands = 60_000, 40
        columns = (np.arange(order)[:, None] + np.arange(bands)) % order
        starts, vector = bands * np.arange(order + 1), np.ones(order)
        matrix = csr_matrix((np.ones(columns.size), columns.ravel(), starts), (order, order))
        return self._shortest(lambda: matrix @ vector) / _PRODUCT

    def product(self, cells: float) -> float:
        """Return the time of a product with the half-space of a square grid on idle cores [s].

        It is measured on the present number of threads, up to grids of 1024² cells, and grows as
        n log n between and beyond the measured ones.

        Args:
            cells: Cells of the grid.
        """
        cells = max(cells, 64.0)
        sides = [side for side in _SIDES if side**2 <= cells] or [_SIDES[0]]
        if sides[-1] != _SIDES[-1]:
            above = _SIDES[_SIDES.index(sides[-1]) + 1]
            low, high = sides[-1] ** 2, above**2
            if cells > low:
                share = np.log(cells / low) / np.log(high / low)
                each = (1.0 - share) * np.log(self._each(sides[-1]))
                return _work(cells) * float(np.exp(each + share * np.log(self._each(above))))
        return _work(cells) * self._each(sides[-1])

    def _each(self, side: int) -> float:
        """Return the time of a product over its work n log n [s]."""
        key = side, cores()
        if key not in self._products:
            grid = HalfSpaceGrid((side, side), (1.0, 1.0), periodic=False)
            pressure = np.ones((side, side))
            shortest = self._shortest(lambda: grid.compliance(pressure.copy()), threads=cores())
            self._products[key] = shortest / _work(side**2)
        return self._products[key]

    def _shortest(
        self, work: Callable[[], Any], *, threads: int = 1, repetitions: int = _REPETITIONS
    ) -> float:
        """Return the time that work takes on idle cores, as far as repetitions show it [s].

        On cores that others use, the wall clock tells less than the time that the threads had.
        """
        times = []
        for _ in range(repetitions):
            wall, own = self._clocks.wall(), self._clocks.own()
            work()
            wall, own = self._clocks.wall() - wall, self._clocks.own() - own
            times.append(min(wall, _EVEN * own / threads) if own > 0.0 else wall)
        return min(times)


def _work(cells: float) -> float:
    return cells * float(np.log2(4.0 * cells))


THIS_MACHINE = Machine()
"""The machine that runs this process."""
