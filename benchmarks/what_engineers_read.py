"""Cost of what engineers read off, relative to the elastic contact without it.

A surface of 256² cells is pressed in eight steps: elastically, under a hardness that a few per cent
of the contacts bear and under one that most bear; with the stiffness of every step; with its
conductance. Run from the project's root:

    .venv/bin/python benchmarks/what_engineers_read.py
"""

import argparse
import time

import numpy as np

from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel

MODULUS, APPROACHES = 4000.0, np.linspace(1e-3, 8e-3, 8)


def steps(surface, hardness, also):
    """Return CPU time [s], products of the compliance, those of `also`, and the yielding share."""
    model = HalfSpaceModel(surface, contact_modulus=MODULUS, hardness=hardness, tolerance=1e-10)
    model.press(Control(approach=1e-3))  # makes transforms
    began, start, products, more = time.process_time(), None, 0, 0
    for approach in APPROACHES:
        state = model.press(Control(approach=float(approach)), start=start)
        start = state.start
        products += state.iterations
        if also == "stiffness":
            more += model.stiffness(state, turns=False).iterations
        elif also == "conductance":
            model.unloading_stiffness(state)
    yields = np.count_nonzero(state.yielding) / max(np.count_nonzero(state.in_contact), 1)
    return time.process_time() - began, products, more, yields


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cells", type=int, default=256)
    parser.add_argument("--seeds", type=int, nargs="*", default=[1, 2, 3])
    parser.add_argument("--repeats", type=int, default=3)
    choice = parser.parse_args()
    cases = {
        "elastic": (None, ""),
        "hardness 600 MPa": (600.0, ""),
        "hardness 300 MPa": (300.0, ""),
        "hardness 100 MPa": (100.0, ""),
        "stiffness": (None, "stiffness"),
        "conductance": (None, "conductance"),
    }
    print("seed  case                CPU [s]   ratio   products  further  yielding of contact")
    for seed in choice.seeds:
        spectrum = Spectrum(hurst=0.8, waves=(2, 24), rms_slope=0.2, seed=seed)
        surface = synthesise(spectrum, grid=(choice.cells,) * 2, lengths=(1.0, 1.0))
        base = None
        for name, case in cases.items():
            found = [steps(surface, *case) for _ in range(choice.repeats)]
            seconds, products, more, yields = min(found)
            base = seconds if base is None else base
            print(
                f"{seed:4d}  {name:18s} {seconds:8.3f} {seconds / base:7.2f} {products:9d} "
                f"{more:8d} {100 * yields:8.1f} %"
            )


if __name__ == "__main__":
    main()
