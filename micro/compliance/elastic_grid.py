"""The elastic body seen through a grid of cells: pressures to displacements and back.

The compliance is a sum of symmetric terms: the half-space, and what free sides and the rest of a
finite body add to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from micro.compliance.bounding_box import Box
from micro.compliance.convolution import Convolution
from micro.compliance.free_sides import FreeSides
from micro.compliance.kernels import padded_spectrum, periodic_spectrum
from micro.compliance.side_cells import SideCells, SomeCells, side_cells

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_GRIDS = 24
"""Half-spaces kept, those used last: three sizes of box with their coarse grids."""


class Cells(NamedTuple):
    """Some cells of a grid.

    Attributes:
        flat: Their flat indices, rising, shape (n,).
        rows: The rows that they lie in, shape (r,).
        place: Their flat indices in an array of these rows alone, shape (n,).
        columns: Number of columns of the grid.
    """

    flat: Indices
    rows: Indices
    place: Indices
    columns: int

    @classmethod
    def of(cls, flat: Indices, grid: tuple[int, ...]) -> Self:
        """Return cells of a grid (nx, ny) by their flat indices, rising."""
        row = flat // grid[1]
        rows, at = np.unique(row, return_inverse=True)
        return cls(flat, rows, at.ravel() * grid[1] + flat % grid[1], grid[1])


class GridTerm(Protocol):
    """A symmetric part of the compliance of nx × ny cells, beside the half-space's; for E* = 1."""

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures on all cells, shape (nx, ny) [mm]."""
        ...

    def of_cells(self, cells: Cells, pressure: Array) -> Array:
        """Return the displacements of some cells by pressures on them, shape (n,) [mm]."""
        ...


class HalfSpaceGrid:
    """Compliance of nx × ny cells of a half-space, and its approximate inverse, for E* = 1.

    The inverse is that of the kernel on a period as large as the grid; cut down to the cells in
    contact it preconditions conjugate gradients, as the inverse by transforms of Zhao, Vollebregt &
    Oosterlee 2014 (Numer. Linear Algebra Appl. 21, 256-274) smooths their multigrid.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether pressures continue periodically; a half-space that is loaded on the grid
            alone otherwise.

    Attributes:
        compliance: Product in double precision.
        rough_compliance: The same in single precision.
        stiffness: Product with the approximate inverse, in single precision.
    """

    def __init__(
        self, grid: tuple[int, int], spacing: tuple[float, float], *, periodic: bool
    ) -> None:
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
        self.compliance = Convolution(spectrum, grid, padded, work)
        self.rough_compliance = Convolution(rough, grid, padded, _part(single, rough.shape))
        self.stiffness = Convolution(inverse, grid, period, _part(single, inverse.shape))


class ElasticGrid:
    """Compliance of nx × ny cells under pressures that are uniform on each, for E* = 1.

    Displacements are evaluated in double precision. Corrections, which only have to reduce an
    error that is then evaluated anew, are made of products in single precision.

    Args:
        half_space: The half-space.
        terms: What else adds to the compliance.
    """

    def __init__(self, half_space: HalfSpaceGrid, terms: Sequence[GridTerm] = ()) -> None:
        self._half_space, self._terms = half_space, tuple(terms)
        self.products = 0

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures on all cells, shape (nx, ny) [mm]."""
        self.products += 1
        found = self._half_space.compliance(pressure.copy())
        for term in self._terms:
            found += term.displacement(pressure)
        return found

    def apply_compliance(self, cells: Cells, pressure: Array) -> Array:
        """Return roughly the displacements of some cells by pressures on them, shape (n,) [mm]."""
        self.products += 1
        found = _among(cells, pressure, self._half_space.rough_compliance)
        for term in self._terms:
            found += term.of_cells(cells, pressure)
        return found

    def apply_inverse(self, cells: Cells, displacement: Array) -> Array:
        """Return very roughly the pressures on some cells that displace them so, shape (n,)."""
        return _among(cells, displacement, self._half_space.stiffness)


class _SideTerm:
    """What free sides add on a grid, and on those of its cells that were last asked for."""

    def __init__(self, sides: SideCells, box: Box) -> None:
        self._sides = sides
        self._rows, self._columns = (np.arange(part.start, part.stop) for part in box)
        self._all = sides.among(self._rows, self._columns)
        self._last: tuple[Cells, SomeCells, Indices, tuple[int, int]] | None = None

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures on all cells, shape (nx, ny) [mm]."""
        return self._all.displacement(pressure)

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


class BodyOnCells(Protocol):
    """What the rest of a finite body adds on some cells."""

    def displacement(self, pressure: Array, /) -> Array:
        """Return the displacements by pressures on all cells, shape (nx, ny), [MPa] to [mm]."""
        ...

    def among(self, rows: Indices, columns: Indices, /) -> Self:
        """Return the cells where some rows and columns cross."""
        ...


class BodyTerm(Protocol):
    """What a finite body adds to the half-space: a smooth field, linear in the pressures."""

    def on(self, borders_x: Array, borders_y: Array, /) -> BodyOnCells:
        """Return it on cells between borders, shapes (nx + 1,), (ny + 1,) [mm]."""
        ...


class SurfaceTerm(Protocol):
    """A small part of the compliance that is evaluated on the whole surface."""

    def displacement(self, pressure: Array, /) -> Array:
        """Return the displacements by pressures on all cells, shape (nx, ny), [MPa] to [mm]."""
        ...


class _BodyOnGrid:
    """The rest of a body on a grid, for E* = 1, and on the rows that were last asked for."""

    def __init__(self, body: BodyOnCells, modulus: float) -> None:
        self._body, self._modulus = body, modulus
        self._last: tuple[Cells, BodyOnCells] | None = None

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures on all cells, shape (nx, ny) [mm]."""
        return self._modulus * self._body.displacement(pressure)

    def of_cells(self, cells: Cells, pressure: Array) -> Array:
        """Return the displacements of some cells by pressures on them, shape (n,) [mm]."""
        if self._last is None or self._last[0] is not cells:
            self._last = cells, self._body.among(cells.rows, np.arange(cells.columns))
        field = np.zeros((len(cells.rows), cells.columns))
        field.ravel()[cells.place] = pressure
        found = self._last[1].displacement(field)
        return np.asarray(self._modulus * found.ravel()[cells.place])


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
    """The grids of one model, whose half-spaces are kept with their kernels and work arrays.

    Args:
        periodic: Whether pressures continue periodically.
        modulus: Contact modulus E* of the model [MPa].
        sides: Free sides, if there are any.
        body: What the rest of a finite body adds, if there is one.
        slopes: What finite slopes add, if they are to be seen; it is for whoever solves on the
            grids to take it into account.
    """

    def __init__(
        self,
        *,
        periodic: bool,
        modulus: float = 1.0,
        sides: FreeSides | None = None,
        body: BodyTerm | None = None,
        slopes: SurfaceTerm | None = None,
    ) -> None:
        self.periodic, self.modulus = periodic, modulus
        self.sides, self.body, self.slopes = sides, body, slopes
        self._known: dict[tuple[object, ...], HalfSpaceGrid] = {}
        self._last: tuple[Array, Array] | None = None

    def at(
        self, grid: tuple[int, ...], spacing: tuple[float, float], box: Box | None = None
    ) -> ElasticGrid:
        """Return the finest grid of some cells.

        Args:
            grid: Numbers of cells (nx, ny).
            spacing: Sides of a cell [mm].
            box: Their place; None where the cells are not those of the surface.
        """
        terms: list[GridTerm] = []
        if box is not None:
            if self.sides is not None:
                terms.append(_SideTerm(side_cells(self.sides, spacing), box))
            origin = box.rows.start * spacing[0], box.columns.start * spacing[1]
            terms += self._of_body(grid, spacing, origin)
        return ElasticGrid(self._half_space(grid, spacing), terms)

    def coarse(
        self, grid: tuple[int, ...], spacing: tuple[float, float], origin: tuple[float, float]
    ) -> ElasticGrid:
        """Return a coarse grid, on which neither sides nor slopes are seen.

        Args:
            grid: Numbers of cells (nx, ny).
            spacing: Sides of a cell [mm].
            origin: Corner of the first cell [mm].
        """
        return ElasticGrid(self._half_space(grid, spacing), self._of_body(grid, spacing, origin))

    def by_slopes(self, pressure: Array) -> Array:
        """Return what finite slopes add to the displacements of all cells, shape (nx, ny) [mm].

        The last ones are kept: a load step begins where the one before it ended.

        Args:
            pressure: Pressures / E* of all cells of the surface, shape (nx, ny).

        Raises:
            ValueError: When no finite slopes are to be seen.
        """
        if self.slopes is None:
            raise ValueError("these grids see no finite slopes")
        if self._last is None or not np.array_equal(self._last[0], pressure):
            self._last = pressure, self.slopes.displacement(pressure * self.modulus)
        return self._last[1]

    def risen(self, pressure: Array, spacing: tuple[float, float]) -> Array:
        """Return what the body alone adds to the displacements of all cells, shape (nx, ny) [mm].

        Args:
            pressure: Pressures / E* of all cells of the surface, shape (nx, ny).
            spacing: Sides of a cell [mm].
        """
        found = np.zeros(pressure.shape)
        for term in self._of_body(pressure.shape, spacing, (0.0, 0.0)):
            found += term.displacement(pressure)
        return found

    def _of_body(
        self, grid: tuple[int, ...], spacing: tuple[float, float], origin: tuple[float, float]
    ) -> list[GridTerm]:
        if self.body is None:
            return []
        x, y = (
            start + step * np.arange(n + 1)
            for start, step, n in zip(origin, spacing, grid, strict=True)
        )
        return [_BodyOnGrid(self.body.on(x, y), self.modulus)]

    def _half_space(self, grid: tuple[int, ...], spacing: tuple[float, float]) -> HalfSpaceGrid:
        nx, ny = grid
        key = (nx, ny, *spacing)
        known = self._known.pop(key, None)
        if known is None:
            known = HalfSpaceGrid((nx, ny), spacing, periodic=self.periodic)
            if len(self._known) >= _MOST_GRIDS:
                del self._known[next(iter(self._known))]
        self._known[key] = known  # the last one is the one used last
        return known

    def __reduce__(self) -> tuple[object, ...]:
        """Travel without the work arrays."""
        return _empty_grids, (
            self.periodic,
            self.modulus,
            self.sides,
            self.body,
            self.slopes,
        )


def _empty_grids(
    periodic: bool,
    modulus: float,
    sides: FreeSides | None,
    body: BodyTerm | None,
    slopes: SurfaceTerm | None,
) -> ElasticGrids:
    return ElasticGrids(periodic=periodic, modulus=modulus, sides=sides, body=body, slopes=slopes)
