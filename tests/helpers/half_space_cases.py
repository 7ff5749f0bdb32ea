"""Bodies with a closed-form contact, as heights on a grid."""

import numpy as np

from patchlaw.geometry import Surface


def paraboloid(grid, lengths, radii, *, off=(0.0, 0.0)):
    """Sample −x²/2R1 − y²/2R2 about the centre of the rectangle, moved by ``off`` [mm]."""
    x, y = (
        (np.arange(n) + 0.5) * length / n - 0.5 * length - shift
        for n, length, shift in zip(grid, lengths, off, strict=True)
    )
    heights = -(x[:, None] ** 2) / (2.0 * radii[0]) - y**2 / (2.0 * radii[1])
    return Surface(heights=heights, lengths=lengths)


def wave(grid, lengths, amplitude):
    """Sample amplitude · cos(2πx/Lx), periodic; crest at the border."""
    x = (np.arange(grid[0]) + 0.5) / grid[0]
    heights = np.repeat(amplitude * np.cos(2.0 * np.pi * x)[:, None], grid[1], axis=1)
    return Surface(heights=heights, lengths=lengths, periodic=True)
