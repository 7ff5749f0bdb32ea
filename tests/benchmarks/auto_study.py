"""Does the automatically chosen micro model keep the tolerance? Over 60 random surfaces.

Run by hand, some minutes: python tests/benchmarks/auto_study.py [--surfaces N] [--seed S]
[--large] [--rows FILE …]. The rows are kept in the first file, or joined from all
files that exist.

Truth is extrapolated from half-space solutions on grids up to four times as fine as the surface's
own. None of the seeds took part in the calibration.
"""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
from auto_surfaces import converged, forces, surfaces

from micro import choose

TOLERANCES = (0.02, 0.05, 0.1, 0.2)


LARGE = {512: 0.6, 1024: 0.4}


def study(count, seed, grids):
    """Return rows (heights, tolerance, error, promised, label, truth's error)."""
    rows = []
    for surface, approach in surfaces(count, seed, grids):
        loads = [0.5 * approach, approach]
        truth, own = converged(surface, loads)
        for tolerance in TOLERANCES:
            found = choose(
                surface,
                contact_modulus=1.0,
                approach=approach,
                tolerance=tolerance,
            )
            error = np.abs(forces(found.model, loads) / truth - 1.0).max()
            taken = found.taken
            kept = taken.checked_error is None or taken.checked_error <= tolerance
            promised = bool(taken.expected_error <= tolerance and kept)
            label = "scaled elliptic" if "curvature" in taken.label else taken.label
            if "cells" in taken.label:
                label = f"{found.model.surface.grid[0] / surface.grid[0]:.3g}"
            rows.append((surface.grid[0], tolerance, error, promised, label, own.max()))
    return rows


def table(rows):
    """Print how often every tolerance was kept."""
    own = np.array([row[5] for row in rows[:: len(TOLERANCES)]])
    print(
        f"{len(own)} surfaces; truth itself: median {np.median(own):.2%}, 95 % within "
        f"{np.quantile(own, 0.95):.2%}, largest {own.max():.2%}"
    )
    print("tolerance  promised  kept  median error  largest  all kept  chosen (numbers: own cells)")
    for tolerance in TOLERANCES:
        every = [row for row in rows if row[1] == tolerance]
        mine = [row for row in every if row[3]]
        errors = np.array([row[2] for row in mine])
        kept = np.mean([row[2] <= tolerance for row in every])
        chosen = dict(Counter(row[4] for row in mine).most_common())
        print(
            f"{tolerance:9.0%} {len(mine):9d} {np.mean(errors <= tolerance):5.0%} "
            f"{np.median(errors):13.2%} {errors.max():8.2%} {kept:9.0%}  {chosen}"
        )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--surfaces", type=int, default=60)
    parser.add_argument("--seed", type=int, default=770_000)
    parser.add_argument("--large", action="store_true", help="512² and 1024² heights only")
    parser.add_argument("--rows", type=Path, nargs="*", default=[])
    given = parser.parse_args()
    rows = []
    for path in given.rows:
        rows += np.load(path, allow_pickle=True)["rows"].tolist() if path.exists() else []
    if not rows:
        rows = study(given.surfaces, given.seed, LARGE if given.large else None)
        if given.rows:
            np.savez(given.rows[0], rows=np.array(rows, dtype=object))
    table(rows)


if __name__ == "__main__":
    main()
