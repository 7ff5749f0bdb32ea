"""CPU time of leaks over that of the contact solutions that they belong to, in one process.

First single maps of gaps, in both directions, with the constrictions that a stated leak has; then
the table of a law of samples. Only ratios
count, as the machine may do other things. Run from the project's root; it takes two minutes:

    .venv/bin/python benchmarks/leak_cost.py
"""

import time

from patchlaw.geometry import Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flows
from patchlaw.multiscale import representative_law

MODULUS = 1000.0


def least(function, repeats=3):
    """Return the least CPU time of some calls [s], and what the last returned."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        found = function()
        spent.append(time.process_time() - began)
    return min(spent), found


def sample(cells, **waves):
    spectrum = Spectrum(hurst=0.8, rms_slope=0.1, seed=3, **waves)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def stated(gap):
    """Return the shares of the flow through the constrictions along both axes."""
    return [flow.constriction.share for flow in gap_flows(gap, (1.0, 1.0), periodic=True)]


def main():
    print(
        "cells | contact area | contact [s] | flows along x and y [s] | constrictions [s] | ratio"
    )
    for cells in (64, 128, 256, 512):
        model = HalfSpaceModel(
            sample(cells, waves=(2, cells // 6)), contact_modulus=MODULUS, periodic=True
        )
        for pressure in (1.0, 10.0):
            contact, state = least(lambda m=model, p=pressure: m.solve_force(p))
            gap = state.open_gap
            flows, _ = least(lambda g=gap: gap_flows(g, (1.0, 1.0), periodic=True))
            both, _ = least(lambda g=gap: stated(g))
            area = state.contact_area_fraction
            print(
                f"{cells}² | {area:.3f} | {contact:.3f} | {flows:.3f} | {both - flows:.3f}"
                f" | {both / contact:.1f}"
            )
    print("\nlaw of a sample up to a pressure | law [s] | its leak [s] | rows | ratio")
    for cells in (64, 128):
        for waves in ({"waves": (2, cells // 6)}, {"waves_x": (2, cells // 6), "waves_y": (0, 3)}):
            rough = [sample(cells, **waves)]
            for largest in (1.0, 5.0, 20.0):
                given = {"contact_modulus": MODULUS, "largest_pressure": largest}
                alone, _ = least(lambda r=rough, g=given: representative_law(r, **g), 2)
                both, law = least(lambda r=rough, g=given: representative_law(r, **g, leak=True), 2)
                rows = len(law.transmissivity.separation)
                lay = "isotropic" if "waves" in waves else "turned"
                print(
                    f"{lay}, {cells}², {largest:g} MPa | {alone:.2f} | {both - alone:.2f} | {rows}"
                    f" | {both / alone - 1.0:.1f}"
                )


if __name__ == "__main__":
    main()
