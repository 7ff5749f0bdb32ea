"""Displacement of the half-space's surface by unit pressure on one cell of a grid.

Kernels are for E* = 1: displacement [mm] = kernel [mm] convolved with pressure / E* per cell.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from micro.closed_forms.love import corner_integral

Array = NDArray[np.float64]


def love_kernel(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the displacement at cell (i, j) by uniform unit pressure on cell (0, 0).

    Love's rectangle at the cell centres, L((i dx, j dy))/π: differences of one corner integral on
    the lattice of cell corners. The relative error grows as 1e-16 (distance / cell)².

    Args:
        grid: Numbers of cells (nx, ny).
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        Shape (nx, ny) [mm]; even in both distances.

    Source:
        Love 1929; Johnson 1985, eq. 3.25.
    """
    corners = [(np.arange(n + 1) - 0.5) * step for n, step in zip(grid, spacing, strict=True)]
    terms = corner_integral(corners[0][:, None], corners[1])
    return np.diff(np.diff(terms, axis=0), axis=1) / np.pi


def padded_spectrum(padded: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the transform of Love's kernel on a padded grid, where convolution is not circular.

    The padding holds the kernel too, though no pressure reaches it: the spectrum of the kernel
    without steps is positive.

    Args:
        padded: Cells (mx, my) of the padded grid, at least twice the loaded ones less one.
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        Real half spectrum, shape (mx, my // 2 + 1) [mm].
    """
    nearest = [np.minimum(np.arange(m), m - np.arange(m)) for m in padded]
    kernel = love_kernel((padded[0] // 2 + 1, padded[1] // 2 + 1), spacing)
    return np.ascontiguousarray(fft.rfft2(kernel[nearest[0][:, None], nearest[1]]).real)


def periodic_spectrum(grid: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the periodic Green's function 2/|q| at the wave vectors q of a grid.

    The mean displacement of a periodic half-space is not determined; it is set to 0, so that
    displacements count from the mean of the displaced surface.

    Args:
        grid: Numbers of cells (nx, ny) of a period.
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        Real half spectrum, shape (nx, ny // 2 + 1) [mm].

    Source:
        Johnson 1985, eq. 13.7; Stanley & Kato 1997, doi 10.1115/1.2833523.
    """
    qx = 2.0 * np.pi * fft.fftfreq(grid[0], spacing[0])
    qy = 2.0 * np.pi * fft.rfftfreq(grid[1], spacing[1])
    q = np.hypot(qx[:, None], qy)
    spectrum = np.zeros_like(q)
    return np.divide(2.0, q, out=spectrum, where=q > 0.0)
