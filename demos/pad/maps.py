"""Height maps of a lining, as an instrument delivers them; drawn by chance, none was measured."""

from pathlib import Path

import numpy as np

from patchlaw.geometry import Spectrum, Surface, synthesise

SIDE = 4.0
"""Side of a map [mm]."""
NOISE, TILT, GAPS, SPIKES = 1e-4, (4e-3, -2e-3), 12, 8
"""Noise of the instrument [mm], slopes of the specimen, dark places, and specks of dust."""


def rough(seed: int, pixels: int) -> Surface:
    """Return the roughness itself, part of a larger surface, so that it does not continue.

    Args:
        seed: Seed of the surface.
        pixels: Heights along a side.
    """
    waves = (4, min(64, pixels // 4))  # from 2 mm down to 125 µm, where pixels resolve them
    spectrum = Spectrum(hurst=0.8, waves=waves, rms_height=4e-3, seed=seed)
    whole = synthesise(spectrum, grid=(2 * pixels, 2 * pixels), lengths=(2 * SIDE, 2 * SIDE))
    return Surface(heights=whole.heights[:pixels, :pixels], lengths=(SIDE, SIDE))


def deliver(surface: Surface, seed: int, path: Path) -> Path:
    """Write a surface as an instrument shows it: noise, a tilt, spikes, and places without heights.

    Args:
        surface: The surface.
        seed: Seed of what the instrument adds.
        path: File to write, ending in ``.npy``.
    """
    rng, count = np.random.default_rng(seed), len(surface.heights)
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    heights = surface.heights + TILT[0] * x + TILT[1] * y
    heights += NOISE * rng.standard_normal(heights.shape)
    heights[tuple(rng.integers(0, count, (2, SPIKES)))] += rng.uniform(0.03, 0.08, SPIKES)
    for x0, y0, radius in rng.uniform((0.0, 0.0, 0.02), (SIDE, SIDE, 0.12), (GAPS, 3)):
        heights[(x - x0) ** 2 + (y - y0) ** 2 < radius**2] = np.nan
    np.save(path, heights)
    return path
