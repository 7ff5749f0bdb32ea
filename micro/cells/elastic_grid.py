"""The elastic half-space seen through a grid of cells: pressures to displacements and back."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from micro.cells.convolution import Convolution
from micro.cells.free_sides import FreeSides
from micro.cells.kernels import padded_spectrum, periodic_spectrum
from micro.cells.reach import Box
from micro.cells.side_cells import SideCells, SomeCells, side_cells

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_GRIDS = 16
"""Grids kept: two or three sizes of box with their coarse grids."""


class Cells(NamedTuple):
    """Some cells of a grid.

    Attributes:
        flat: Their flat indices, rising, shape (n,).
        rows: The rows that they lie in, shape (r,).
        place: Their flat indices in an array of these rows alone, shape (n,).
    """

    flat: Indices
    rows: Indices
    place: Indices

    @classmethod
    def where(cls, mask: NDArray[np.bool_]) -> Self:
        """Return the cells that a mask of shape (nx, ny) marks."""
        rows = np.flatnonzero(mask.any(axis=1))
        return cls(np.flatnonzero(mask), rows, np.flatnonzero(mask[rows]))


class ElasticGrid:
    """Compliance of nx × ny cells under pressures that are uniform on each, for E* = 1.

    Displacements are evaluated in double precision. Corrections, which only have to reduce an
    error that is then evaluated anew, are made of products in single precision: with the
    compliance, and with an approximate inverse. That is the inverse of the kernel on a period as
    large as the grid; cut down to the cells in contact it preconditions conjugate gradients, as
    the inverse by transforms of Zhao, Vollebregt & Oosterlee 2014 (Numer. Linear Algebra Appl.
    21, 256-274) smooths their multigrid.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether pressures continue periodically; a half-space that is loaded on the grid
            alone otherwise.
        sides: What free sides add, if there are any, and where the grid lies between them.
    """

    def __init__(
        self,
        grid: tuple[int, int],
        spacing: tuple[float, float],
        *,
        periodic: bool,
        sides: tuple[SideCells, Box] | None = None,
    ) -> None:
        self._beside = None if sides is None else _Beside(*sides)
        self.grid, self.spacing, self.periodic = grid, spacing, periodic
        nx, ny = grid
        if periodic:
            padded, spectrum = grid, periodic_spectrum(grid, spacing)
        else:
            padded = _good(2 * nx - 1), _good(2 * ny - 1)
            spectrum = padded_spectrum(padded, spacing)
        rough = spectrum.astype(np.float32)
        period = grid if periodic else (_good(nx), _good(ny))
        inverse = _inverse(spectrum if periodic else periodic_spectrum(period, spacing))
        work = np.empty(spectrum.shape, complex)  # one for all: they take turns
        single = work.ravel().view(np.complex64)
        self._compliance = Convolution(spectrum, grid, padded, work)
        self._compliance_of_cells = Convolution(rough, grid, padded, _part(single, rough.shape))
        self._stiffness = Convolution(inverse, grid, period, _part(single, inverse.shape))
        self.products = 0

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures on all cells, shape (nx, ny) [mm]."""
        self.products += 1
        found = self._compliance(pressure.copy())
        if self._beside is not None:
            found += self._beside.all.displacement(pressure)
        return found

    def comply(self, cells: Cells, pressure: Array) -> Array:
        """Return roughly the displacements of some cells by pressures on them, shape (n,) [mm]."""
        self.products += 1
        found = _among(cells, pressure, self._compliance_of_cells)
        if self._beside is not None:
            found += self._beside.of_cells(cells, pressure)
        return found

    def resist(self, cells: Cells, displacement: Array) -> Array:
        """Return very roughly the pressures on some cells that displace them so, shape (n,)."""
        return _among(cells, displacement, self._stiffness)


class _Beside:
    """What free sides add on a grid, and on those of its cells that were last asked for."""

    def __init__(self, sides: SideCells, box: Box) -> None:
        self._sides = sides
        self._rows, self._columns = (np.arange(part.start, part.stop) for part in box)
        self.all = sides.among(self._rows, self._columns)
        self._last: tuple[Cells, SomeCells, Indices, tuple[int, int]] | None = None

    def of_cells(self, cells: Cells, pressure: Array) -> Array:
        """Return the displacements of some cells by pressures on them, shape (n,) [mm]."""
        if self._last is None or self._last[0] is not cells:
            row, column = np.divmod(cells.place, len(self._columns))
            columns, column = np.unique(column, return_inverse=True)
            some = self._sides.among(self._rows[cells.rows], self._columns[columns])
            place = row * len(columns) + column.ravel()
            self._last = cells, some, place, (len(cells.rows), len(columns))
        _, some, place, shape = self._last
        field = np.zeros(shape)
        field.ravel()[place] = pressure
        return np.asarray(some.displacement(field).ravel()[place])


def _among(cells: Cells, values: Array, convolution: Convolution) -> Array:
    scale = float(np.abs(values).max(initial=0.0)) or 1.0  # single precision ends at 1e-38
    field = np.zeros((len(cells.rows), convolution.grid[1]), np.float32)
    field.ravel()[cells.place] = values / scale
    found = convolution(field, cells.rows).ravel()[cells.place]
    return found.astype(np.float64) * scale


def _good(count: int) -> int:
    """Return the next number of cells with a fast transform."""
    return int(fft.next_fast_len(count, real=True))


def _part(memory: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the beginning of some memory as an array."""
    return memory[: shape[0] * shape[1]].reshape(shape)


def _inverse(spectrum: Array) -> NDArray[np.float32]:
    """Invert a spectrum; where it vanishes, at the mean of a period, as its largest value."""
    floor = np.where(spectrum > 0.0, spectrum, spectrum.max() or 1.0)
    return (1.0 / floor).astype(np.float32)


class ElasticGrids:
    """The grids of one model, kept for the next solution with their kernels and work arrays.

    Args:
        periodic: Whether pressures continue periodically.
        sides: Free sides, if there are any.
    """

    def __init__(self, *, periodic: bool, sides: FreeSides | None = None) -> None:
        self.periodic, self.sides = periodic, sides
        self._known: dict[tuple[object, ...], ElasticGrid] = {}

    def at(
        self, grid: tuple[int, ...], spacing: tuple[float, float], box: Box | None = None
    ) -> ElasticGrid:
        """Return the grid with these cells; free sides act on it where its place is known."""
        nx, ny = grid
        key: tuple[object, ...] = (nx, ny, *spacing)
        sides = None
        if self.sides is not None and box is not None:
            key = (*key, box.rows.start, box.columns.start)
            sides = side_cells(self.sides, spacing), box
        if key not in self._known:
            if len(self._known) >= _MOST_GRIDS:
                del self._known[next(iter(self._known))]
            self._known[key] = ElasticGrid((nx, ny), spacing, periodic=self.periodic, sides=sides)
        return self._known[key]

    def __reduce__(self) -> tuple[object, ...]:
        """Travel without the work arrays."""
        return _empty_grids, (self.periodic, self.sides)


def _empty_grids(periodic: bool, sides: FreeSides | None) -> ElasticGrids:
    return ElasticGrids(periodic=periodic, sides=sides)
