"""Displacements and stresses in a half-space under Legendre modes of traction on a rectangle.

A point force 2π on the half-space z > 0 makes, with ρ² = x² + y² + z²,

    u_x = (1 + ν)/E [x z/ρ³ − (1 − 2ν) x/(ρ (ρ + z))],   u_z = (1 + ν)/E [z²/ρ³ + 2 (1 − ν)/ρ],
    σ_xx = (1 − 2ν) [z/ρ³ − 1/(ρ (ρ + z)) + x² h] − 3 x² z/ρ⁵,   h = (2 ρ + z)/(ρ³ (ρ + z)²),
    σ_xy = (1 − 2ν) x y h − 3 x y z/ρ⁵,   σ_xz = −3 x z²/ρ⁵,   σ_zz = −3 z³/ρ⁵,

and with x and y exchanged. One along x makes (Cerruti), with a = 1/(ρ + z),

    u_x = (1 + ν)/E [1/ρ + x²/ρ³ + (1 − 2ν) (a − x² a²/ρ)],
    u_y = (1 + ν)/E [x y/ρ³ − (1 − 2ν) x y a²/ρ],   u_z = (1 + ν)/E [x z/ρ³ + (1 − 2ν) x a/ρ],
    σ_xx = (1 − 2ν) [x/ρ³ − 3 x a²/ρ + x³ k] − 3 x³/ρ⁵,   k = a²/ρ³ + 2 a³/ρ²,
    σ_yy = (1 − 2ν) [x/ρ³ − x a²/ρ + x y² k] − 3 x y²/ρ⁵,   σ_zz = −3 x z²/ρ⁵,
    σ_xy = (1 − 2ν) [x² y k − y a²/ρ] − 3 x² y/ρ⁵,   σ_xz = −3 x² z/ρ⁵,   σ_yz = −3 x y z/ρ⁵.

Integrals over the rectangle are split at its point nearest to the one
where the fields are wanted. Along either axis x = d sinh t, with d the distance, makes the
integrand smooth, so that Gauss' rules of t converge fast however close the point is.

Where a free side of a body bounds the rectangle, the half-space may bear any pressures beyond it.
With none the fields have kinks at the side, and so has what the body adds. The modes go on there
instead, with values and two derivatives that fit, until they vanish: polynomials of degree 5 of the
distance s from the side, over a length ℓ on which they vanish likewise,

    H₀ = 1 − 10 s³ + 15 s⁴ − 6 s⁵,   H₁ = s − 6 s³ + 8 s⁴ − 3 s⁵,   H₂ = (s² − 3 s³ + 3 s⁴ − s⁵)/2.

Source:
    Johnson 1985, Contact Mechanics, sections 3.2 and 3.6.

Theory: docs/theory.md, section 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from patchlaw.geometry import Material
from patchlaw.geometry.face_frame import gauss_rule, mode_values
from patchlaw.micro.boundary_elements.body_modes import (
    half_space_modes,
    half_space_stress_modes,
    half_space_traction_modes,
)
from patchlaw.support import Array, Indices, Lengths, check_fields

Sides = tuple[bool, bool, bool, bool]
"""Low x, high x, low y and high y side of a rectangle."""

_NEAREST = 1e-9
"""Least distance, relative to the rectangle; nearer points count as so far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RectangleFields:
    """Fields in a half-space under modes of traction on the rectangle [0, Lx] × [0, Ly].

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        count: Modes K along a side; mode k K + l is k along x, l along y, of mean square 1 MPa².
        material: Elastic constants of the half-space.
        extended: Sides beyond which the tractions go on smoothly.
        axis: Direction of the tractions: 0 along x, 1 along y, 2 pressures, into the half-space.

    Raises:
        InputError: When a length is not positive.
    """

    lengths: Lengths
    count: int
    material: Material
    extended: Sides = (False, False, False, False)
    axis: int = 2

    def __post_init__(self) -> None:
        check_fields(self)

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Return displacements and stresses at points.

        Args:
            points: Places (x, y, z) with the height z ≤ 0 over the plane, shape (n, 3) [mm].

        Returns:
            Displacements, shape (n, 3, K²) [mm]; and stresses, tension positive, shape
            (n, 3, 3, K²) [MPa]. Both in the axes of the points: z points out of the half-space.
        """
        return self._assembled(sum(self._of_parts(points, *parts) for parts in self._parts()))

    def modes(self) -> tuple[Array, Array]:
        """Return displacements downwards and stresses in the surface by unit moments, in modes.

        Returns:
            Shape (K², K²) [mm/N]; and σ_xx, σ_yy and σ_xy, shape (3, K², K²) [1/mm²].
        """
        lengths, count, material = self.lengths, self.count, self.material
        normal = half_space_modes(lengths, count) / material.contact_modulus
        stresses = half_space_stress_modes(lengths, material.poisson_ratio, count)
        moved, added = self._moments_beyond()
        return normal + moved[2], stresses + added

    def displacement_modes(self) -> Array:
        """Return displacements along x, y and downwards by unit moments of tractions along a side.

        Returns:
            Shape (3, K², K²) [mm/N].
        """
        material = self.material
        whole = half_space_traction_modes(self.lengths, material.poisson_ratio, self.count)
        moved, _ = self._moments_beyond()
        return np.asarray(whole[:, self.axis] / material.contact_modulus + moved)

    def _moments_beyond(self) -> tuple[Array, Array]:
        """Return what goes on beyond the sides adds in modes.

        Returns:
            Displacements along x, y and downwards, (3, K², K²) [mm/N]; σ_xx, σ_yy and σ_xy,
            (3, K², K²) [1/mm²].
        """
        lengths, count = self.lengths, self.count
        beyond = [parts for parts in self._parts() if parts != (0, 0)]
        if not beyond:
            return np.zeros((3, count**2, count**2)), np.zeros((3, count**2, count**2))
        (x, along_x), (y, along_y) = (_graded(length, count) for length in lengths)
        places = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
        fields = sum(self._of_parts(places, *parts) for parts in beyond)
        displacement, stress = self._assembled(fields)
        # the moments of a mode's displacement, by the mode's own moment: the area
        tests = np.kron(along_x, along_y) / (lengths[0] * lengths[1]) ** 2
        moved = [sign * (tests @ displacement[:, i]) for i, sign in enumerate((1.0, 1.0, -1.0))]
        added = [tests @ stress[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1))]
        return np.stack(moved), np.stack(added)

    @property
    def reach(self) -> tuple[float, float]:
        """Lengths ℓ along x and y that the pressures go on beyond sides [mm].

        They are half the rectangle's length over the number of modes. On a cube of 12³ quadratic
        hexahedra with 8 modes, half of it, itself, twice and four times it left 0.03, 0.15, 0.2 and
        0.3 per mille of the force on Set 1's recipe by displacements, and 0.9, 0.6, 0.8 and 2 with
        the stresses of finite slopes.
        """
        share = 0.5 / self.count
        return share * self.lengths[0], share * self.lengths[1]

    def _parts(self) -> Iterator[tuple[int, int]]:
        """Yield the rectangle (0, 0), and what lies beyond its low (−1) and high (1) sides."""
        left, right, lower, upper = self.extended
        yield from product([0, *[-1] * left, *[1] * right], [0, *[-1] * lower, *[1] * upper])

    def _interval(self, axis: int, part: int) -> tuple[float, float]:
        """Return the ends of a part along an axis [mm]."""
        length, reach = self.lengths[axis], self.reach[axis]
        return {-1: (-reach, 0.0), 0: (0.0, length), 1: (length, length + reach)}[part]

    def _of_parts(self, points: Array, *parts: int) -> Array:
        """Return the nine kernels integrated over a part of the pressures, shape (n, 9, K²)."""
        points = np.asarray(points, float).reshape(-1, 3)
        kernels = np.empty((len(points), 9, self.count**2))
        low, high = np.transpose([self._interval(axis, part) for axis, part in enumerate(parts)])
        nearest = np.clip(points[:, :2], low, high)
        apart = np.linalg.norm(points - np.pad(nearest, ((0, 0), (0, 1))), axis=1)
        apart = np.maximum(apart, _NEAREST * max(self.lengths))
        sizes = np.stack([self._size(axis, part, apart) for axis, part in enumerate(parts)], axis=1)
        for size in np.unique(sizes, axis=0):
            members = np.flatnonzero((sizes == size).all(axis=1))
            many = int(np.prod(np.abs(size))) * 4
            # 3 MB for each kernel at once
            for some in np.array_split(members, -(-len(members) * many // 400_000)):
                rules = [
                    self._rule(axis, part, nearest[some, axis], apart[some], int(size[axis]))
                    for axis, part in enumerate(parts)
                ]
                kernels[some] = self._summed(points[some], *rules)
        return kernels

    def _size(self, axis: int, part: int, apart: Array) -> Indices:
        """Return the points of a rule on either side of the nearest point, or −those of one.

        They leave 1e-8 of the largest value, with 4 more 1e-12. Where a part is not much longer
        than the distance one rule serves all of it.
        """
        low, high = self._interval(axis, part)
        longer = (high - low) / apart
        least = 0.5 * (self.count if part == 0 else 5)  # half the degree of the pressures
        both = np.round(least + 4.0 + 3.0 * np.ceil(np.log1p(longer)))
        return np.where(longer < 1.5, -np.round(least + 7.0), both).astype(np.intp)

    def _summed(
        self, points: Array, along_x: tuple[Array, Array], along_y: tuple[Array, Array]
    ) -> Array:
        """Return the nine kernels summed over places and weights along both axes, (n, 9, K²)."""
        x = (points[:, :1] - along_x[0])[:, :, None]
        y = (points[:, 1:2] - along_y[0])[:, None, :]
        z = np.maximum(-points[:, 2], _NEAREST * max(self.lengths))[:, None, None]
        nu = self.material.poisson_ratio
        if self.axis == 2:
            kernels = _kernels(x, y, z, nu)
        elif self.axis == 0:
            kernels = _shear_kernels(x, y, z, nu)
        else:
            kernels = _shear_kernels(y, x, z, nu)[:, [1, 0, 2, 4, 3, 5, 6, 8, 7]]
        sums = along_x[1][:, None] @ kernels @ along_y[1].transpose(0, 2, 1)[:, None]
        return np.asarray(sums.reshape(len(points), 9, -1) / (2.0 * np.pi))

    def _rule(
        self, axis: int, part: int, nearest: Array, apart: Array, rule: int
    ) -> tuple[Array, Array]:
        """Return places (n, 2 rule) along an axis, and the pressures there times weights."""
        nodes, weights = gauss_rule(abs(rule))
        low, high = self._interval(axis, part)
        if rule < 0:
            t = np.broadcast_to(0.5 * (low + high + (high - low) * nodes), (len(apart), -rule))
            return t, self._pressures(axis, part, t) * (0.5 * (high - low) * weights)
        places, factors = [], []
        for way, extent in ((-1.0, nearest - low), (1.0, high - nearest)):
            end = 0.5 * np.arcsinh(extent / apart)[:, None]
            t = end * (1.0 + nodes)
            places.append(nearest[:, None] + way * apart[:, None] * np.sinh(t))
            factors.append(apart[:, None] * np.cosh(t) * end * weights)
        place, factor = np.concatenate(places, axis=1), np.concatenate(factors, axis=1)
        return place, self._pressures(axis, part, place) * factor[:, None]

    def _pressures(self, axis: int, part: int, place: Array) -> Array:
        """Return the modes at places (n, m), and what they go on with, shape (n, K, m)."""
        low, high = self._interval(axis, part)
        if part:
            distance = place - low if part > 0 else high - place
            values = self._beyond(axis, part, distance.ravel())
        else:
            values = mode_values(place.ravel(), self.lengths[axis], self.count)
        return values.reshape(self.count, *place.shape).transpose(1, 0, 2)

    def _beyond(self, axis: int, part: int, distance: Array) -> Array:
        """Return the modes at distances beyond a side, shape (K, n)."""
        reach, k = self.reach[axis], np.arange(self.count, dtype=float)
        # values and derivatives of P_k(t) at t = 1, where dt = 2/L dx
        step = 2.0 * reach / self.lengths[axis]
        ends = np.stack(
            [
                np.ones_like(k),
                0.5 * k * (k + 1.0) * step,
                0.125 * (k - 1.0) * k * (k + 1.0) * (k + 2.0) * step**2,
            ]
        )
        ends *= np.sqrt(2.0 * k + 1.0) * (1.0 if part > 0 else (-1.0) ** k)
        s = distance / reach
        shapes = np.stack(
            [
                1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s * s),
                s - s**3 * (6.0 - 8.0 * s + 3.0 * s * s),
                0.5 * s * s * (1.0 - s) ** 3,
            ]
        )
        return np.asarray(ends.T @ shapes)

    def _assembled(self, kernels: Any) -> tuple[Array, Array]:
        """Return vectors and tensors from the nine integrals, in axes whose z points outwards."""
        scale = (1.0 + self.material.poisson_ratio) / self.material.young_modulus
        displacement = scale * kernels[:, :3]
        displacement[:, 2] *= -1.0
        stress = np.empty((len(kernels), 3, 3, kernels.shape[2]))
        for part, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1)), 3):
            stress[:, i, j] = stress[:, j, i] = kernels[:, part]
        for part, i in ((7, 0), (8, 1)):
            stress[:, i, 2] = stress[:, 2, i] = -kernels[:, part]
        return displacement, stress


def _kernels(x: Array, y: Array, z: Array, nu: float) -> Array:
    """Return u_x, u_y, u_z over (1 + ν)/E, σ_xx, σ_yy, σ_zz, σ_xy, σ_xz, σ_yz by forces 2π.

    Shape (n, 9, a, b); z points into the half-space.
    """
    square = x * x + y * y + z * z
    r = np.sqrt(square)
    side, cube = 1.0 - 2.0 * nu, 1.0 / (square * r)
    one = side / (r * (r + z))
    radial = z * cube - one
    five = 3.0 * z * cube / square
    across = side * (2.0 * r + z) * cube / (r + z) ** 2 - five
    straight, steep = side * z * cube - one, -five * z
    return np.stack(
        [
            x * radial,
            y * radial,
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


def _shear_kernels(x: Array, y: Array, z: Array, nu: float) -> Array:
    """Return the same by forces 2π along x."""
    square = x * x + y * y + z * z
    r = np.sqrt(square)
    side, cube, a = 1.0 - 2.0 * nu, 1.0 / (square * r), 1.0 / (r + z)
    bent, five = a * a / r, 3.0 * cube / square
    across = side * a * a * (cube + 2.0 * a / square) - five
    radial = cube - side * bent
    straight = side * (cube - bent)
    return np.stack(
        [
            1.0 / r + side * a + x * x * radial,
            x * y * radial,
            x * (z * cube + side * a / r),
            x * (straight - 2.0 * side * bent + x * x * across),
            x * (straight + y * y * across),
            -five * x * z * z,
            y * (x * x * across - side * bent),
            -five * x * x * z,
            -five * x * y * z,
        ],
        axis=1,
    )


def _graded(length: float, count: int) -> tuple[Array, Array]:
    """Return points that lie denser towards both ends, and the modes times their weights.

    x = L (10 t³ − 15 t⁴ + 6 t⁵): a logarithm of the distance from an end becomes smooth. The 28
    points leave 1e-6 of displacements and stresses.
    """
    nodes, weights = gauss_rule(28)
    t = 0.5 * (1.0 + nodes)
    x = length * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
    slope = 30.0 * length * (t * (1.0 - t)) ** 2
    return x, mode_values(x, length, count) * (0.5 * weights * slope)
