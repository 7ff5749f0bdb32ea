"""What a finite body adds to the half-space: smooth displacements and stresses, in modes.

Pressures p have the moments b_n = ∫ p φ_n dA with the modes φ_n. They displace by Σ φ_m D_mn b_n,
and add the stresses Σ φ_m S_mn b_n in the surface. Modes are products of Legendre modes along x and
y (`geometry.legendre_modes`), so that all evaluations are thin products along the axes.

Theory: docs/theory.md, section 6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from geometry import PatchGrid
from geometry.legendre_modes import mode_means, mode_values
from micro.boundary_elements.face_modes import FaceModes
from micro.boundary_elements.grid_compliance import CellGrid
from support.arrays import Array, Indices
from support.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class BodyModes(FaceModes):
    """Compliance D of the top of a body under pressures, in its Legendre modes; see `FaceModes`."""

    lifts: ClassVar[bool] = True

    def on(
        self, borders_x: ArrayLike, borders_y: ArrayLike, *, modulus: float = 1.0
    ) -> ModesOnCells:
        """Return the compliance of cells of pressure, by means over the cells.

        Args:
            borders_x: Borders of the cells along x, ascending within the top, (nx + 1,) [mm].
            borders_y: Borders along y, shape (ny + 1,) [mm].
            modulus: Unit of the pressures [MPa].
        """
        x, y = self.placed(borders_x, borders_y)
        return ModesOnCells(self.matrix, *self.means(x, y), modulus * np.diff(x), np.diff(y))

    def on_cells(self, cells: CellGrid, modulus: float) -> ModesOnCells:
        """Return the compliance of equal cells of pressure, see `on`."""
        return self.on(*cells.borders, modulus=modulus)

    def patch_compliance(self, patches: PatchGrid) -> Array:
        """Return the mean over patch i by unit pressure on patch j, shape (N, N) [mm/MPa].

        Args:
            patches: N patches within the face.
        """
        cells = self.on(patches.borders_x, patches.borders_y)
        modes = np.kron(cells.means_x, cells.means_y)
        return np.asarray(modes.T @ self.matrix @ modes * patches.areas)

    def coarser(self) -> BodyModes | None:
        """Return the compliance from a coarser discretisation; None where there is none."""
        return None if self.rough is None else BodyModes(self.lengths, self.rough, self.origin)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyPoints:
    """Compliance of a body between n points of its contact face.

    Args:
        body: The compliance in modes.
        values: Modes at the points, shape (K², n).
    """

    body: BodyModes
    values: Array

    @classmethod
    def at(cls, body: BodyModes, x: Array, y: Array) -> Self:
        """Evaluate the modes at points.

        Args:
            body: The compliance in modes.
            x: Abscissae, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
        """
        along_x, along_y = (
            mode_values(place - corner, length, body.count)
            for place, corner, length in zip((x, y), body.origin, body.lengths, strict=True)
        )
        return cls(body=body, values=(along_x[:, None] * along_y).reshape(len(body.matrix), -1))

    def among(self, index: Indices) -> Self:
        """Return the compliance between some of the points."""
        return replace(self, values=self.values[:, index])

    def displacement(self, force: Array) -> Array:
        """Return the displacements of the points by forces on them, shape (n,) [mm].

        Args:
            force: Forces, shape (n,) [N].
        """
        return np.asarray(self.values.T @ (self.body.matrix @ (self.values @ force)))

    def by(self, loaded: BodyPoints) -> Array:
        """Return the displacements of the points by unit forces on m others, (n, m) [mm/N].

        Args:
            loaded: The points that the forces act on, on the same body.
        """
        return np.asarray(self.values.T @ (self.body.matrix @ loaded.values))

    def patch_means(self, patches: PatchGrid, force: Array) -> Array:
        """Return the mean displacements of patches, shape (N,) [mm].

        Args:
            patches: N patches within the face.
            force: Forces on the points, shape (n,) [N].
        """
        cells = self.body.on(patches.borders_x, patches.borders_y)
        amplitudes = (self.body.matrix @ (self.values @ force)).reshape(self.body.count, -1)
        return np.asarray((cells.means_x.T @ amplitudes @ cells.means_y).ravel())


@dataclass(frozen=True, slots=True, eq=False)
class ModesOnCells:
    """A compliance in modes, or stresses in modes, on the cells of a grid.

    Pressures are uniform on cells. Displacements are means over the cells, which makes the
    compliance symmetric for equal cells.

    Args:
        matrix: D, shape (K², K²) [mm/N]; or several such matrices, shape (n, K², K²).
        means_x: Means of the modes along x over the cells, shape (K, nx).
        means_y: Means along y, shape (K, ny).
        widths_x: Widths of the cells along x, times the unit of the pressures, shape (nx,) [N/mm].
        widths_y: Widths along y, shape (ny,) [mm].
    """

    matrix: Array
    means_x: Array
    means_y: Array
    widths_x: Array
    widths_y: Array

    def displacement(self, pressure: Array) -> Array:
        """Return the displacements of all cells by pressures on them.

        Args:
            pressure: In the unit chosen, shape (nx, ny).

        Returns:
            Shape (nx, ny) [mm]; one after the other for several matrices.
        """
        moments = (self.means_x * self.widths_x) @ pressure @ (self.means_y * self.widths_y).T
        amplitudes = self.matrix @ moments.ravel()
        amplitudes = amplitudes.reshape(*self.matrix.shape[:-2], *moments.shape)
        return np.asarray(self.means_x.T @ amplitudes @ self.means_y)

    def between(self, row: Indices, column: Indices) -> Array:
        """Return the displacements of n cells by unit pressures on them, shape (n, n) [mm].

        Args:
            row: Their rows.
            column: Their columns.
        """
        modes = self.means_x[:, None, row] * self.means_y[:, column]
        modes = modes.reshape(len(self.matrix), -1)
        loads = modes * (self.widths_x[row] * self.widths_y[column])
        return np.asarray(modes.T @ (self.matrix @ loads))

    def among(self, rows: Indices, columns: Indices) -> ModesOnCells:
        """Return the cells where some rows and columns of the grid cross.

        Args:
            rows: Indices of the rows, shape (r,).
            columns: Indices of the columns, shape (c,).
        """
        x, y = self.means_x[:, rows], self.means_y[:, columns]
        return ModesOnCells(self.matrix, x, y, self.widths_x[rows], self.widths_y[columns])

    @property
    def single(self) -> ModesOnCells:
        """Itself: a few modes take no time, in whichever precision the pressures are."""
        return self


class BodyStresses:
    """Stresses in its top that a finite body adds to those of the half-space, as means over cells.

    Args:
        lengths: Sides (Lx, Ly) of the top [mm].
        grid: Cells (nx, ny), which fill the top but a margin all around.
        matrix: S of σ_xx, σ_yy and σ_xy; mode k K + l varies as mode k along x and l along y, shape
            (3, K², K²) [1/mm²].
        margin: Width of the margin [mm].

    Raises:
        InputError: When the matrix is not one of K² modes, or not finite.
    """

    def __init__(
        self,
        lengths: tuple[float, float],
        grid: tuple[int, int],
        matrix: Array,
        margin: float = 0.0,
    ) -> None:
        count = round(matrix.shape[-1] ** 0.5)
        if not count or matrix.shape != (3, count**2, count**2) or not np.isfinite(matrix).all():
            problem = "the stresses are not those of K × K modes"
            raise InputError(problem, value=matrix.shape, allowed="finite, (3, K², K²), K ≥ 1")
        x, y = (
            np.linspace(margin, length - margin, cells + 1)
            for length, cells in zip(lengths, grid, strict=True)
        )
        means = mode_means(x, lengths[0], count), mode_means(y, lengths[1], count)
        self._on_cells = ModesOnCells(matrix, *means, np.diff(x), np.diff(y))

    def stresses(self, pressure: Array) -> Array:
        """Return σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny) [MPa].

        Args:
            pressure: On all cells, shape (nx, ny) [MPa].
        """
        return self._on_cells.displacement(pressure)

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`.

        Args:
            fields: Weights of σ_xx, σ_yy and σ_xy on the cells, in b ways, (b, 3, nx, ny).

        Returns:
            Weights of the pressures, shape (b, nx, ny).
        """
        on = self._on_cells
        amplitudes = on.means_x @ fields @ on.means_y.T
        moments = np.tensordot(amplitudes.reshape(len(fields), 3, -1), on.matrix, axes=2)
        loads_x, loads_y = on.means_x * on.widths_x, on.means_y * on.widths_y
        return np.asarray(loads_x.T @ moments.reshape(-1, *amplitudes.shape[2:]) @ loads_y)
