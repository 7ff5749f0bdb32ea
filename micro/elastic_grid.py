"""The elastic half-space seen through a grid of cells: pressures to displacements and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from micro.convolution import Convolution
from micro.kernels import padded_spectrum, periodic_spectrum

Array = NDArray[np.float64]
Cells = NDArray[np.intp]

_MOST_GRIDS = 16
"""Grids kept: two or three sizes of box with their coarse grids."""


class ElasticGrid:
    """Compliance of nx × ny cells under pressures that are uniform on each, for E* = 1.

    Beside the compliance it holds an approximate inverse, the inverse of the kernel on the padded
    grid in single precision: cut down to the cells in contact it preconditions conjugate gradients
    (van 't Wout et al. 2014), where no more than its sign and size matter.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether pressures continue periodically; a half-space that is loaded on the grid
            alone otherwise.
    """

    def __init__(
        self, grid: tuple[int, int], spacing: tuple[float, float], *, periodic: bool
    ) -> None:
        self.grid, self.spacing, self.periodic = grid, spacing, periodic
        if periodic:
            padded, spectrum = grid, periodic_spectrum(grid, spacing)
        else:
            padded = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in grid)
            spectrum = padded_spectrum(padded, spacing)
        work, self._field = np.empty(spectrum.shape, complex), np.empty(grid)
        # The two products never run at the same time: one borrows the other's arrays.
        self._single = _leading(self._field, np.float32)
        self._compliance = Convolution(spectrum, grid, padded, work)
        stiffness = _inverse(spectrum)
        self._stiffness = Convolution(stiffness, grid, padded, _leading(work, np.complex64))
        self.products = 0

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures on all cells, shape (nx, ny) [mm]."""
        self.products += 1
        return self._compliance(pressure, np.empty(self.grid))

    def comply(self, cells: Cells, pressure: Array) -> Array:
        """Return the displacements of some cells by pressures on the same cells [mm].

        Args:
            cells: Flat indices, shape (n,).
            pressure: Pressures / E*, shape (n,).
        """
        self.products += 1
        self._field[...] = 0.0
        self._field.ravel()[cells] = pressure
        return self._compliance(self._field, self._field).ravel()[cells]

    def resist(self, cells: Cells, displacement: Array) -> Array:
        """Return roughly the pressures on some cells that displace them so, shape (n,)."""
        self._single[...] = 0.0
        self._single.ravel()[cells] = displacement
        found = self._stiffness(self._single, self._single).ravel()[cells]
        return found.astype(np.float64)


def _leading(array: NDArray[Any], kind: type) -> NDArray[Any]:
    """Return the first half of an array's memory as an array in single precision."""
    return array.ravel().view(kind)[: array.size].reshape(array.shape)


def _inverse(spectrum: Array) -> NDArray[np.float32]:
    """Invert a spectrum; where it vanishes, the mean of a period, as its largest value."""
    floor = np.where(spectrum > 0.0, spectrum, spectrum.max())
    return (1.0 / floor).astype(np.float32)


class ElasticGrids:
    """The grids of one model, kept for the next solution with their kernels and work arrays.

    Args:
        periodic: Whether pressures continue periodically.
    """

    def __init__(self, *, periodic: bool) -> None:
        self.periodic = periodic
        self._known: dict[tuple[object, ...], ElasticGrid] = {}

    def at(self, grid: tuple[int, ...], spacing: tuple[float, float]) -> ElasticGrid:
        """Return the grid with these cells."""
        nx, ny = grid
        key = (nx, ny, *spacing)
        if key not in self._known:
            if len(self._known) >= _MOST_GRIDS:
                del self._known[next(iter(self._known))]
            self._known[key] = ElasticGrid((nx, ny), spacing, periodic=self.periodic)
        return self._known[key]

    def __reduce__(self) -> tuple[object, ...]:
        """Travel without the work arrays."""
        return _empty_grids, (self.periodic,)


def _empty_grids(periodic: bool) -> ElasticGrids:
    return ElasticGrids(periodic=periodic)
