"""Makes ground_steel.txt for my_surface.toml: a map as a white-light interferometer exports it.

No surface was measured for it. The map is a self-affine random surface drawn out along y, as the
lay of grinding is, with noise, a tilt, missing heights and spikes of dust. In the project's folder:

    .venv/bin/python demos/scenes/ground_steel.py [FILE]
"""

import sys
from pathlib import Path

import numpy as np

COUNT, PIXEL = 192, 2.5  # heights along a side, their distance [µm]
HURST, LONGEST, LAY = 0.8, 60.0, 8.0  # below LONGEST across the lay [µm] waves are self-affine
RMS_HEIGHT, NOISE = 0.25, 0.005  # of the roughness and of the instrument [µm]
TILT = (6e-3, -2e-3)  # slopes along x and y
GAPS, SPIKES = 12, 5  # places without heights, specks of dust

HEADER = f"""Heights in um at cell centres of a square grid of {PIXEL} um; row = x, column = y
nan: missing. Ground steel as an instrument shows it, but NOT MEASURED: a random surface with the
lay of grinding along y, tilt, noise, gaps and spikes, made for this project by
demos/scenes/ground_steel.py; MIT licence like the rest."""


def roughness(rng: np.random.Generator) -> np.ndarray:
    """Return self-affine heights [µm] with a lay along y, a part of a larger periodic map."""
    many = 2 * COUNT
    qx = np.fft.fftfreq(many, PIXEL)[:, None]
    qy = LAY * np.fft.rfftfreq(many, PIXEL)[None, :]
    amplitude = (LONGEST**-2 + qx**2 + qy**2) ** (-(1.0 + HURST) / 2.0)
    white = np.fft.rfft2(rng.standard_normal((many, many)))
    part = np.fft.irfft2(amplitude * white, (many, many))[:COUNT, :COUNT]
    return RMS_HEIGHT * (part - part.mean()) / part.std()


def as_measured(seed: int = 4) -> np.ndarray:
    """Return heights [µm], shape (192, 192), as an instrument delivers them."""
    rng = np.random.default_rng(seed)
    place = (np.arange(COUNT) + 0.5) * PIXEL
    x, y = np.meshgrid(place, place, indexing="ij")
    heights = roughness(rng) + NOISE * rng.standard_normal((COUNT, COUNT))
    heights += TILT[0] * x + TILT[1] * y
    for x0, y0, radius in rng.uniform((0, 0, 3), (place[-1], place[-1], 18), (GAPS, 3)):
        heights[(x - x0) ** 2 + (y - y0) ** 2 < radius**2] = np.nan
    heights[tuple(rng.integers(0, COUNT, (2, SPIKES)))] += rng.uniform(3, 8, SPIKES)
    return heights


if __name__ == "__main__":
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".txt")
    np.savetxt(file, as_measured(), fmt="%.3f", header=HEADER, encoding="utf-8")
