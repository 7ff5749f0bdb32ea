"""A half-space solution of rough contact by Polonsky & Keer, written for the tests alone.

Uniform pressure on square cells (Love's corner sum, written out here), zero-padded convolution,
conjugate gradients with the projection of Polonsky & Keer, Wear 231 (1999) 206, for a prescribed
approach. Contact modulus 1; nothing of `micro` is used.
"""

from functools import lru_cache

import numpy as np
from scipy.fft import irfft2, rfft2


@lru_cache(maxsize=4)
def _kernel(cells):
    """Transform of the displacement by a unit pressure on one of cells × cells of a 1 mm square."""
    index = np.minimum(np.arange(2 * cells), 2 * cells - np.arange(2 * cells)) / cells
    total = 0.0
    for i in (1, -1):
        for j in (1, -1):
            u, v = index[:, None] + i * 0.5 / cells, index + j * 0.5 / cells
            total = total + i * j * (u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v)))
    return rfft2(total / np.pi)


def pressures(heights, plane, *, start=None, tolerance=1e-7):
    """Return p ≥ 0 with gap ≥ 0 and p · gap = 0 for a plane at a height, E* = 1."""
    cells = len(heights)
    penetration = heights - plane
    p = np.maximum(penetration, 0.0) if start is None else start
    direction, last, conjugate = np.zeros_like(p), 1.0, 0.0

    def displaced(q):
        padded = (2 * cells, 2 * cells)
        return irfft2(_kernel(cells) * rfft2(q, s=padded), s=padded)[:cells, :cells]

    for _ in range(1000):
        gap = displaced(p) - penetration
        on = p > 0.0
        active = np.where(on, gap, 0.0)
        error = max(np.abs(active).max(), -gap.min())
        if error <= tolerance * penetration.max():
            return p
        norm = np.sum(active**2)
        direction = np.where(on, gap + conjugate * norm / last * direction, 0.0)
        step = np.sum(active * direction) / np.sum(displaced(direction)[on] * direction[on])
        p = np.maximum(p - step * direction, 0.0)
        entering = (p == 0.0) & (gap < 0.0)
        p[entering] -= step * gap[entering]
        conjugate, last = float(not entering.any()), norm
    raise AssertionError("the oracle did not converge")


def force_and_area(p):
    """Return force and area on a 1 mm square; the area corrected for its pixels' perimeter.

    Source: Yastrebov et al., Tribol. Int. 114 (2017) 161: (π − 1 + ln 2)/24 × perimeter × cell.
    """
    cell = 1.0 / len(p)
    on = np.pad(p > 0.0, 1).astype(int)
    edges = sum(np.abs(np.diff(on, axis=axis)).sum() for axis in (0, 1))
    area = on.sum() - (np.pi - 1.0 + np.log(2.0)) / 24.0 * edges
    return p.sum() * cell**2, area * cell**2
