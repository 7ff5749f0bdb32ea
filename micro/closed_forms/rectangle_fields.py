"""Displacements and stresses in a half-space under Legendre modes of pressure on a rectangle.

A point force P on the half-space z > 0 makes, with ρ² = x² + y² + z² and P = 2π,

    u_x = (1 + ν)/E [x z/ρ³ − (1 − 2ν) x/(ρ (ρ + z))],   u_z = (1 + ν)/E [z²/ρ³ + 2 (1 − ν)/ρ],
    σ_xx = (1 − 2ν) [z/ρ³ − 1/(ρ (ρ + z)) + x² h] − 3 x² z/ρ⁵,   h = (2 ρ + z)/(ρ³ (ρ + z)²),
    σ_xy = (1 − 2ν) x y h − 3 x y z/ρ⁵,   σ_xz = −3 x z²/ρ⁵,   σ_zz = −3 z³/ρ⁵,

and with x and y exchanged. Integrals over the rectangle are split at its point next to the one
where the fields are wanted, at the distance d. Along either axis x = d sinh t makes the integrand
smooth, so that Gauss' rules of t converge fast however close the point is.

Source:
    Johnson 1985, Contact Mechanics, section 3.2.

Theory: demos/theory.md, section 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geometry.legendre_modes import mode_values
from geometry.materials import Material

Array = NDArray[np.float64]

_BATCH = 400_000
"""Points of the rules that are summed at once: 3 MB for each kernel."""
_NEAREST = 1e-9
"""Least distance, relative to the rectangle; nearer points count as so far."""
_POINTS, _MORE = 8, 3.0
"""Points of a rule beyond half the number of modes, and more for every factor e by which the
rectangle is longer than the distance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RectangleFields:
    """Fields in a half-space under modes of pressure on the rectangle [0, Lx] × [0, Ly].

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        count: Modes K along a side; mode k K + l is k along x, l along y, of mean square 1 MPa².
        material: Elastic constants of the half-space.
    """

    lengths: tuple[float, float]
    count: int
    material: Material

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Return displacements and stresses at points.

        Args:
            points: Places (x, y, z) with the height z ≤ 0 over the plane, shape (n, 3) [mm].

        Returns:
            Displacements, shape (n, 3, K²) [mm]; and stresses, tension positive, shape
            (n, 3, 3, K²) [MPa]. Both in the axes of the points: z points out of the half-space.
        """
        points = np.asarray(points, float).reshape(-1, 3)
        found = np.empty((len(points), 9, self.count**2))
        nearest = np.clip(points[:, :2], 0.0, self.lengths)
        apart = np.linalg.norm(points - np.column_stack([nearest, 0.0 * nearest[:, 0]]), axis=1)
        apart = np.maximum(apart, _NEAREST * max(self.lengths))
        steps = np.ceil(np.log1p(max(self.lengths) / apart)).astype(int)
        for step in np.unique(steps):
            rule = round(0.5 * self.count + _POINTS + _MORE * step)
            members = np.flatnonzero(steps == step)
            for part in np.array_split(members, -(-len(members) * 4 * rule**2 // _BATCH)):
                found[part] = self._summed(points[part], nearest[part], apart[part], rule)
        return self._assembled(found)

    def _summed(self, points: Array, nearest: Array, apart: Array, rule: int) -> Array:
        """Return the nine kernels integrated over the rectangle, shape (n, 9, K²)."""
        x, along_x = self._rule(0, nearest[:, 0], apart, rule)
        y, along_y = self._rule(1, nearest[:, 1], apart, rule)
        depth = np.maximum(-points[:, 2], _NEAREST * max(self.lengths))
        kernels = _kernels(
            (points[:, :1] - x)[:, :, None],
            (points[:, 1:2] - y)[:, None, :],
            depth[:, None, None],
            self.material.poisson_ratio,
        )
        sums = along_x[:, None] @ kernels @ along_y.transpose(0, 2, 1)[:, None]
        return np.asarray(sums.reshape(len(points), 9, -1) / (2.0 * np.pi))

    def _rule(self, axis: int, nearest: Array, apart: Array, rule: int) -> tuple[Array, Array]:
        """Return places (n, 2 rule) along an axis, and the modes there times weights."""
        nodes, weights = legendre.leggauss(rule)
        length = self.lengths[axis]
        places, factors = [], []
        for way, extent in ((-1.0, nearest), (1.0, length - nearest)):
            end = 0.5 * np.arcsinh(extent / apart)[:, None]
            t = end * (1.0 + nodes)
            places.append(nearest[:, None] + way * apart[:, None] * np.sinh(t))
            factors.append(apart[:, None] * np.cosh(t) * end * weights)
        place, factor = np.concatenate(places, axis=1), np.concatenate(factors, axis=1)
        modes = mode_values(place.ravel(), length, self.count).reshape(self.count, *place.shape)
        return place, modes.transpose(1, 0, 2) * factor[:, None]

    def _assembled(self, found: Array) -> tuple[Array, Array]:
        """Return vectors and tensors from the nine integrals, in axes whose z points outwards."""
        scale = (1.0 + self.material.poisson_ratio) / self.material.young_modulus
        displacement = scale * found[:, :3]
        displacement[:, 2] *= -1.0
        stress = np.empty((len(found), 3, 3, found.shape[2]))
        for part, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), 3):
            stress[:, i, j] = stress[:, j, i] = found[:, part] * (-1.0 if {i, j} > {2} else 1.0)
        return displacement, stress


def _kernels(x: Array, y: Array, z: Array, nu: float) -> Array:
    """Return u_x, u_y, u_z over (1 + ν)/E, σ_xx, σ_yy, σ_zz, σ_xy, σ_xz, σ_yz by forces 2π.

    Shape (n, 9, a, b); z points into the half-space.
    """
    square = x * x + y * y + z * z
    r = np.sqrt(square)
    side, cube = 1.0 - 2.0 * nu, 1.0 / (square * r)
    sum_ = r + z
    one = side / (r * sum_)
    falling = z * cube - one  # of u_x over x, and of σ_xx
    five = 3.0 * z * cube / square
    across = side * (r + sum_) * cube / (sum_ * sum_) - five
    straight = side * z * cube - one
    steep = -five * z
    return np.stack(
        [
            x * falling,
            y * falling,
            z * z * cube + 2.0 * (1.0 - nu) / r,
            straight + x * x * across,
            straight + y * y * across,
            steep * z,
            x * y * across,
            x * steep,
            y * steep,
        ],
        axis=1,
    )
