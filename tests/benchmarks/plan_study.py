"""Does a run take what its plan predicts, and keep the accuracy that was asked for? Over 40 scenes.

Run by hand, some minutes on an idle core: `.venv/bin/python tests/benchmarks/plan_study.py
[--cpu] [--first N] [--last N]`. `--cpu` takes processor times, where other work goes on.

Truth is the concurrent coupling with the half-space model on twice as fine a grid, on a block of
24 × 24 × 16 cells that is told the forces on 32 × 32 rectangles; without a block, the half-space on
that grid. Errors are the larger of those at half the largest load and at the largest.
"""

import os
import sys
import time

if "--cpu" in sys.argv:
    time.perf_counter = time.process_time  # before anything takes the time by it

import argparse
import tempfile
from contextlib import contextmanager
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np

from geometry.patches import PatchGrid
from micro import HalfSpaceModel
from multiscale import Run, Scene
from multiscale.couplings import blocks
from multiscale.reporting.results import write_results

FACTOR = 2.0
KINDS = ("auto", "auto", "auto", "concurrent", "consistent", "isolated", "analytic", "mesh")
BANDS = ((2, 10), (1, 6), (2, 16), (3, 24), (2, 8))
SCENES = 40
FINE_CELLS, FINE_LOADS, MOST = (24, 24, 16), (32, 32), 384


def scene(number):
    """Return one scene of the study as nested dictionaries."""
    random = np.random.default_rng(31_000 + number)

    def any_of(*values):
        return values[random.integers(len(values))]

    kind = KINDS[number % len(KINDS)]
    spectrum = {
        "hurst": float(random.uniform(0.5, 1.0)),
        "waves": list(BANDS[number % len(BANDS)]),
        "rms_slope": float(random.uniform(0.08, 0.25)),
        "seed": number,
    }
    load = {"approach": float(random.uniform(4e-3, 16e-3)), "steps": any_of(2, 4, 8, 8, 16, 40)}
    if number % 7 == 3 and kind not in ("mesh", "isolated"):
        load = {"force": float(random.uniform(0.5, 5.0)), "steps": load["steps"]}
    if number % 3 == 1:
        load["tilt"] = [float(random.uniform(-3e-3, 3e-3)) for _ in range(2)]
    data = {
        "accuracy": any_of(0.01, 0.02, 0.02, 0.05, 0.1),
        "surface": {"spectrum": spectrum, "grid": "auto", "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "height": any_of(1.0, 1.0, 2.0)},
        "load": load,
    }
    if kind != "auto":
        data["coupling"] = {"kind": "consistent" if kind == "mesh" else kind}
    if number % 2:  # what is stated must be respected
        data["surface"]["grid"] = [any_of(96, 128, 192)] * 2
    if number % 4 == 2:
        data["patches"] = {"grid": [any_of(2, 4, 8, 12)] * 2}
    if kind == "mesh":
        data["coupling"]["compliance"] = "finite-element"
        data["block"]["cells"] = [24, 24, 12]
        data["patches"] = {"grid": [4, 4]}
    if number % 11 == 5:
        data["micro"] = {"model": any_of("elliptic", "islands", "elliptic-independent")}
        data["surface"]["grid"] = [128, 128]
    return data


@contextmanager
def fine_loads():
    """Let blocks be told the forces on finer rectangles."""
    ordinary = blocks.fine_loads

    def fine(stage):
        return PatchGrid(grid=FINE_LOADS, lengths=stage.patches.lengths)

    blocks.fine_loads = fine
    try:
        yield
    finally:
        blocks.fine_loads = ordinary


def truth(data, stage):
    """Return the force at half the largest load and at the largest; approaches under a force."""
    model = stage.model
    cells = model.surface.grid[0] if isinstance(model, HalfSpaceModel) else stage.surface.grid[0]
    grid = [min(max(2 * cells, 192), max(cells, MOST))] * 2
    alone = stage.scene.coupling.kind == "analytic"
    finer = {
        "surface": data["surface"] | {"grid": grid},
        "block": data["block"] | {"cells": list(FINE_CELLS)},
        "micro": {"model": "half-space"},
        "coupling": {"kind": "analytic" if alone else "concurrent"},
        "patches": {"grid": [4, 4]},
        "load": data["load"] | {"steps": 2},
    }
    with fine_loads():
        run = Run(Scene.from_dict(finer))
        return list(run.load_steps())


def error(found, true, by_force):
    """Return the larger error at half the load and at all of it.

    Forces below a twentieth of the largest count as this much. Under a prescribed force the
    approach tells the error, by Hertz' exponent.
    """
    pairs = list(zip((found[len(found) // 2 - 1], found[-1]), true, strict=True))
    if by_force:
        return max(abs((a.approach_mm / b.approach_mm) ** 1.5 - 1.0) for a, b in pairs)
    least = 0.05 * true[-1].force_N
    return max(abs(a.force_N - b.force_N) / max(b.force_N, least) for a, b in pairs)


def study(numbers, kept):
    """Run scenes; print and return rows of time predicted and real, error expected and found."""
    rows = []
    for number in numbers:
        data = scene(number)
        os.environ["PATCHLAW_CACHE"] = "off"
        with tempfile.TemporaryDirectory() as folder:
            run = Run(Scene.from_dict(data))
            made = run.forecast
            steps = list(run.load_steps())
            write_results(Path(folder), run, options=[])
        real = sum(run.seconds[phase] for phase in made.seconds)
        os.environ["PATCHLAW_CACHE"] = kept  # the truth's blocks are few
        off = error(steps, truth(data, run.stage), "force" in data["load"])
        kind, wanted = run.scene.coupling.kind, data["accuracy"]
        rows.append((made.total, real, made.error, off, wanted, kind, made.seconds, run.seconds))
        told = {k: f"{made.seconds[k]:.2f}/{run.seconds[k]:.2f}" for k in made.seconds}
        print(
            f"{number:3d} {kind:10s} {run.stage.patches.grid[0]:3d}² patches, "
            f"{run.stage.model.name:10s} {run.stage.surface.grid[0]:4d}², {len(steps):2d} steps: "
            f"{made.total:6.2f} s predicted, {real:6.2f} s ({made.total / real:4.2f}); error "
            f"{off:6.2%} of {made.error:6.2%} expected, {wanted:4.0%} wanted  {told}",
            flush=True,
        )
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--cpu", action="store_true")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=SCENES)
    parser.add_argument("--kept", default=None, help="folder of the truth's blocks")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = study(range(given.first, given.last), given.kept or folder)
    ratio = np.array([row[0] / row[1] for row in rows])
    close = (ratio <= FACTOR) & (ratio >= 1.0 / FACTOR)
    expected, found, wanted = (np.array([row[k] for row in rows]) for k in (2, 3, 4))
    promised = expected <= wanted
    print(f"{len(rows)} scenes; time within a factor of {FACTOR:g}: {close.mean():.0%}")
    kept = np.mean((found <= wanted)[promised])
    print(
        f"accuracy promised for {promised.sum()}, kept by {kept:.0%} of them; error within what "
        f"was expected: {np.mean(found <= expected):.0%} of all"
    )


if __name__ == "__main__":
    main()
