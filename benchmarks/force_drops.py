"""Force along the approach on 70 random surfaces: does it ever drop where contacts merge?

Run by hand, about three minutes: python benchmarks/force_drops.py [number of surfaces]

For every model it prints on how many surfaces of the paper's Set 1 the force falls anywhere
between first touch and an approach of 26 µm, in steps of 0.25 µm, the largest fall relative to
the force, the contact area fraction there, and the time per approach.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.along import respond

from patchlaw.geometry import PatchGrid, Spectrum, find_asperities, synthesise
from patchlaw.micro import MODELS, AsperityModel

APPROACHES = np.arange(1, 105) * 0.25e-3
PATCHES = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def models(seed):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    surface = synthesise(spectrum, grid=(128, 128), lengths=(1.0, 1.0))
    asperities = find_asperities(surface)
    for kind in MODELS:
        yield kind, AsperityModel(kind, asperities, contact_modulus=4000.0)


def study(surfaces):
    found = {}
    for seed in range(surfaces):
        for name, model in models(seed):
            start = time.perf_counter()
            response = respond(model, APPROACHES, patches=PATCHES, mean_heights=[0.0])
            spent = (time.perf_counter() - start) / len(APPROACHES)
            fall = -np.diff(response.force) / np.maximum(response.force[1:], 1e-12)
            worst = int(np.argmax(fall))
            row = (fall[worst], response.contact_area_fraction[worst + 1], spent)
            found.setdefault(name, []).append(row)
    return {name: np.array(rows) for name, rows in found.items()}


def main():
    surfaces = int(sys.argv[1]) if len(sys.argv) > 1 else 70
    print(f"{'model':22} {'falls on':>9} {'worst fall':>11} {'at area':>8} {'ms/step':>8}")
    for name, rows in study(surfaces).items():
        falls, worst = rows[:, 0] > 0.0, int(np.argmax(rows[:, 0]))
        fall, area = (f"{x:.2%}" if falls.any() else "none" for x in rows[worst, :2])
        print(f"{name:22} {falls.sum():9d} {fall:>11} {area:>8} {1e3 * rows[:, 2].mean():8.2f}")


if __name__ == "__main__":
    main()
