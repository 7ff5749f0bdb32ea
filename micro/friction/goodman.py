"""What Goodman's assumption neglects: displacements of pressures along, of tractions across.

Unlike bodies, and a rigid plane on an elastic one, differ in how far pressures pull their surfaces
sideways. With Dundurs' β the difference is

    u = −(β/(π E*)) ∫ p d/ρ² dA,    u_z = (β/(π E*)) ∫ q·d/ρ² dA,

d from the load to the point. Neglecting both separates the normal contact from shear (Goodman
1962). Otherwise both problems are solved in turn until they agree (`micro.friction.coupled`). A
finite body adds a term to both.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from geometry.materials import MaterialPair
from micro.boundary_elements.traction_modes import TractionsOnCells
from support.arrays import Array
from support.cores import cores


class CrossCompliance:
    """Displacements along the surface by pressures and across it by tractions, on all cells.

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides of a cell [mm].
        materials: The two bodies.
        periodic: Whether loads continue periodically.
        body: What a finite body adds, on these cells, for loads over E*; none when not given.
    """

    def __init__(
        self,
        grid: tuple[int, int],
        spacing: tuple[float, float],
        materials: MaterialPair,
        *,
        periodic: bool,
        body: TractionsOnCells | None = None,
    ) -> None:
        self._body, self._modulus = body, materials.contact_modulus
        self._shown = tuple(slice(count) for count in grid)
        self._shape = grid if periodic else tuple(2 * count for count in grid)
        waves = _waves if periodic else _padded_waves
        self._waves = waves(grid, spacing) * (materials.dundurs_beta / materials.contact_modulus)

    def sideways(self, pressure: Array) -> Array:
        """Return the displacements along the surface by pressures [MPa], shape (2, nx, ny) [mm]."""
        moved = np.stack([self._convolved(-one, pressure) for one in self._waves])
        if self._body is not None:
            moved += self._body.sideways(pressure / self._modulus)
        return moved

    def across(self, tractions: Array) -> Array:
        """Return the displacements into the body by tractions, shape (nx, ny) [mm].

        Args:
            tractions: The tractions, shape (2, nx, ny) [MPa].
        """
        moved = sum(map(self._convolved, self._waves, tractions))
        if self._body is not None:
            moved = moved + self._body.across(tractions / self._modulus)
        return np.asarray(moved)

    def _convolved(self, kernel: Array, field: Array) -> Array:
        loaded = fft.rfft2(field, s=self._shape, workers=cores())
        return np.asarray(fft.irfft2(kernel * loaded, s=self._shape, workers=cores())[self._shown])


def _waves(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the transforms −2 i k/|k|² of d/(π ρ²) on a period, shape (2, nx, ny // 2 + 1)."""
    kx = 2.0 * np.pi * fft.fftfreq(grid[0], spacing[0])[:, None]
    ky = 2.0 * np.pi * fft.rfftfreq(grid[1], spacing[1])
    square = kx * kx + ky * ky
    square[0, 0] = np.inf
    k = np.stack(np.broadcast_arrays(kx, ky))
    return np.asarray(-2.0j * k / square)


def _padded_waves(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the transforms of d/(π ρ²), integrated over cells, on a grid twice as long and wide.

    Its antiderivative is y ln ρ + x atan(y/x) along x.
    """
    u, v = (np.arange(-n, n + 1) * step - 0.5 * step for n, step in zip(grid, spacing, strict=True))
    x, y = u[:, None], v[None, :]
    log = np.log(np.hypot(x, y))
    parts = np.stack([y * log + x * np.arctan(y / x), x * log + y * np.arctan(x / y)])
    kernels = np.diff(np.diff(parts, axis=1), axis=2) / np.pi
    around = fft.ifftshift(kernels, axes=(1, 2))
    return np.asarray(fft.rfft2(around, workers=cores()))
