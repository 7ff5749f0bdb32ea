"""Contact area at which periodic self-affine surfaces close, and how the leak falls until then.

Ten surfaces of Hurst exponent 0.8 with 4 to 32 waves a side, on 256² and 512² cells, both ways.
The area at closing is found by bisection of the load: that of all cells in contact, and corrected
by their perimeter, as runs state it. Isotropic self-affine surfaces close at about 42 % contact
area (Dapp, Lücke, Persson & Müser 2012, doi 10.1103/PhysRevLett.108.244301). Run from the project's
root; it takes two minutes:

    .venv/bin/python benchmarks/leak_percolation.py
"""

import numpy as np

from patchlaw.geometry import Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.gap_cells import cell_network
from patchlaw.micro.transport import gap_flow

SURFACES = 10
RMS_SLOPE, MODULUS = 0.1, 1000.0
AREA = 5e-3
"""Width of the interval of contact areas in which a surface closes."""
LOADS = np.array([0.04, 0.06, 0.08, 0.10, 0.12, 0.14])
"""Mean pressures over E* times the rms slope, at 7 to 25 % contact area."""


def model(seed, cells):
    """Return the periodic half-space of a surface."""
    spectrum = Spectrum(hurst=0.8, waves=(4, 32), rms_slope=RMS_SLOPE, seed=seed)
    surface = synthesise(spectrum, grid=(512, 512), lengths=(1.0, 1.0))
    whole = HalfSpaceModel(surface, contact_modulus=MODULUS, periodic=True, tolerance=1e-5)
    return whole if cells == 512 else whole.resampled((cells, cells))


def is_open(gap):
    """Tell whether a path leads through along x, and along y."""
    return [cell_network(one**3, (1.0, 1.0), periodic=True).percolates for one in (gap, gap.T)]


def closing_areas(surface):
    """Return the counted and the perimeter-corrected contact area at closing along x and y."""
    known = {}

    def pressed(load):
        if load not in known:
            state = surface.solve_force(load * RMS_SLOPE * MODULUS)
            areas = np.mean(state.pressures > 0.0), state.contact_area_fraction
            known[load] = areas, is_open(state.open_gap)
        return known[load]

    found = []
    for axis in (0, 1):
        low, high = 0.1, 0.5
        while pressed(high)[0][0] - pressed(low)[0][0] > AREA:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if pressed(middle)[1][axis] else (low, middle)
        found.append(0.5 * np.add(pressed(low)[0], pressed(high)[0]))
    return np.array(found)


def slopes(surface):
    """Return −d ln T/d(p/(E* h')) along x and y, and the largest residual of ln T."""
    areas, logs = [], []
    for load in LOADS:
        state = surface.solve_force(load * RMS_SLOPE * MODULUS)
        areas.append(state.contact_area_fraction)
        flows = (gap_flow(state.open_gap, (1.0, 1.0), axis=k, periodic=True) for k in (0, 1))
        logs.append(np.log([flow.transmissivity for flow in flows]))
    fit = np.polyfit(LOADS, logs, 1)
    residuals = np.abs(logs - (fit[0] * LOADS[:, None] + fit[1])).max()
    return -fit[0], residuals, areas


def main():
    for cells in (256, 512):
        areas = np.array([closing_areas(model(seed, cells)) for seed in range(SURFACES)])
        for name, each in (("counted", areas[..., 0]), ("corrected", areas[..., 1])):
            means = each.mean(axis=1)  # of x and y
            print(
                f"{cells}²: closes at {each.mean():.3f} {name} contact area; of surfaces "
                f"{means.std(ddof=1):.3f}, of flows {each.std(ddof=1):.3f}, "
                f"{each.min():.3f} to {each.max():.3f}",
                flush=True,
            )
    found = [slopes(model(seed, 256)) for seed in range(SURFACES)]
    each = np.array([one for one, _, _ in found])
    first, last = np.mean([[one[0], one[-1]] for _, _, one in found], axis=0)
    print(
        f"from {first:.2f} to {last:.2f} contact area ln T falls by {each.mean():.1f} ± "
        f"{each.std(ddof=1):.1f} p/(E* h'); straight to {max(r for _, r, _ in found):.2f} at most, "
        f"{np.mean([r for _, r, _ in found]):.2f} in the mean"
    )


if __name__ == "__main__":
    main()
