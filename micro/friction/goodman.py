"""What Goodman's assumption neglects: displacements of pressures along, of tractions across.

Unlike bodies, and a rigid plane on an elastic one, differ in how far pressures pull their surfaces
sideways. With Dundurs' β the difference is

    u = −(β/(π E*)) ∫ p d/ρ² dA,    u_z = (β/(π E*)) ∫ q·d/ρ² dA,

d from the load to the point. Neglecting both separates the normal contact from shear (Goodman
1962). Each is evaluated once, at a solution without them, to know their size.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import fft

from geometry.materials import MaterialPair
from geometry.shear_state import ShearState
from support.arrays import Array
from support.cores import cores


class NeglectedCoupling(NamedTuple):
    """Sizes of the displacements that Goodman's assumption leaves out.

    Attributes:
        beta: Dundurs' β.
        sideways: Largest difference of displacements along the surface by the pressures, from their
            mean over the contact [mm].
        across: Largest difference of displacements across the surface by the tractions, from their
            mean over the contact [mm].
    """

    beta: float
    sideways: float
    across: float


def neglected_coupling(
    state: ShearState,
    coefficient: float,
    materials: MaterialPair,
    spacing: tuple[float, float],
    *,
    periodic: bool,
) -> NeglectedCoupling:
    """Evaluate the displacements that Goodman's assumption leaves out.

    Args:
        state: The shear of a contact.
        coefficient: Coefficient of friction.
        materials: The two bodies.
        spacing: Sides of a cell [mm].
        periodic: Whether loads continue periodically.
    """
    beta, closed = materials.dundurs_beta, state.closed
    if beta == 0.0 or not closed.any():
        return NeglectedCoupling(beta, 0.0, 0.0)
    waves = _waves if periodic else _padded_waves
    kernels = waves(closed.shape, spacing) * beta / materials.contact_modulus  # type: ignore[arg-type]
    shape = closed.shape if periodic else tuple(2 * count for count in closed.shape)

    def convolved(kernel: Array, field: Array) -> Array:
        loaded = fft.rfft2(field, s=shape, workers=cores())
        whole = fft.irfft2(kernel * loaded, s=shape, workers=cores())
        return np.asarray(whole[: closed.shape[0], : closed.shape[1]])

    pressure = state.bound / coefficient
    along = [_variation(convolved(-one, pressure)[closed]) for one in kernels]
    lifted = sum(convolved(one, q) for one, q in zip(kernels, state.traction, strict=True))
    return NeglectedCoupling(
        beta, float(np.hypot(*along).max()), float(_variation(lifted[closed]).max())
    )


def _variation(values: Array) -> Array:
    return np.abs(values - values.mean())


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
