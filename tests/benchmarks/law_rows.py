"""What rows of patch laws cost: consistent laws against the concurrent coupling, in one run.

Run by hand: ``.venv/bin/python tests/benchmarks/law_rows.py [repeats] [--json FILE]``. Processor
time on one thread, each run from nothing, in turn; medians, and their ratios to the concurrent
coupling. Also the pressings, products of the compliance and evaluations of finite slopes of each.
"""

import argparse
import os
import sys

os.environ["OMP_NUM_THREADS"] = "1"

import statistics
import time
from collections import Counter

from json_rows import keep

from patchlaw.geometry import Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.boundary_elements.compliance_matrix import ComplianceMatrix
from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes
from patchlaw.micro.boundary_elements.grid_compliance import GridCompliance
from patchlaw.multiscale import Scene
from patchlaw.multiscale.laws.representative import representative_law
from patchlaw.multiscale.studies.configurations import Configuration
from patchlaw.multiscale.studies.measured_run import measured_run

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
CASES = {
    "concurrent": CONCURRENT,
    "consistent, 16 patches": {},
    "consistent, 256 patches": {"patches.grid": [16, 16]},
    "consistent at points of 40 × 40 × 25 elements": {"coupling.interface": "pointwise"},
    "concurrent, 64²": SMALL,
    "concurrent, 64², small slopes": {**SMALL, "micro.finite_slopes": False},
}
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
    scene = PAPER.with_(changes)
    found = measured_run(Configuration(name="timed", scene=scene))
    if found.status != "done":
        sys.exit(f"{found.status}: {found.failure}")
    return found.measured["cpu_s"]


def of_samples(samples):
    """Return the processor time of a representative law [s]."""
    start = time.process_time()
    representative_law(samples, 4092.0, largest_pressure=100.0)
    return time.process_time() - start


def main():
    """Print a line for each case."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("repeats", type=int, nargs="?", default=5)
    parser.add_argument("--json", metavar="FILE", help="append the rows to it")
    choice = parser.parse_args()
    repeats = choice.repeats
    spectrum = {"hurst": 0.8, "waves": (2, 32), "rms_slope": 0.2}
    samples = [
        synthesise(Spectrum(**spectrum, seed=seed), grid=(128, 128), lengths=(1.0, 1.0))
        for seed in (1, 2, 3)
    ]
    works = {name: (lambda changes=changes: of_scene(changes)) for name, changes in CASES.items()}
    works["representative, three samples of 128²"] = lambda: of_samples(samples)
    count_calls()
    seconds, numbers = {name: [] for name in works}, {}
    for _ in range(repeats):
        for name, work in works.items():
            counts.clear()
            seconds[name].append(work())
            numbers[name] = dict(counts)
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
