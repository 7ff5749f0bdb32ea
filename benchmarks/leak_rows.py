"""How well every second row left out tells the error of a transmissivity between its rows.

Ten periodic samples, isotropic and turned, each at 20 separations between its last row, the first
closed one or a fifth of that at first touch, and first touch. Run from the project's root; it takes
half a minute:

    .venv/bin/python benchmarks/leak_rows.py
"""

import numpy as np

from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flow
from patchlaw.multiscale.laws.transmissivity import sample_transmissivity


def main():
    rows = []
    for seed in range(9300, 9310):
        lay = {"waves": (2, 10)} if seed % 2 else {"waves_x": (2, 10), "waves_y": (0, 3)}
        spectrum = Spectrum(hurst=0.8, rms_slope=0.1, seed=seed, **lay)
        surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
        model = HalfSpaceModel(surface, contact_modulus=1000.0, periodic=True, tolerance=1e-6)
        reference = model.reference_height - surface.mean_height
        least = 0.2 * (reference - model.first_touch) if seed % 4 < 2 else 0.0
        table = sample_transmissivity([model], np.zeros_like, least=least)
        first, last = table.separation[[0, -1]]
        share = np.random.default_rng(seed).uniform(0.0, 1.0, 20) ** 2
        for separation in first + (last - first) * share:
            gap = model.press(Control(approach=reference - separation)).open_gap
            at = np.array([separation])
            found = table.at(at)[0]
            changed, coarse = (table.varied(cause, at)[0] for cause in ("rows", "grid"))
            for axis in (0, 1):
                exact = gap_flow(gap, (1.0, 1.0), axis=axis, periodic=True).transmissivity
                error, stated = abs(found[axis] - exact), abs(changed[axis] - found[axis])
                grid = abs(coarse[axis] - found[axis])
                rows.append((separation / last, exact, error, stated, grid))
    place, exact, error, stated, grid = np.array(rows).T
    some = exact > 0.0
    print("separation, of first touch | flows | stated ≥ true, with grid's | true | stated, of T")
    for low, high in ((0.0, 0.15), (0.15, 0.25), (0.25, 0.4), (0.4, 1.0), (0.0, 1.0)):
        here = some & (place >= low) & (place < high)
        true, said, both = (one[here] / exact[here] for one in (error, stated, stated + grid))
        print(
            f"{low:.2f} to {high:.2f} | {here.sum()} | {np.mean(said >= true):.3f},"
            f" {np.mean(both >= true):.3f} | median {np.median(true):.4f},"
            f" 95 % {np.quantile(true, 0.95):.4f}, {true.max():.3f}"
            f" | median {np.median(said):.4f}"
        )


if __name__ == "__main__":
    main()
