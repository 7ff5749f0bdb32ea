"""Displacements and stresses in a half-space under Legendre modes of pressure on a rectangle.

A point force 2π on the half-space z > 0 makes, with ρ² = x² + y² + z²,

    u_x = (1 + ν)/E [x z/ρ³ − (1 − 2ν) x/(ρ (ρ + z))],   u_z = (1 + ν)/E [z²/ρ³ + 2 (1 − ν)/ρ],
    σ_xx = (1 − 2ν) [z/ρ³ − 1/(ρ (ρ + z)) + x² h] − 3 x² z/ρ⁵,   h = (2 ρ + z)/(ρ³ (ρ + z)²),
    σ_xy = (1 − 2ν) x y h − 3 x y z/ρ⁵,   σ_xz = −3 x z²/ρ⁵,   σ_zz = −3 z³/ρ⁵,

and with x and y exchanged. Integrals over the rectangle are split at its point nearest to the one
where the fields are wanted. Along either axis x = d sinh t, with d the distance, makes the
integrand smooth, so that Gauss' rules of t converge fast however close the point is.

Mirror images of the pressures about sides of the rectangle leave no shear stress on the planes
across these sides. What a body with such free sides adds is smoother with them.

Source:
    Johnson 1985, Contact Mechanics, section 3.2.

Theory: demos/theory.md, section 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geometry.checks import positive_lengths
from geometry.legendre_modes import mode_values
from geometry.materials import Material
from micro.compliance.rectangle_modes import half_space_modes, half_space_stress_modes

Array = NDArray[np.float64]
Sides = tuple[bool, bool, bool, bool]
"""Low x, high x, low y and high y side of a rectangle."""

_BATCH = 400_000
"""Points of the rules that are summed at once: 3 MB for each kernel."""
_NEAREST = 1e-9
"""Least distance, relative to the rectangle; nearer points count as so far."""
_POINTS, _MORE = 4, 3.0
"""Points of a rule beyond half the number of modes, and more for every factor e by which the
rectangle is longer than the distance. They leave 1e-8 of the largest value, 4 more 1e-12."""
_GRADED = 28
"""Points along an axis that integrate what images displace in the rectangle: 1e-6 are left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RectangleFields:
    """Fields in a half-space under modes of pressure on the rectangle [0, Lx] × [0, Ly].

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        count: Modes K along a side; mode k K + l is k along x, l along y, of mean square 1 MPa².
        material: Elastic constants of the half-space.
        mirrors: Sides about which the pressures have mirror images.

    Raises:
        InputError: When a length is not positive.
    """

    lengths: tuple[float, float]
    count: int
    material: Material
    mirrors: Sides = (False, False, False, False)

    def __post_init__(self) -> None:
        positive_lengths(self.lengths, "the rectangle")

    def __call__(self, points: Array) -> tuple[Array, Array]:
        """Return displacements and stresses at points.

        Args:
            points: Places (x, y, z) with the height z ≤ 0 over the plane, shape (n, 3) [mm].

        Returns:
            Displacements, shape (n, 3, K²) [mm]; and stresses, tension positive, shape
            (n, 3, 3, K²) [MPa]. Both in the axes of the points: z points out of the half-space.
        """
        total = sum(self._of_image(points, image) for image in self._images())
        return self._assembled(np.asarray(total))

    def modes(self) -> tuple[Array, Array]:
        """Return displacements downwards and stresses in the surface by unit moments, in modes.

        Returns:
            Shape (K², K²) [mm/N]; and σ_xx, σ_yy and σ_xy, shape (3, K², K²) [1/mm²].
        """
        lengths, count, material = self.lengths, self.count, self.material
        normal = half_space_modes(lengths, count) / material.contact_modulus
        stresses = half_space_stress_modes(lengths, material.poisson_ratio, count)
        images = [image for image in self._images() if any(image)]
        if not images:
            return normal, stresses
        (x, along_x), (y, along_y) = (_graded(length, count) for length in lengths)
        places = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
        displacement, stress = self._assembled(
            np.asarray(sum(self._of_image(places, image) for image in images))
        )
        tests = np.kron(along_x, along_y) / (lengths[0] * lengths[1]) ** 2
        by_images = -tests @ displacement[:, 2]
        normal = normal + 0.5 * (by_images + by_images.T)
        parts = [tests @ stress[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1))]
        return normal, stresses + np.stack(parts)

    def _images(self) -> Iterator[tuple[int, int]]:
        """Yield where the rectangle and its images lie, in lengths of the rectangle."""
        left, right, lower, upper = self.mirrors
        yield from product([0, *[-1] * left, *[1] * right], [0, *[-1] * lower, *[1] * upper])

    def _of_image(self, points: Array, image: tuple[int, int]) -> Array:
        """Return the nine kernels integrated over an image of the rectangle, shape (n, 9, K²)."""
        shift = np.array([*np.multiply(image, self.lengths), 0.0])
        points = np.asarray(points, float).reshape(-1, 3) - shift
        found = np.empty((len(points), 9, self.count**2))
        nearest = np.clip(points[:, :2], 0.0, self.lengths)
        apart = np.linalg.norm(points - np.pad(nearest, ((0, 0), (0, 1))), axis=1)
        apart = np.maximum(apart, _NEAREST * max(self.lengths))
        steps = np.ceil(np.log1p(max(self.lengths) / apart)).astype(int)
        for step in np.unique(steps):
            rule = round(0.5 * self.count + _POINTS + _MORE * step)
            members = np.flatnonzero(steps == step)
            for part in np.array_split(members, -(-len(members) * 4 * rule**2 // _BATCH)):
                found[part] = self._summed(points[part], nearest[part], apart[part], rule)
        odd = (-1.0) ** np.arange(self.count)  # odd modes change their sign in a mirror
        signs = [odd if place else np.ones(self.count) for place in image]
        return found * np.kron(*signs)

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
        for part, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1)), 3):
            stress[:, i, j] = stress[:, j, i] = found[:, part]
        for part, i in ((7, 0), (8, 1)):
            stress[:, i, 2] = stress[:, 2, i] = -found[:, part]
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


def _graded(length: float, count: int) -> tuple[Array, Array]:
    """Return points that lie denser towards both ends, and the modes times their weights.

    x = L (10 t³ − 15 t⁴ + 6 t⁵): a logarithm of the distance from an end becomes smooth.
    """
    nodes, weights = legendre.leggauss(_GRADED)
    t = 0.5 * (1.0 + nodes)
    x = length * t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
    slope = 30.0 * length * (t * (1.0 - t)) ** 2
    return x, mode_values(x, length, count) * (0.5 * weights * slope)
