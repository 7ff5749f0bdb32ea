"""What rows of patch laws cost: consistent laws against the concurrent coupling, in one run.

Run by hand: ``.venv/bin/python benchmarks/law_rows.py [repeats] [--json FILE]``. Processor
time on one thread, each run in a process of its own, in turn; medians, and their ratios to the
concurrent coupling. What takes longer than 10 s, as points of a mesh do, is run once. Also the
pressings, products of the compliance and evaluations of finite slopes of each.
"""

import argparse
import json
import os
import subprocess
import sys

os.environ |= {"OMP_NUM_THREADS": "1", "PATCHLAW_CACHE": "off"}

import statistics
import time
from collections import Counter

from json_rows import keep

from patchlaw.geometry import Spectrum, synthesise
from patchlaw.micro import FiniteSlopes, HalfSpaceModel
from patchlaw.micro.boundary_elements.compliance_matrix import ComplianceMatrix
from patchlaw.micro.boundary_elements.grid_compliance import GridCompliance
from patchlaw.multiscale import Scene, representative_law, run

PAPER = Scene.load("demos/scenes/paper.toml").with_(
    {
        "micro.model": "half-space",
        "surface.grid": [128, 128],
        "coupling.kind": "consistent",
        "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
    }
)
CONCURRENT = {"coupling": {"kind": "concurrent"}}
SMALL = {**CONCURRENT, "surface.grid": [64, 64]}
FIRST = {
    **{"surface.grid": [32, 32], "patches.grid": [2, 2], "load.steps": 1},
    "block.cells": [12, 12, 8],
}
"""A scene that brings libraries and compiled forms."""
LONG = 10.0
"""A case that takes longer [s] is run once: its scatter is far below its ratio to the others."""
CASES = {
    "concurrent": CONCURRENT,
    "consistent, 16 patches": {},
    "consistent, 256 patches": {"patches.grid": [16, 16]},
    "consistent at points of 40 × 40 × 25 elements": {"coupling.interface": "pointwise"},
    "concurrent, 64²": SMALL,
    "concurrent, 64², small slopes": {**SMALL, "micro.finite_slopes": False},
}
SAMPLES = "representative, three samples of 128²"
COUNTED = {
    (HalfSpaceModel, "press"): "pressings",
    (GridCompliance, "displacement"): "transforms",
    (GridCompliance, "apply_compliance"): "transforms",
    (ComplianceMatrix, "displacement"): "by a matrix",
    (ComplianceMatrix, "apply_compliance"): "by a matrix",
    (FiniteSlopes, "displacement"): "slopes",
    (FiniteSlopes, "orders"): "slopes",
}
counts = Counter()


def count_calls():
    """Count the calls of all methods in `COUNTED`."""

    def counted(method, name):
        def called(*given, **more):
            counts[name] += 1
            return method(*given, **more)

        return called

    for (kind, name), label in COUNTED.items():
        setattr(kind, name, counted(getattr(kind, name), label))


def of_scene(changes):
    """Return the processor time of load steps, with laws and all that they need [s]."""
    run(PAPER.with_(changes | FIRST))
    counts.clear()
    start = time.process_time()
    run(PAPER.with_(changes))
    return time.process_time() - start


def of_samples():
    """Return the processor time of a representative law of three samples [s]."""
    spectrum = {"hurst": 0.8, "waves": (2, 32), "rms_slope": 0.2}
    samples = [
        synthesise(Spectrum(**spectrum, seed=seed), grid=(128, 128), lengths=(1.0, 1.0))
        for seed in (1, 2, 3)
    ]
    counts.clear()
    start = time.process_time()
    representative_law(samples, 4092.0, largest_pressure=100.0)
    return time.process_time() - start


def main():
    """Print a line for each case."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("repeats", type=int, nargs="?", default=5)
    parser.add_argument("--json", metavar="FILE", help="append the rows to it")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    choice = parser.parse_args()
    repeats = choice.repeats
    if choice.case:
        count_calls()
        spent = of_samples() if choice.case == SAMPLES else of_scene(CASES[choice.case])
        print(json.dumps([spent, counts]))
        return
    seconds, numbers = {name: [] for name in (*CASES, SAMPLES)}, {}
    for _ in range(repeats):
        for name in seconds:
            if max(seconds[name], default=0.0) > LONG:
                continue
            words = [sys.executable, __file__, "--case", name]
            done = subprocess.run(words, stdout=subprocess.PIPE, check=True, text=True)
            spent, numbers[name] = json.loads(done.stdout.splitlines()[-1])
            seconds[name].append(spent)
    medians = {name: statistics.median(each) for name, each in seconds.items()}
    print(f"{'':40}{'CPU s':>8}{'ratio':>8}   with a small scene before each (median of {repeats})")
    for name, median in medians.items():
        more = ", ".join(f"{number} {label}" for label, number in numbers[name].items())
        print(f"{name:40}{median:8.2f}{median / medians['concurrent']:8.2f}   {more}")
        keep(choice.json, case=name, seconds=median, counts=numbers[name])
    slopes = medians["concurrent, 64²"] / medians["concurrent, 64², small slopes"]
    print(f"finite slopes at 64²: {slopes:.2f} times as long")


if __name__ == "__main__":
    main()
