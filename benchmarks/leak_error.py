"""How well coarser grids, and next to closing wider gaps, tell the error of a leak.

Surfaces, periodic or not, of 32² to 48² cells, 5 to 16 of them along the shortest wave, each under
two loads of 2 to 60 % contact area. The true leak is that on four times as many cells a side. Run
from the project's root; a surface takes 2 s:

    .venv/bin/python benchmarks/leak_error.py --first 0 --last 100
"""

import argparse
from itertools import pairwise

import numpy as np

from patchlaw.geometry.spectrum import Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flow, widened_gap
from patchlaw.multiscale.laws.transmissivity import error_of_grid

AREAS = (0.0, 0.05, 0.15, 0.25, 0.35, 1.0)
"""Borders of the contact area fraction between rows of the table."""
MODULUS = 1000.0


def flows(seed):
    """Return rows of contact area, T, that on half of the cells, stated and true error."""
    dice = np.random.default_rng(seed)
    cells, periodic = int(dice.choice([32, 40, 48])), bool(dice.random() < 0.5)
    low = dice.uniform(1, 2)
    waves = low, dice.uniform(max(low + 1, cells / 16), cells / 5)
    hurst, slope = dice.uniform(0.4, 1.0), 10.0 ** dice.uniform(-2.0, -0.7)
    spectrum = Spectrum(hurst=hurst, waves=waves, rms_slope=slope, seed=int(dice.integers(2**31)))
    surface = synthesise(spectrum, grid=(4 * cells, 4 * cells), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=periodic, tolerance=1e-6)

    def through(gap):
        return [
            gap_flow(gap, (1.0, 1.0), axis=axis, periodic=periodic).transmissivity
            for axis in (0, 1)
        ]

    rows = []
    for share in dice.uniform(0.02, 0.6, 2):
        found = []
        for count in (cells // 4, cells // 2, cells, 4 * cells):
            state = model.resampled((count, count)).solve_force(0.5 * share * slope * MODULUS)
            found.append(through(state.open_gap))
            if count == cells:
                area = state.contact_area_fraction
                wider = through(widened_gap(state.open_gap, periodic=periodic))
        quarter, half, own, true = np.array(found)
        stated = error_of_grid(own, half, quarter, wider)
        rows += zip([area] * 2, own, half, stated, np.abs(own - true), true, strict=True)
    return np.array(rows)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=100)
    given = parser.parse_args()
    table = np.concatenate([flows(seed) for seed in range(given.first, given.last)])
    print(
        "contact area | flows | closed | true ≤ stated | true ≤ 1.5 × stated | by half alone | "
        "stated over true | stated over flow, median"
    )
    for low, high in (*pairwise(AREAS), (0.0, 1.0)):
        area, own, half, stated, off, true = table.T
        here = (area >= low) & (area < high)
        some = here & (own > 0.0) & (off > 0.0)
        print(
            f"{low:.2f} to {high:.2f} | {here.sum()} | {(here & (own == 0.0)).sum()}"
            f" | {np.mean((off <= stated)[here]):.3f} | {np.mean((off <= 1.5 * stated)[here]):.3f}"
            f" | {np.mean((off <= 1.5 * np.abs(own - half))[here]):.3f}"
            f" | {np.median(stated[some] / off[some]):.2f}"
            f" | {np.median(stated[some] / own[some]):.2f}"
        )
    for area, own, half, stated, _, true in table[table[:, 4] > 1.5 * table[:, 3]]:
        print(f"missed at {area:.3f}: {own:.3g} ± {stated:.2g}, half {half:.3g}, true {true:.3g}")


if __name__ == "__main__":
    main()
