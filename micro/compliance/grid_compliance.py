"""The compliance of an elastic body as a sum of terms, on grids of cells; pressures are over E*.

    half-space  +  free sides  +  finite body  (+ finite slopes, which act on the whole surface).

`Compliance` holds the terms of one body and makes them for any grid. `GridCompliance` is their sum
on one grid. A new term needs the two methods of `ComplianceTerm` and a line in `Compliance`.

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from micro.compliance.body_modes import BodyModes
from micro.compliance.cells import Box, Cells
from micro.compliance.free_sides import FreeSides
from micro.compliance.half_space_grid import HalfSpaceGrid
from micro.compliance.side_cells import side_cells

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_GRIDS = 24
"""Half-spaces that are cached, those used last: three sizes of box with their coarse grids."""


class ComplianceTerm(Protocol):
    """A symmetric part of the compliance of the cells where rows and columns of a grid cross."""

    def displacement(self, pressure: Array, /) -> Array:
        """Return the displacements by pressures / E* on all these cells, shape (r, c) [mm]."""
        ...

    def among(self, rows: Indices, columns: Indices, /) -> Self:
        """Return the same for some of these rows and columns, by ascending indices."""
        ...


class SlopeTerm(Protocol):
    """What finite slopes add: a small part of the compliance, on the whole surface."""

    def displacement(self, pressure: Array, /) -> Array:
        """Return the displacements by pressures on all cells, shape (nx, ny), [MPa] to [mm]."""
        ...


class GridCompliance:
    """Compliance of nx × ny cells under pressures that are uniform on each.

    Displacements are evaluated in double precision. Corrections only have to reduce an error that
    is then evaluated anew, and use the half-space's products in single precision.

    Args:
        half_space: The half-space.
        terms: What else adds to the compliance.

    Attributes:
        products: Products with pressures so far.
    """

    def __init__(self, half_space: HalfSpaceGrid, terms: Sequence[ComplianceTerm] = ()) -> None:
        self._half_space, self._terms = half_space, tuple(terms)
        self._last: tuple[Cells, list[ComplianceTerm], Indices, tuple[int, int]] | None = None
        self.products = 0

    def displacement(self, pressure: Array) -> Array:
        """Return the displacement by pressures / E* on all cells, shape (nx, ny) [mm]."""
        self.products += 1
        found = self._half_space.compliance(pressure.copy())
        for term in self._terms:
            found += term.displacement(pressure)
        return found

    def apply_compliance(self, cells: Cells, pressure: Array) -> Array:
        """Return roughly the displacements of some cells by pressures on them, shape (n,) [mm]."""
        self.products += 1
        found = self._half_space.rough_compliance.on_cells(cells, pressure)
        if self._terms:
            terms, place, shape = self._among(cells)
            some = np.zeros(shape)
            some.ravel()[place] = pressure
            for term in terms:
                found += term.displacement(some).ravel()[place]
        return found

    def apply_inverse(self, cells: Cells, displacement: Array) -> Array:
        """Return very roughly the pressures on some cells that displace them so, shape (n,)."""
        return self._half_space.inverse.on_cells(cells, displacement)

    def _among(self, cells: Cells) -> tuple[list[ComplianceTerm], Indices, tuple[int, int]]:
        """Return the terms on the rows and columns of some cells, and where these cells are."""
        if self._last is None or self._last[0] is not cells:
            row, column = np.divmod(cells.place, cells.columns)
            columns, column = np.unique(column, return_inverse=True)
            terms = [term.among(cells.rows, columns) for term in self._terms]
            place = row * len(columns) + column.ravel()
            self._last = cells, terms, place, (len(cells.rows), len(columns))
        return self._last[1:]


@dataclass(kw_only=True, eq=False)
class Compliance:
    """The elastic body of one contact model: its terms, on any grid.

    Half-spaces are cached with their kernels and work arrays.

    Args:
        periodic: Whether pressures continue periodically.
        modulus: Contact modulus E* of the model [MPa].
        sides: Free sides, if there are any.
        body: What a finite body adds to the half-space and its sides, if it is finite.
        slopes: What finite slopes add, if they count. Whoever solves on the grids has to take them
            into account (`micro.contact.slope_iteration`).
    """

    periodic: bool
    modulus: float = 1.0
    sides: FreeSides | None = None
    body: BodyModes | None = None
    slopes: SlopeTerm | None = None
    _half_spaces: dict[tuple[object, ...], HalfSpaceGrid] = field(default_factory=dict, init=False)
    _last: tuple[Array, Array] | None = field(default=None, init=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the caches behind when sent to another process."""
        return vars(self) | {"_half_spaces": {}, "_last": None}

    def on_grid(
        self, grid: tuple[int, ...], spacing: tuple[float, float], box: Box | None = None
    ) -> GridCompliance:
        """Return the compliance of cells of the surface.

        Args:
            grid: Numbers of cells (nx, ny).
            spacing: Sides of a cell [mm].
            box: Their place on the surface; the half-space alone when not given.
        """
        terms: list[ComplianceTerm] = []
        if box is not None:
            if self.sides is not None:
                rows, columns = (np.arange(part.start, part.stop) for part in box)
                terms.append(side_cells(self.sides, spacing).among(rows, columns))
            terms += self._of_body(grid, spacing, box.corner(spacing))
        return GridCompliance(self.half_space(grid, spacing), terms)

    def on_coarse(
        self, grid: tuple[int, ...], spacing: tuple[float, float], corner: tuple[float, float]
    ) -> GridCompliance:
        """Return the compliance of coarse cells, without free sides and slopes.

        Args:
            grid: Numbers of cells (nx, ny).
            spacing: Sides of a cell [mm].
            corner: Corner of the first cell on the surface [mm].
        """
        return GridCompliance(self.half_space(grid, spacing), self._of_body(grid, spacing, corner))

    def half_space(self, grid: tuple[int, ...], spacing: tuple[float, float]) -> HalfSpaceGrid:
        """Return the half-space on a grid of cells of given sides, from the cache if it is there.

        Of more than `_MOST_GRIDS` sizes, the one that was not used for longest is given up.
        """
        key = (*grid, *spacing)
        found = self._half_spaces.pop(key, None)
        if found is None:
            found = HalfSpaceGrid((grid[0], grid[1]), spacing, periodic=self.periodic)
            if len(self._half_spaces) >= _MOST_GRIDS:
                del self._half_spaces[next(iter(self._half_spaces))]
        self._half_spaces[key] = found  # the last one is the one used last
        return found

    def slope_displacement(self, pressure: Array) -> Array:
        """Return what finite slopes add to the displacements of all cells, shape (nx, ny) [mm].

        The last one is cached: a load step begins where the one before it ended.

        Args:
            pressure: Pressures / E* of all cells of the surface, shape (nx, ny).
        """
        assert self.slopes is not None
        if self._last is None or not np.array_equal(self._last[0], pressure):
            self._last = pressure, self.slopes.displacement(pressure * self.modulus)
        return self._last[1]

    def body_displacement(self, pressure: Array, spacing: tuple[float, float]) -> Array:
        """Return what the body alone adds to the displacements of all cells, (nx, ny) [mm].

        Args:
            pressure: Pressures / E* of all cells of the surface, shape (nx, ny).
            spacing: Sides of a cell [mm].
        """
        found = np.zeros(pressure.shape)
        for term in self._of_body(pressure.shape, spacing, (0.0, 0.0)):
            found += term.displacement(pressure)
        return found

    def _of_body(
        self, grid: tuple[int, ...], spacing: tuple[float, float], corner: tuple[float, float]
    ) -> list[ComplianceTerm]:
        if self.body is None:
            return []
        x, y = (
            start + step * np.arange(n + 1)
            for start, step, n in zip(corner, spacing, grid, strict=True)
        )
        return [self.body.on(x, y, modulus=self.modulus)]
