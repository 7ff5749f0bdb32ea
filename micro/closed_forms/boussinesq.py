"""The half-space in depth: displacements and stresses by uniform pressures on rectangles.

With V the integral of p/r and χ that of p ln(r + z) over the loaded area, z the depth,

    u_x = −[(1 − 2ν) ∂χ/∂x + z ∂V/∂x] / 4πG,      u_z = [2 (1 − ν) V − z ∂V/∂z] / 4πG,

and the stresses follow from second derivatives of both (Love 1929). For rectangles every term is
a second difference over the four corners of a function in closed form. Loads that form a grid
share their corners: each is evaluated once for all loads around it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import Material, Partition
from geometry.errors import InputError

Array = NDArray[np.float64]

_TINY = 1e-290


class HalfSpace(Material):
    """An elastic half-space below the plane that carries the pressures.

    Source:
        Love 1929, doi 10.1098/rsta.1929.0009.
    """

    __slots__ = ()

    def displacements(
        self, x: ArrayLike, y: ArrayLike, depth: ArrayLike, loads: Partition
    ) -> Array:
        """Return displacements by unit pressure on each rectangle alone.

        Args:
            x: Abscissae of n points, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
            depth: Depths z ≥ 0 below the loaded plane, shape (n,) [mm].
            loads: M rectangles.

        Returns:
            Displacements along x, y and into the depth, shape (3, n, M) [mm/MPa].
        """
        corner = _Corners.of(x, y, depth, loads)
        nu, z = self.poisson_ratio, corner.z
        side = 1.0 - 2.0 * nu
        parts = (
            -side * corner.chi_x - z * corner.v_x,
            -side * corner.chi_y - z * corner.v_y,
            2.0 * (1.0 - nu) * corner.v - z * corner.v_z,
        )
        return _differences(parts, loads, 4.0 * np.pi * self.shear_modulus)

    def stresses(self, x: ArrayLike, y: ArrayLike, depth: ArrayLike, loads: Partition) -> Array:
        """Return stresses by unit pressure on each rectangle alone, positive in tension.

        Args:
            x: Abscissae of n points, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
            depth: Depths z ≥ 0 below the loaded plane, shape (n,) [mm].
            loads: M rectangles.

        Returns:
            σ_xx, σ_yy, σ_zz, σ_yz, σ_xz, σ_xy with z into the depth, shape (6, n, M) [-].
        """
        corner = _Corners.of(x, y, depth, loads)
        nu, z = self.poisson_ratio, corner.z
        side = 1.0 - 2.0 * nu
        v_z, v_xx, v_yy = corner.v_z, corner.v_xx, corner.v_yy
        parts = (
            2.0 * nu * v_z - side * corner.chi_xx - z * v_xx,
            2.0 * nu * v_z - side * corner.chi_yy - z * v_yy,
            v_z + z * (v_xx + v_yy),  # V is harmonic
            -z * corner.v_yz,
            -z * corner.v_xz,
            -side * corner.chi_xy - z * corner.v_xy,
        )
        return _differences(parts, loads, 2.0 * np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class _Corners:
    """Corner terms of V and χ and of their derivatives for every point and corner.

    What does not depend on dx or not on dy is left out: it cancels from the second difference.

    Args:
        dx: Distances along x from the corners to the points, shape (n, Nx + 1, Ny + 1) [mm].
        dy: Distances along y, of the same shape [mm].
        z: Depths, shape (n, 1, 1) [mm].
        r: Distances, shape (n, Nx + 1, Ny + 1) [mm].
    """

    dx: Array
    dy: Array
    z: Array
    r: Array

    @classmethod
    def of(cls, x: ArrayLike, y: ArrayLike, depth: ArrayLike, loads: Partition) -> _Corners:
        """Measure from the crossings of the loads' borders to points."""
        z = np.asarray(depth, float)[:, None, None]
        if np.any(z < 0.0):
            raise InputError("depths are not negative", value=float(z.min()), allowed="≥ 0 mm")
        dx, dy = np.broadcast_arrays(
            np.asarray(x, float)[:, None, None] - loads.borders_x[:, None],
            np.asarray(y, float)[:, None, None] - loads.borders_y,
        )
        return cls(dx, dy, z, np.sqrt(dx * dx + dy * dy + z * z))

    @property
    def v(self) -> Array:
        return self.dx * self.v_x + self.dy * self.v_y + self.z * self.v_z

    @property
    def v_x(self) -> Array:
        return _asinh_ratio(self.dy, np.hypot(self.dx, self.z))

    @property
    def v_y(self) -> Array:
        return _asinh_ratio(self.dx, np.hypot(self.dy, self.z))

    @property
    def v_z(self) -> Array:
        return -np.arctan2(self.dx * self.dy, self.z * self.r)

    @property
    def v_xx(self) -> Array:
        return _over(self.dx * (self.r - self.dy), self.r * (self.dx**2 + self.z**2))

    @property
    def v_yy(self) -> Array:
        return _over(self.dy * (self.r - self.dx), self.r * (self.dy**2 + self.z**2))

    @property
    def v_xy(self) -> Array:
        return _over(1.0, self.r)

    @property
    def v_xz(self) -> Array:
        return _over(self.z * (self.r - self.dy), self.r * (self.dx**2 + self.z**2))

    @property
    def v_yz(self) -> Array:
        return _over(self.z * (self.r - self.dx), self.r * (self.dy**2 + self.z**2))

    @property
    def chi_x(self) -> Array:
        return self.dy * self._log + self.z * self.v_x + self.dx * self.chi_xx

    @property
    def chi_y(self) -> Array:
        return self.dx * self._log + self.z * self.v_y + self.dy * self.chi_yy

    @property
    def chi_xx(self) -> Array:
        dx, dy, z, r = self.dx, self.dy, self.z, self.r
        return np.arctan2(dx * dy * (r - z), dx * dx * r + dy * dy * z)

    @property
    def chi_yy(self) -> Array:
        dx, dy, z, r = self.dx, self.dy, self.z, self.r
        return np.arctan2(dx * dy * (r - z), dy * dy * r + dx * dx * z)

    @property
    def chi_xy(self) -> Array:
        return self._log

    @property
    def _log(self) -> Array:
        return np.log(np.maximum(self.r + self.z, _TINY))


def _differences(parts: tuple[Array, ...], loads: Partition, divisor: float) -> Array:
    """Difference corner terms to rectangles and divide them, shape (parts, n, M).

    Distances to the lower border are the longer ones: it counts positive.
    """
    corners = np.stack(np.broadcast_arrays(*parts))
    rectangles: Array = np.diff(np.diff(corners, axis=2), axis=3)
    rectangles /= divisor
    return rectangles.reshape(*corners.shape[:2], loads.count)


def _asinh_ratio(numerator: Array, denominator: Array) -> Array:
    return np.arcsinh(numerator / np.maximum(denominator, _TINY))


def _over(numerator: ArrayLike, denominator: Array) -> Array:
    """Divide; 0 at a corner on the surface, where the term is singular or multiplied by 0."""
    return np.divide(
        numerator, denominator, out=np.zeros_like(denominator), where=denominator > _TINY
    )
