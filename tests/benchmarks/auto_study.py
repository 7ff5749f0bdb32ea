"""Does the automatically chosen micro model keep the tolerance? Over 48 random surfaces.

Run by hand, a minute or two: python tests/benchmarks/auto_study.py [--quick]

Truth is the half-space solution on three times as many cells a side of the surface's interpolant;
its own error is stated as its difference from twice as many. The seeds are none of those that the
constants in `micro.auto` were found on.
"""

import argparse
import time
from collections import Counter

import numpy as np

from geometry import PatchGrid, Spectrum, Surface, patch_means, synthesise
from micro import HalfSpaceModel, choose
from micro.auto import resampled

TOLERANCES = (0.01, 0.02, 0.05, 0.1)
WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def surfaces(count, seed=77_000):
    """Yield surfaces with a free border and their largest approach."""
    draw = np.random.default_rng(seed)
    for index in range(count):
        grid = int(draw.choice([48, 64, 96, 128, 192, 256]))
        top = min(int(draw.choice([6, 8, 12, 16, 24])), grid // 8)
        band = {"waves": (2, top)}
        if draw.random() < 0.4:
            band = {"waves_x": (2, max(top // 2, 3)), "waves_y": (2, top)}
        slope, hurst = draw.choice([0.05, 0.1, 0.2]), draw.uniform(0.4, 0.9)
        spectrum = Spectrum(hurst=hurst, rms_slope=slope, seed=seed + index, **band)
        made = synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0))
        free = Surface(heights=made.heights, lengths=made.lengths)
        yield free, free.heights.std() * draw.choice([0.5, 1.0, 1.5])


def force(model, approach):
    """Return the forces at half and all of the approach, and the time."""
    heights = patch_means(model.surface, WHOLE) if hasattr(model, "surface") else [0.0]
    start = time.perf_counter()
    response = model.respond([0.5 * approach, approach], patches=WHOLE, mean_heights=heights)
    return response.force, time.perf_counter() - start


def study(count):
    """Return truth's own errors and rows (tolerance, error, promised, label, speed-up)."""
    own, rows = [], []
    for surface, approach in surfaces(count):
        n = surface.grid[0]
        fine = [
            HalfSpaceModel(surface=resampled(surface, (m * n, m * n)), contact_modulus=1.0)
            for m in (2, 3)
        ]
        (coarse, _), (truth, slow) = (force(model, approach) for model in fine)
        own.append(np.abs(coarse / truth - 1.0).max())
        for tolerance in TOLERANCES:
            found = choose(surface, contact_modulus=1.0, approach=approach, tolerance=tolerance)
            got, fast = force(found.model, approach)
            promised = found.taken.expected_error <= tolerance
            ratio = round(found.model.surface.grid[0] / n, 3) if "cells" in found.taken.label else 0
            error = np.abs(got / truth - 1.0).max()
            rows.append((tolerance, error, promised, ratio or found.taken.label, slow / fast))
    return np.array(own), rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    own, rows = study(10 if parser.parse_args().quick else 48)
    print(f"truth itself: median {np.median(own):.2%}, largest {own.max():.2%}")
    print("tolerance  promised  kept  median error  largest  speed-up  chosen (cells / own cells)")
    for tolerance in TOLERANCES:
        mine = [row for row in rows if row[0] == tolerance and row[2]]
        errors = np.array([row[1] for row in mine])
        print(
            f"{tolerance:9.0%} {len(mine):9d} {np.mean(errors <= tolerance):5.0%} "
            f"{np.median(errors):13.2%} {errors.max():8.2%} "
            f"{np.median([row[4] for row in mine]):8.1f}  {dict(Counter(r[3] for r in mine))}"
        )


if __name__ == "__main__":
    main()
