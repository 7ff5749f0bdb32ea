"""Cyclic loads of many load steps: time and memory per step, what is written, and the end of it.

Run by hand on an idle machine: ``.venv/bin/python benchmarks/long_runs.py [--steps N]
[--scene NAME]``. Load steps with their checkpoints, as ``patchlaw run`` makes them; then the
results. The micro seconds of a step are medians over the tenth of the steps before each number.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import gc
import statistics
import tempfile
import time
from pathlib import Path

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.multiscale.runs.output.results_folder import CheckpointWriter, FolderLock

SCENES = {
    "summits": {"coupling": {"kind": "analytic"}, "micro": {"model": "elliptic"}},
    "half-space": {"coupling": {"kind": "analytic"}},
    "hardness": {"coupling": {"kind": "analytic"}, "micro": {"hardness": 300.0}},
    "concurrent": {"coupling": {"kind": "concurrent"}},
    "laws": {"coupling": {"kind": "consistent"}},
    "laws at points": {
        "coupling": {"kind": "isolated", "interface": "pointwise"},
        "block": {"cells": [6, 6, 4]},
        "micro": {"model": "circular"},
    },
}


def scene(name: str, steps: int) -> Scene:
    """Return a scene of 32² heights whose load goes up and down, 8 steps a way."""
    data = {
        "surface": {
            "spectrum": {"hurst": 0.9, "waves": [2, 6], "rms_slope": 0.1, "seed": 2},
            "grid": [32, 32],
            "lengths": [1.0, 1.0],
        },
        "load": {"approach": [4e-3, 2e-3], "steps": 8, "cycles": -(-steps // 16)},
        "output": {"check": "none"},
    }
    for section, keys in SCENES[name].items():
        data[section] = data.get(section, {}) | keys
    block = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
    data["block"] = block | data.get("block", {})
    return Scene.from_dict(data)


def counted(what: str) -> float:
    """Return what Linux counts of this process [B]."""
    name, key, unit = {"resident": ("status", "VmRSS:", 1024), "written": ("io", "wchar:", 1)}[what]
    text = Path(f"/proc/self/{name}").read_text(encoding="utf-8")
    return float(unit * int(text.split(key)[1].split()[0]))


def run(name: str, steps: int) -> None:
    """Run one scene and print its rows."""
    print(f"\n{name}\n{'step':>8}{'µs a step':>12}{'resident MB':>13}{'written kB':>12}")
    with tempfile.TemporaryDirectory() as folder:
        whole, lock = Run(scene(name, steps)), FolderLock(Path(folder) / "out")
        taken, shown = [], {10**k for k in range(2, 7)} | {steps}
        before = counted("written")
        with CheckpointWriter(Path(folder) / "out", whole, lock.hold) as checkpoints:
            checkpoints.accept()
            _ = whole.coupling.model
            began = time.perf_counter()
            for step in whole.load_steps():
                checkpoints.accept()
                now = time.perf_counter()
                taken.append(now - began)
                if step.step in shown:
                    each = 1e6 * statistics.median(taken[-max(1, len(taken) // 10) :])
                    gc.collect()
                    memory, written = counted("resident") / 1e6, counted("written") - before
                    print(f"{step.step:8}{each:12.0f}{memory:13.1f}{written / 1e3:12.0f}")
                began = time.perf_counter()
                if step.step == steps:
                    break
            checkpoints.finish()
            kept = checkpoints.path.stat().st_size
            began = time.perf_counter()
            write_results(checkpoints.path.parent, whole, options=[])
            spent = time.perf_counter() - began
            sizes = {
                path.name: path.stat().st_size for path in checkpoints.path.parent.glob("[!.]*")
            }
        lock.release()
    largest = ", ".join(f"{file} {size / 1e6:.1f} MB" for file, size in sizes.items() if size > 1e5)
    print(f"results in {spent:.1f} s, {counted('resident') / 1e6:.0f} MB resident: {largest}")
    print(f"checkpoint {kept / steps:.0f} bytes a step")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--scene", action="append", choices=SCENES)
    choice = parser.parse_args()
    for name in choice.scene or SCENES:
        run(name, choice.steps)


if __name__ == "__main__":
    main()
