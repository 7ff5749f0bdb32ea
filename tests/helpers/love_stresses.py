"""Stresses in the surface of a half-space, cell by cell, by Love's rectangle."""

import numpy as np
from scipy.signal import fftconvolve

from helpers.boussinesq import stresses
from patchlaw.geometry import PatchGrid


def love_stresses(material, pressure, spacing):
    """Return σ_xx, σ_yy and σ_xy at the cells' centres, shape (3, nx, ny), by their pressures."""
    cell = PatchGrid(grid=(1, 1), lengths=spacing, origin=(-0.5 * spacing[0], -0.5 * spacing[1]))
    steps = zip(pressure.shape, spacing, strict=True)
    offsets = (np.arange(1 - count, count) * side for count, side in steps)
    x, y = np.meshgrid(*offsets, indexing="ij")
    found = stresses(material, x.ravel(), y.ravel(), np.zeros(x.size), cell)
    kernels = found[[0, 1, 5], :, 0].reshape(3, *x.shape)
    nx, ny = pressure.shape
    sums = [fftconvolve(kernel, pressure)[nx - 1 :, ny - 1 :] for kernel in kernels]
    return np.stack(sums)[:, :nx, :ny]
