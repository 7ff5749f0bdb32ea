"""The smooth part erf(α r)/r of the point-force field, for many points through a mesh.

Forces are spread to the nodes of a mesh by B-splines of order 6, convolved with the kernel on the
nodes by a zero-padded FFT and read off by the same B-splines; the kernel's transform is divided
by those of both splines, so that the result interpolates the kernel (smooth particle mesh). With
α h = 0.4 its error is 2e-7 of the mean displacement (root mean square).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.special import erf

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHARPNESS = 0.4
"""α times the mesh spacing h."""

_ORDER = 6
_MARGIN = 24  # cells between the largest distance and the fold of the periodic convolution


@dataclass(frozen=True, kw_only=True, eq=False)
class SplineMesh:
    """Mesh over a rectangle and the weights of n points on it.

    Args:
        nodes: Numbers of nodes along x and y.
        transform: Transform of the kernel over that of the splines.
        weights: Of forces, and of their second derivatives xx, xy, yy; each of shape (n, nodes).
        sharpness: α [1/mm].
    """

    nodes: tuple[int, int]
    transform: Array
    weights: Sequence[csr_array]
    sharpness: float

    @classmethod
    def over(cls, x: Array, y: Array, spacing: float) -> Self:
        """Lay a mesh over points.

        Args:
            x: Abscissae, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
            spacing: Mesh spacing h [mm].

        Source:
            Essmann et al., J. Chem. Phys. 103 (1995) 8577, doi 10.1063/1.470117.
        """
        sharpness = SHARPNESS / spacing
        first, values = zip(
            *(_splines((part - part.min()) / spacing) for part in (x, y)), strict=True
        )
        nodes = tuple(int(part.max(initial=0)) + _ORDER for part in first)
        column = (first[0][:, None] + np.arange(_ORDER))[:, :, None] * nodes[1]
        column = column + (first[1][:, None] + np.arange(_ORDER))[:, None, :]
        ends = np.arange(len(x) + 1) * _ORDER**2
        weights = [
            csr_array(
                (
                    (values[0][p].T[:, :, None] * values[1][q].T[:, None, :]).ravel()
                    / spacing ** (p + q),
                    column.ravel(),
                    ends,
                ),
                shape=(len(x), nodes[0] * nodes[1]),
            )
            for p, q in ((0, 0), (2, 0), (1, 1), (0, 2))
        ]
        return cls(
            nodes=(nodes[0], nodes[1]),
            transform=_transform((nodes[0], nodes[1]), spacing, sharpness),
            weights=weights,
            sharpness=sharpness,
        )

    def subset(self, index: Indices) -> Self:
        """Return the same mesh with some of the points."""
        return replace(self, weights=[part[index] for part in self.weights])

    def displacement(self, *sources: Array) -> Array:
        """Return Σ erf(α r)/r of forces and of derivatives of forces at all points.

        Args:
            sources: Forces, shape (n,), and, if given, moments that go with the second
                derivatives xx, xy and yy.
        """
        spread = sum(part.T @ source for part, source in zip(self.weights, sources, strict=False))
        padded = _padded(self.nodes)
        wave = scipy.fft.rfft2(spread.reshape(self.nodes), s=padded)
        wave *= self.transform
        field = scipy.fft.irfft2(wave, s=padded, overwrite_x=True)
        return self.weights[0] @ field[: self.nodes[0], : self.nodes[1]].ravel()


def smooth_kernel(distance: Array, sharpness: float) -> tuple[Array, Array, Array]:
    """Return f = erf(α r)/r, f'/r and f'' [mm^−1, mm^−3].

    Args:
        distance: r ≥ 0 [mm].
        sharpness: α [1/mm].
    """
    r = np.maximum(distance, 1e-3 / sharpness)  # below it the values at 0 hold to 1e-6
    peak = 2.0 * sharpness / np.sqrt(np.pi)
    gauss = peak * np.exp(-((sharpness * r) ** 2))
    value = erf(sharpness * r) / r
    slope = (gauss - value) / r**2
    curvature = -2.0 * sharpness**2 * gauss - 2.0 * slope
    at_zero = distance < r
    centre = -2.0 / 3.0 * sharpness**2 * peak
    return (
        np.where(at_zero, peak, value),
        np.where(at_zero, centre, slope),
        np.where(at_zero, centre, curvature),
    )


def _padded(nodes: tuple[int, int]) -> tuple[int, int]:
    nx, ny = (scipy.fft.next_fast_len(2 * n + _MARGIN, real=True) for n in nodes)
    return nx, ny


def _transform(nodes: tuple[int, int], spacing: float, sharpness: float) -> Array:
    nx, ny = _padded(nodes)
    x, y = (np.minimum(np.arange(n), n - np.arange(n)) * spacing for n in (nx, ny))
    kernel, _, _ = smooth_kernel(np.hypot(x[:, None], y), sharpness)
    spline = _cardinal(np.zeros(1), _ORDER)[:, 0]
    damping = [np.abs(scipy.fft.fft(spline, n)) ** 2 for n in (nx, ny)]
    # The kernel is even, so its transform is real.
    transform = scipy.fft.rfft2(kernel).real
    return transform / (damping[0][:, None] * damping[1][: ny // 2 + 1])


def _splines(position: Array) -> tuple[Indices, list[Array]]:
    """Return first nodes, shape (n,), and splines and two derivatives on the nodes, (6, n)."""
    first = np.floor(position).astype(np.intp)
    offset = position - first
    values = []
    for derivative in range(3):
        spline = _cardinal(offset, _ORDER - derivative)
        for _ in range(derivative):
            padding = np.zeros((1, len(position)))
            spline = np.concatenate([spline, padding]) - np.concatenate([padding, spline])
        values.append(spline[::-1])
    return first, values


def _cardinal(offset: Array, order: int) -> Array:
    """Return the B-spline of an order at offset, offset + 1, …, shape (order, n)."""
    spline = np.ones((1, *offset.shape))
    for k in range(2, order + 1):
        padding = np.zeros((1, *offset.shape))
        x = offset + np.arange(k)[:, None]
        same, before = np.concatenate([spline, padding]), np.concatenate([padding, spline])
        spline = (x * same + (k - x) * before) / (k - 1)
    return spline
