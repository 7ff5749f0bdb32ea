"""Random surfaces with a converged half-space solution, for the choice of micro models."""

import numpy as np

from geometry import PatchGrid, Spectrum, Surface, synthesise
from micro import HalfSpaceModel

WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
GRIDS = {48: 0.15, 64: 0.2, 96: 0.15, 128: 0.2, 192: 0.1, 256: 0.1, 512: 0.1}
"""Heights along a side, and how often they are drawn."""


def surfaces(count, seed, grids=None):
    """Yield surfaces and their largest approach."""
    grids = grids or GRIDS
    draw = np.random.default_rng(seed)
    for index in range(count):
        n = int(draw.choice(list(grids), p=list(grids.values())))
        low = int(draw.choice([1, 2, 4]))
        top = max(n // int(draw.choice([8, 12, 16, 32])), 2 * low, 6)
        band = {"waves": (low, top)}
        if draw.random() < 0.4:
            band = {"waves_x": (low, max(top // 2, low + 1)), "waves_y": (low, top)}
        slope, hurst = draw.choice([0.05, 0.1, 0.2]), draw.uniform(0.3, 1.0)
        spectrum = Spectrum(hurst=hurst, rms_slope=slope, seed=seed + index, **band)
        made = synthesise(spectrum, grid=(n, n), lengths=(1.0, 1.0))
        rough = Surface(heights=made.heights, lengths=made.lengths)
        yield rough, rough.heights.std() * draw.choice([0.4, 0.7, 1.0, 1.5, 2.0])


def forces(model, loads):
    """Return the forces at approaches."""
    return model.respond(loads, patches=WHOLE, mean_heights=[0.0]).force


def converged(surface, loads):
    """Return forces extrapolated over grids finer than the surface's own, and their own error.

    The error is what the extrapolation adds to the finest grid, relative to the force. Surfaces
    of 512² heights and more start from their own grid.
    """
    n = surface.grid[0]
    factors = (2, 3, 4) if n <= 192 else (1, 1.5, 2, 3) if n <= 256 else (1, 1.5, 2)
    found = []
    for factor in factors:
        cells = (round(factor * n),) * 2
        fine = HalfSpaceModel(surface, contact_modulus=1.0).resampled(cells).surface
        model = HalfSpaceModel(
            surface=fine,
            contact_modulus=1.0,
            highest=surface.highest,
        )
        found.append(forces(model, loads))
    step = np.array(factors, float) ** -2.0
    limit = np.polyfit(step, np.array(found), 1)[1]
    return limit, np.abs(limit / found[-1] - 1.0)
