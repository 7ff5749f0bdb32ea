"""How well grids half and a quarter as fine tell the error of a leak, against one four times finer.

28 surfaces, periodic or not, of 32² to 48² cells, 5 to 16 of them along the shortest wave, under 3
loads each. The true leak is that on four times as many cells a side, extrapolated as if errors fell
by 3 from grid to grid. Run from the project's root; it takes five minutes:

    .venv/bin/python benchmarks/leak_error.py
"""

from itertools import pairwise

import numpy as np

from patchlaw.geometry.spectrum import Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flow
from patchlaw.multiscale.laws.transmissivity import error_of_grid

AREAS = (0.0, 0.05, 0.15, 0.25, 0.35, 1.0)
"""Borders of the contact area fraction between rows of the table."""


def flows(seed):
    """Return rows of contact area, T, T on half of the cells, stated and true error."""
    dice = np.random.default_rng(seed)
    cells, periodic = int(dice.choice([32, 40, 48])), bool(dice.random() < 0.5)
    low = dice.uniform(1, 2)
    waves = low, dice.uniform(max(low + 1, cells / 16), cells / 5)
    hurst, slope = dice.uniform(0.4, 1.0), dice.uniform(0.03, 0.2)
    spectrum = Spectrum(
        hurst=hurst, waves=waves, rms_slope=slope, seed=int(dice.integers(1_000_000))
    )
    surface = synthesise(spectrum, grid=(4 * cells, 4 * cells), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface, contact_modulus=1000.0, periodic=periodic, tolerance=1e-6)
    rows = []
    for load in np.sort(10.0 ** dice.uniform(-3, -1.5, 3) * slope / 0.1):
        found = []
        for count in (cells // 4, cells // 2, cells, 2 * cells, 4 * cells):
            state = model.resampled((count, count)).solve_force(load * 1000.0)
            if count == cells:
                area = state.contact_area_fraction
            each = (
                gap_flow(state.open_gap, (1.0, 1.0), axis=axis, periodic=periodic)
                for axis in (0, 1)
            )
            found.append([flow.transmissivity for flow in each])
        quarter, half, own, finer, finest = np.array(found)
        true = finest + (finest - finer) / 2.0
        stated = error_of_grid(own, half, quarter)
        rows += zip([area] * 2, own, half, stated, np.abs(own - true), strict=True)
    return np.array(rows)


def main():
    table = np.concatenate([flows(seed) for seed in range(300, 328)])
    print("contact area | flows | true ≤ stated | true ≤ 1.5 × stated | by half alone | over true")
    for low, high in (*pairwise(AREAS), (0.0, 1.0)):
        area, own, half, stated, true = table.T
        here = (area >= low) & (area < high)
        some = here & (own > 0.0) & (true > 0.0)
        print(
            f"{low:.2f} to {high:.2f} | {here.sum()} | {np.mean((true <= stated)[here]):.3f}"
            f" | {np.mean((true <= 1.5 * stated)[here]):.3f}"
            f" | {np.mean((true <= 1.5 * np.abs(own - half))[here]):.3f}"
            f" | {np.median(stated[some] / true[some]):.2f}"
        )


if __name__ == "__main__":
    main()
