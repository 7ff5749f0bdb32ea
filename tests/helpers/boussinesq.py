"""The half-space in depth: displacements and stresses by uniform pressures on rectangles.

With V the integral of p/r and χ that of p ln(r + z) over the loaded area, z the depth,

    u_x = −[(1 − 2ν) ∂χ/∂x + z ∂V/∂x] / 4πG,      u_z = [2 (1 − ν) V − z ∂V/∂z] / 4πG,

and the stresses follow from second derivatives of both (Love 1929). For rectangles every term is
a second difference over the four corners of a function in closed form. Loads that form a grid
share their corners: each is evaluated once for all loads around it.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from patchlaw.geometry import Material, PatchGrid
from patchlaw.micro.closed_forms import corner_integral
from patchlaw.support import InputError

Array = NDArray[np.float64]

_TINY = 1e-290


def love_integral(x: ArrayLike, y: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Return L(a, b, x, y), the integral of 1/distance from (x, y) over the rectangle [mm].

    Finite everywhere, borders and corners included. The four corner terms cancel far away: the
    relative error is about 1e-16 (r/a)², so 1e-10 at a thousand half-sides.

    Args:
        x: Distance of the point from the centre along x [mm]; all arguments broadcast.
        y: Distance along y [mm].
        a: Half-side along x [mm].
        b: Half-side along y [mm].

    Source:
        Waddad et al. 2016, eq. 30, doi 10.1016/j.triboint.2015.12.023 (Love 1929).
    """
    x, y, a, b = (np.asarray(part, float) for part in (x, y, a, b))
    total = np.zeros(np.broadcast_shapes(x.shape, y.shape, a.shape, b.shape))
    for i, j in product((1, -1), repeat=2):
        total += i * j * corner_integral(x + i * a, y + j * b)
    return total


def displacements(
    material: Material, x: ArrayLike, y: ArrayLike, depth: ArrayLike, loads: PatchGrid
) -> Array:
    """Return displacements of a half-space by unit pressure on each rectangle alone.

    Args:
        material: Elastic constants.
        x: Abscissae of n points, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        depth: Depths z ≥ 0 below the loaded plane, shape (n,) [mm].
        loads: M rectangles.

    Returns:
        Displacements along x, y and into the depth, shape (3, n, M) [mm/MPa].

    Raises:
        InputError: When a point lies above the plane.

    Source:
        Love 1929, doi 10.1098/rsta.1929.0009.
    """
    dx, dy, z, r = _corners(x, y, depth, loads)
    nu, side = material.poisson_ratio, 1.0 - 2.0 * material.poisson_ratio
    v_x, v_y, v_z = _gradient(dx, dy, z, r)
    log = np.log(np.maximum(r + z, _TINY))
    chi_x = dy * log + z * v_x + dx * _angle(dx, dy, z, r)
    chi_y = dx * log + z * v_y + dy * _angle(dy, dx, z, r)
    v = dx * v_x + dy * v_y + z * v_z
    parts = -side * chi_x - z * v_x, -side * chi_y - z * v_y, 2.0 * (1.0 - nu) * v - z * v_z
    return _differences(parts, loads, 4.0 * np.pi * material.shear_modulus)


def stresses(
    material: Material, x: ArrayLike, y: ArrayLike, depth: ArrayLike, loads: PatchGrid
) -> Array:
    """Return stresses in a half-space by unit pressure on each rectangle alone, tension positive.

    Args:
        material: Elastic constants.
        x: Abscissae of n points, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        depth: Depths z ≥ 0 below the loaded plane, shape (n,) [mm].
        loads: M rectangles.

    Returns:
        σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy with z into the depth, shape (6, n, M) [-].

    Raises:
        InputError: When a point lies above the plane.

    Source:
        Love 1929, doi 10.1098/rsta.1929.0009.
    """
    dx, dy, z, r = _corners(x, y, depth, loads)
    nu, side = material.poisson_ratio, 1.0 - 2.0 * material.poisson_ratio
    _, _, v_z = _gradient(dx, dy, z, r)
    x_part = _over(r - dy, r * (dx**2 + z**2))
    y_part = _over(r - dx, r * (dy**2 + z**2))
    v_xx, v_yy, v_xy = dx * x_part, dy * y_part, _over(1.0, r)
    chi_xy = np.log(np.maximum(r + z, _TINY))
    parts = (
        2.0 * nu * v_z - side * _angle(dx, dy, z, r) - z * v_xx,
        2.0 * nu * v_z - side * _angle(dy, dx, z, r) - z * v_yy,
        v_z + z * (v_xx + v_yy),  # V is harmonic
        -z * z * y_part,
        -z * z * x_part,
        -side * chi_xy - z * v_xy,
    )
    return _differences(parts, loads, 2.0 * np.pi)


def _corners(
    x: ArrayLike, y: ArrayLike, depth: ArrayLike, loads: PatchGrid
) -> tuple[Array, Array, Array, Array]:
    """Measure from the crossings of the loads' borders to points.

    Terms of V and χ that do not depend on dx or not on dy may be left out at the corners: they
    cancel from the second difference.

    Returns:
        Distances dx and dy along x and y, depths z, shape (n, 1, 1), and distances r, all others of
        shape (n, Nx + 1, Ny + 1) [mm].
    """
    z = np.asarray(depth, float)[:, None, None]
    if np.any(z < 0.0):
        raise InputError("depths are not negative", value=float(z.min()), allowed="≥ 0 mm")
    dx, dy = np.broadcast_arrays(
        np.asarray(x, float)[:, None, None] - loads.borders_x[:, None],
        np.asarray(y, float)[:, None, None] - loads.borders_y,
    )
    return dx, dy, z, np.sqrt(dx * dx + dy * dy + z * z)


def _gradient(dx: Array, dy: Array, z: Array, r: Array) -> tuple[Array, Array, Array]:
    """Return ∂V/∂x, ∂V/∂y and ∂V/∂z at the corners."""
    return (
        np.arcsinh(dy / np.maximum(np.hypot(dx, z), _TINY)),
        np.arcsinh(dx / np.maximum(np.hypot(dy, z), _TINY)),
        -np.arctan2(dx * dy, z * r),
    )


def _angle(along: Array, across: Array, z: Array, r: Array) -> Array:
    """Return the second derivative of χ in one direction at the corners."""
    both = along * across * (r - z)
    return np.asarray(np.arctan2(both, along * along * r + across * across * z))


def _differences(parts: tuple[Array, ...], loads: PatchGrid, divisor: float) -> Array:
    """Difference corner terms to rectangles and divide them, shape (parts, n, M).

    Distances to the lower border are the longer ones: it counts positive.
    """
    corners = np.stack(np.broadcast_arrays(*parts))
    rectangles: Array = np.diff(np.diff(corners, axis=2), axis=3)
    rectangles /= divisor
    return rectangles.reshape(*corners.shape[:2], loads.count)


def _over(numerator: ArrayLike, denominator: Array) -> Array:
    """Divide; 0 at a corner on the surface, where the term is singular or multiplied by 0."""
    return np.divide(
        numerator, denominator, out=np.zeros_like(denominator), where=denominator > _TINY
    )
