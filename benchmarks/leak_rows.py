"""How well every second row left out tells the error of a transmissivity between its rows.

16 periodic samples, each at 40 separations between its first closed row and first touch. Run from
the project's root; it takes two minutes:

    .venv/bin/python benchmarks/leak_rows.py
"""

import numpy as np

from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.transport import gap_flow
from patchlaw.multiscale.laws.transmissivity import sample_transmissivity


def main():
    rows = []
    for seed in range(16):
        spectrum = Spectrum(hurst=0.8, waves=(2, 10), rms_slope=0.1, seed=seed)
        surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
        model = HalfSpaceModel(surface, contact_modulus=1000.0, periodic=True, tolerance=1e-6)
        reference = model.reference_height - surface.mean_height
        table = sample_transmissivity([model], np.zeros_like)
        first, last = table.separation[[0, -1]]
        share = np.random.default_rng(seed).uniform(0.0, 1.0, 40) ** 2
        for separation in first + (last - first) * share:
            gap = model.press(Control(approach=reference - separation)).open_gap
            at = np.array([separation])
            found, changed = table.at(at)[0], table.varied("rows", at)[0]
            for axis in (0, 1):
                exact = gap_flow(gap, (1.0, 1.0), axis=axis, periodic=True).transmissivity
                error, stated = abs(found[axis] - exact), abs(changed[axis] - found[axis])
                rows.append((separation / last, exact, error, stated))
    place, exact, error, stated = np.array(rows).T
    some = exact > 0.0
    print("separation, of first touch | flows | stated ≥ true | largest true | stated, of T")
    for low, high in ((0.0, 0.15), (0.15, 0.25), (0.25, 0.4), (0.4, 1.0), (0.0, 1.0)):
        here = some & (place >= low) & (place < high)
        true, said = error[here] / exact[here], stated[here] / exact[here]
        print(
            f"{low:.2f} to {high:.2f} | {here.sum()} | {np.mean(said >= true):.3f}"
            f" | median {np.median(true):.4f}, 95 % {np.quantile(true, 0.95):.4f}, {true.max():.3f}"
            f" | median {np.median(said):.4f}"
        )


if __name__ == "__main__":
    main()
