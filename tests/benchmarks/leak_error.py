"""How well half the cells tell the error of a leak, against grids two and four times as fine.

12 periodic surfaces with up to 10 waves a side, on 80² and 160² cells, under 6 loads. The true leak
is that on 320² cells, for 160² extrapolated as if errors fell by 3 from grid to grid. Run from the
project's root; it takes ten minutes:

    .venv/bin/python tests/benchmarks/leak_error.py
"""

from itertools import pairwise

import numpy as np

from geometry.spectrum import Spectrum, synthesise
from micro import HalfSpaceModel
from micro.flow.gap_flow import gap_flow

LOADS = (1e-3, 5e-3, 1e-2, 1.5e-2, 1.8e-2, 2.1e-2)
"""Mean pressures over the contact modulus."""
AREAS = (0.0, 0.05, 0.15, 0.25, 0.35, 0.6)
"""Borders of the contact area fraction between rows of the table."""
GRIDS = (40, 80, 160, 320)


def transmissivities(model, load):
    """Return T along x and y on all grids, and the contact area on the finest."""
    found = []
    for cells in GRIDS:
        state = model.resampled((cells, cells)).solve_force(load * model.contact_modulus)
        flows = (gap_flow(state.open_gap, (1.0, 1.0), axis=axis, periodic=True) for axis in (0, 1))
        found.append([flow.transmissivity for flow in flows])
    return np.array(found), state.contact_area_fraction


def main():
    rows = []
    for seed in range(12):
        spectrum = Spectrum(hurst=0.8, waves=(2, 10), rms_slope=0.1, seed=seed)
        surface = synthesise(spectrum, grid=(320, 320), lengths=(1.0, 1.0))
        model = HalfSpaceModel(surface, contact_modulus=1000.0, periodic=True, tolerance=1e-6)
        for load in LOADS:
            (coarse, fine, finer, finest), area = transmissivities(model, load)
            limit = finest + (finest - finer) / 2.0
            for cells, one, half, true in ((80, fine, coarse, finest), (160, finer, fine, limit)):
                for k in (0, 1):
                    error, exact = abs(one[k] - half[k]), abs(one[k] - true[k])
                    rows.append((cells, area, one[k], error, exact))
    table = np.array(rows)
    print("cells | contact area | flows | no less than true | than half of it | over true | of T")
    for cells in (80, 160):
        for low, high in (*pairwise(AREAS), (0.0, 1.0)):
            inside = (table[:, 0] == cells) & (table[:, 1] >= low) & (table[:, 1] < high)
            _, _, leak, error, exact = table[inside].T
            flows = leak > 0.0
            print(
                f"{cells}² | {low:.2f} to {high:.2f} | {len(leak)}, {flows.sum()} open"
                f" | {np.mean(error >= exact):.2f} | {np.mean(2.0 * error >= exact):.2f}"
                f" | {np.median(error[flows] / exact[flows]):.2f}"
                f" | {np.median(error[flows] / leak[flows]):.3f}"
            )


if __name__ == "__main__":
    main()
