"""Oracle of finite slopes: a periodic rough half-space without an expansion in its heights."""

import numpy as np


def displaced(heights, pressure, shear, nu):
    """Return −u_z on the surface z = h of a half-space, without its mean, shape (n, n).

    Every wave of the plane carries three solutions that decay with depth: shear, the gradient
    of a harmonic function φ, and Papkovich's (3 − 4ν) ψ e_z − z ∇ψ. Their tractions meet −p e_z per
    area of the plane at the grid's points. The period is 2π, n odd, and p has no mean.
    """
    n = len(heights)
    x = 2.0 * np.pi * np.arange(n) / n
    points = np.stack([*np.meshgrid(x, x, indexing="ij"), heights]).reshape(3, -1)
    slopes = _gradient(heights).reshape(2, -1)
    columns, lifts = [], []
    for kx, ky in _wave_vectors(n):
        for field in _solutions(kx, ky, points, nu):
            u, gradient = field
            stress = shear * (gradient + gradient.swapaxes(0, 1))
            trace = np.trace(gradient) * 2.0 * shear * nu / (1.0 - 2.0 * nu)
            stress += trace * np.eye(3)[:, :, None]
            traction = stress[:, 2] - slopes[0] * stress[:, 0] - slopes[1] * stress[:, 1]
            columns.append(traction.ravel())
            lifts.append(u[2])
    wanted = np.zeros((3, n * n))
    wanted[2] = -pressure.ravel()
    shares, *_ = np.linalg.lstsq(np.stack(columns, axis=1), wanted.ravel(), rcond=None)
    found = -(np.stack(lifts, axis=1) @ shares).real.reshape(n, n)
    return found - found.mean()


def _wave_vectors(n):
    numbers = np.arange(n) - n // 2
    return [(kx, ky) for kx in numbers for ky in numbers if (kx, ky) != (0, 0)]


def _gradient(heights):
    n = len(heights)
    k = 1j * np.fft.fftfreq(n, 1.0 / n)
    waves = np.fft.fft2(heights)
    return np.stack([np.fft.ifft2(k[:, None] * waves).real, np.fft.ifft2(k * waves).real])


def _solutions(kx, ky, points, nu):
    """Yield displacements (3, m) and their gradients [i, j] = ∂u_i/∂x_j, shape (3, 3, m)."""
    k = np.hypot(kx, ky)
    z = points[2]
    wave = np.exp(1j * (kx * points[0] + ky * points[1]) + k * z)
    d = np.array([1j * kx, 1j * ky, k])  # of the wave
    for u in (np.array([-ky, kx, 0.0]) / k, d / k):
        yield u[:, None] * wave, np.multiply.outer(np.outer(u, d), wave)
    up = np.array([0.0, 0.0, 1.0])
    constant, falling = (3.0 - 4.0 * nu) * up, -d
    gradient = np.multiply.outer(np.outer(constant, d) + np.outer(falling, up), wave)
    gradient = gradient + np.multiply.outer(np.outer(falling, d), z * wave)
    yield constant[:, None] * wave + falling[:, None] * (z * wave), gradient
