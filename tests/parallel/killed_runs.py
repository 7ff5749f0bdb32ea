"""Runs that are killed at random moments and resumed, for the test and the long campaign."""

import csv
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

PAPER = "demos/scenes/paper.toml"
QUIET = ["output.figures=false", "output.report=false"]
# small, with steps of a few milliseconds: most of the time a run is between two of them, or in one
SCENES = {
    "concurrent, balanced": [
        "surface.grid=[72, 72]", "coupling.kind=concurrent", "micro.model=half-space",
        "block.cells=[4, 4, 3]", "load.approach=['8 um', '3 um']", "load.tilt=free",
        "load.steps=25",
    ],
    "on the mesh": [
        "surface.grid=[48, 48]", "coupling.kind=isolated", "coupling.newton=full",
        "block.cells=[8, 8, 4]", "patches.grid=[2, 2]", "load.approach=['8 um', '3 um']",
        "load.steps=25", "load.force_change=0.05",
    ],
    "condensed, laws of the block": [
        "surface.grid=[48, 48]", "coupling.kind=consistent", "micro.model=half-space",
        "block.cells=[4, 4, 3]", "load.approach=['8 um', '3 um']", "load.steps=400",
    ],
    "half-space alone, balanced": [
        "surface.grid=[48, 48]", "coupling.kind=analytic", "micro.model=half-space",
        "load.approach=['8 um', '3 um']", "load.tilt=free", "load.steps=50",
    ],
}  # fmt: skip
UNCOMPARED = {"newton_iterations", "linear_iterations", "wall_s", "reason"}


def command(ranks, out, scene, *words):
    """Return the words that run a scene on some ranks."""
    run = [sys.executable, "-m", "multiscale", "run", PAPER, "--out", str(out), *words]
    mpi = [] if ranks == 1 else ["mpirun", "-n", str(ranks)]
    return [*mpi, *run, "--set", *SCENES[scene], *QUIET]


def members(session):
    """Return the processes of a session, zombies left out."""
    found = []
    for path in Path("/proc").iterdir():
        if path.name.isdigit():
            try:
                _, _, rest = (path / "stat").read_text().rpartition(") ")
            except OSError:
                continue
            state, _, _, sid, *_ = rest.split()
            if int(sid) == session and state != "Z":
                found.append(int(path.name))
    return found


def killed_after(seconds, words, **how):
    """Start a command, kill all of it after a time; return its exit code if it was faster."""
    process = subprocess.Popen(
        words, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **how
    )
    try:
        shown, _ = process.communicate(timeout=seconds)
        return process.returncode, shown.decode()
    except subprocess.TimeoutExpired:
        while left := members(process.pid):
            for pid in left:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
            time.sleep(0.01)
        process.communicate()
        return None, ""


def tables(out):
    """Return the numbers of history.csv and patches.csv that a resumed run has to meet."""
    found = []
    for name in ("history.csv", "patches.csv"):
        with (out / name).open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        found.append(np.array([[float(r[key]) for key in r if key not in UNCOMPARED] for r in rows]))
    return found


def largest_difference(out, reference):
    """Return the largest difference of two runs, relative to the largest value of its column."""
    worst = 0.0
    for one, other in zip(tables(out), tables(reference), strict=True):
        assert one.shape == other.shape
        scale = np.maximum(np.abs(other).max(axis=0), np.finfo(float).tiny)
        worst = max(worst, float((np.abs(one - other) / scale).max()))
    return worst


def campaign(scene, kills, folder, *, seed, environment, root):
    """Kill runs of a scene at random moments and resume them until enough were killed.

    Returns the largest differences of all runs that came to their end from one that nobody
    disturbed, and how many load steps were kept over the kills.
    """
    how = {"cwd": root, "env": os.environ | environment}
    dice = random.Random(seed)
    whole = folder / "whole"
    began = time.monotonic()
    code, shown = killed_after(600.0, command(1, whole, scene), **how)
    lasts = time.monotonic() - began
    assert code == 0, shown
    worst, done, resumed, out = 0.0, 0, 0, None
    while done < kills or out is not None:
        ranks = dice.choice((1, 2))
        words = () if out is None else ("--resume",)
        out = out or folder / f"killed_after_{done}"
        seconds = 600.0 if done >= kills else dice.uniform(0.3 * lasts, 1.3 * lasts)
        code, shown = killed_after(seconds, command(ranks, out, scene, *words), **how)
        resumed += "goes on after load step" in shown
        if code is None:
            done += 1
            continue
        assert code == 0, shown
        assert not list(out.glob("checkpoint*")), "a finished run keeps none"
        worst, out = max(worst, largest_difference(out, whole)), None
    return worst, resumed
