"""What a finite body and finite slopes cost in the contact problem, as ratios of one run.

Run by hand: `.venv/bin/python benchmarks/contact_steps.py [--grids 64 128 256 512 1024]`; two
minutes on one core. Every row is four load steps up to 8 µm of Set 1 on the paper's cube, solved as
a run does, the median over repetitions in turn: half-space with the cube's free sides, the same
with its body, and with body and finite slopes; core seconds, one thread.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import time
from dataclasses import replace

import numpy as np
from json_rows import keep

from patchlaw.geometry import Control
from patchlaw.multiscale import Scene, make_setup


def scene(grid, seed):
    return Scene.from_dict(
        {
            "surface": {
                "spectrum": {"hurst": 0.95, "waves": [2, 10], "rms_slope": 0.215, "seed": seed},
                "grid": [grid, grid],
                "lengths": ["1 mm", "1 mm"],
            },
            "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15},
            "micro": {"model": "half-space"},
            "coupling": {"kind": "concurrent"},
            "load": {"approach": "8 um", "steps": 4},
        }
    )


def steps(coupling, model):
    began, solver = time.process_time(), coupling.contact_of(model)
    pressed = [solver.press(Control(approach=2e-3 * k)) for k in (1, 2, 3, 4)]
    return time.process_time() - began, sum(step.newton_iterations for step in pressed)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--grids", type=int, nargs="+", default=[64, 128, 256, 512, 1024])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", metavar="FILE", help="append the medians to it")
    choice = parser.parse_args()
    print("cells  seed  sides [s]  body/sides  slopes/sides  iterations: sides, body, slopes")
    for grid in choice.grids:
        ratios = []
        for seed in choice.seeds:
            coupling = make_setup(scene(grid, seed))
            whole = coupling.model_on_body()
            small = replace(whole, slopes=())
            models = [replace(small, body=None), small, whole]
            times = np.empty((choice.repeat, 3))
            for turn in range(choice.repeat):
                found = [steps(coupling, model) for model in models]
                times[turn] = [seconds for seconds, _ in found]
            median = np.median(times, axis=0)
            ratios.append(median[1:] / median[0])
            counts = ", ".join(str(count) for _, count in found)
            print(
                f"{grid:5d} {seed:5d} {median[0]:10.3f} {ratios[-1][0]:11.2f} "
                f"{ratios[-1][1]:13.2f}  {counts}",
                flush=True,
            )
        body, slopes = np.median(ratios, axis=0)
        print(f"{grid:5d} median               {body:9.2f} {slopes:13.2f}", flush=True)
        keep(choice.json, cells=grid, body=body, slopes=slopes)


if __name__ == "__main__":
    main()
