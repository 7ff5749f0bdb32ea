"""Products and times of one contact whose surface has waves down to a few cells, in one run.

Run by hand: ``.venv/bin/python benchmarks/contacts_at_the_limit.py [--grids 512 1024 2048]``;
with the default grids ten minutes on an idle machine. Every row is one solution from nothing to a
residual of 1e-6, under the force at which about 10 % of the area touch (``--area``: 2, 10, 34 or
90 %): with the inverse that continues displacements by zeros, with the one that extends them, and
with this one and free sides, on one thread, and with two. Processes take turns; times are medians.
Products are those of the finest grid; the seconds of all threads include the coarser grids. Those
of the main thread, which does what is serial and its part of the rest, tell on a busy machine what
two threads gain at most. The approach on one thread and on two, and with both inverses, is compared
too.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
LOADS = {2: 9.1e-4, 10: 4.7e-3, 34: 1.7e-2, 90: 0.1}
"""Mean pressure over E* by the share of contact that it makes, roughly, at an rms slope of 0.1."""
WAYS = {
    "zeros": (1, False, False),
    "extended": (1, True, False),
    "2 threads": (2, True, False),
    "and sides": (1, True, True),
}
"""Threads, whether displacements are extended, and whether sides are free."""


def solve(grid, shortest, periodic, load, extended, sides):
    """Solve one contact; return what it took."""
    sys.path.insert(0, str(ROOT))
    from patchlaw.geometry import Control, Spectrum, Surface, synthesise
    from patchlaw.micro import FreeSides, HalfSpaceModel
    from patchlaw.micro.boundary_elements import half_space_grid

    if not extended:
        half_space_grid._MANY = 10**12
    spectrum = Spectrum(hurst=0.8, waves=(4, grid // shortest), rms_slope=0.1, seed=1)
    heights = synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0)).heights
    surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=periodic)
    _ = surface.highest
    free = FreeSides(lengths=(1.0, 1.0), poisson_ratio=0.3, decay_length=0.5) if sides else None
    model = HalfSpaceModel(
        surface=surface, contact_modulus=1.0, periodic=periodic, tolerance=1e-6, sides=free
    )
    began, core, main = time.perf_counter(), time.process_time(), time.thread_time()
    found = model.press(Control(force=load))
    return {
        "wall": time.perf_counter() - began,
        "core": time.process_time() - core,
        "main": time.thread_time() - main,
        "products": found.iterations,
        "approach": found.plane.approach,
        "area": float(np.count_nonzero(found.pressures) / heights.size),
    }


def process(way, **task):
    """Solve in a process of its own."""
    threads, extended, sides = WAYS[way]
    words = json.dumps({**task, "extended": extended, "sides": sides})
    found = subprocess.run(
        [sys.executable, __file__, "--task", words],
        env=os.environ | {"OMP_NUM_THREADS": str(threads)},
        check=True,
        capture_output=True,
        text=True,
    )
    return json.loads(found.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grids", type=int, nargs="+", default=[512, 1024, 2048])
    parser.add_argument("--shortest", type=int, nargs="+", default=[4, 8], help="wave in cells")
    parser.add_argument("--area", type=int, choices=LOADS, default=10, help="%% of contact")
    parser.add_argument("--boundaries", nargs="+", default=["free", "periodic"])
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--task", help=argparse.SUPPRESS)
    choice = parser.parse_args()
    if choice.task:
        print(json.dumps(solve(**json.loads(choice.task))))
        return
    for grid in choice.grids:
        for shortest in choice.shortest:
            for boundary in choice.boundaries:
                task = {"grid": grid, "shortest": shortest, "load": LOADS[choice.area]}
                task["periodic"] = boundary == "periodic"
                ways = [way for way in choice.ways if boundary == "free" or way != "and sides"]
                runs = {way: [] for way in ways}
                for _ in range(choice.repeats):
                    for way in ways:
                        runs[way].append(process(way, **task))
                show(f"{grid}², waves from {shortest} cells, {boundary}", runs)


def show(name, runs):
    """Print the medians of one contact."""
    first = next(iter(runs.values()))
    print(f"{name}: {first[0]['area']:.1%} in contact")
    core = np.median([run["core"] for run in first])
    for way, found in runs.items():
        kinds = ("wall", "core", "main")
        wall, own, main = (np.median([run[what] for run in found]) for what in kinds)
        off = abs(found[0]["approach"] / first[0]["approach"] - 1.0)
        print(
            f"  {way:10s} {found[0]['products']:4d} products {own:8.2f} core s "
            f"({own / core:.2f} x), main {main:.2f} ({main / core:.2f} x), {wall:.2f} s, "
            f"approach differs by {off:.0e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
