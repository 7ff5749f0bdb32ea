"""Runs that are killed at random moments and resumed, for the test and the long campaign."""

import csv
import multiprocessing
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
    "half-space alone, balanced": [
        "surface.grid=[32, 32]", "coupling.kind=analytic", "micro.model=half-space",
        "load.approach=['8 um', '3 um']", "load.tilt=free", "load.steps=12",
    ],
    "concurrent, balanced": [
        "surface.grid=[72, 72]", "coupling.kind=concurrent", "micro.model=half-space",
        "block.cells=[4, 4, 3]", "load.approach=['8 um', '3 um']", "load.tilt=free",
        "load.steps=6",
    ],
    "on the mesh": [
        "surface.grid=[48, 48]", "coupling.kind=isolated", "coupling.interface=pointwise",
        "block.cells=[6, 6, 3]", "patches.grid=[2, 2]", "load.approach=['8 um', '3 um']",
        "load.steps=6", "load.force_change=0.2",
    ],
    "condensed, laws of the block": [
        "surface.grid=[32, 32]", "coupling.kind=consistent", "micro.model=half-space",
        "coupling.table_tolerance=0.01", "block.cells=[4, 4, 3]", "patches.grid=[2, 2]",
        "load.approach=['8 um', '3 um']", "load.steps=150",
    ],
}  # fmt: skip
COMMANDS = {
    "sweep": ["--vary", "surface.spectrum.seed=0..7"],
    "laws": [],
    "compare": ["--against", "half-space"],
}
"""Commands beside ``run``, with their own words."""
TABLES = {"sweep": ("cases.csv", "history.csv"), "laws": ("laws.h5",), "compare": ()}
"""Files that a command leaves, whoever killed it before."""
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)
UNCOMPARED = {"newton_iterations", "linear_iterations", "wall_s", "reason"}


def words_of(out, scene, *more):
    """Return the words of the command line that run a scene."""
    return ["run", PAPER, "--out", str(out), *more, "--set", *SCENES[scene], *QUIET]


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


class Runs:
    """Starts runs, forked from a process that has the imports done or by mpirun, and kills them.

    Args:
        root: Folder of the project.
        environment: Variables for MPI.
    """

    def __init__(self, root, environment):
        self.root, self.environment = root, os.environ | environment
        self.forks = multiprocessing.get_context("forkserver")
        self.forks.set_forkserver_preload(
            ["patchlaw.multiscale.cli.run", "patchlaw.multiscale.runs.output.report", "scipy.fft"]
        )

    def forked(self, words, log, over, number=signal.SIGKILL):
        """Run in a forked process until `over` tells; return the exit code, None when killed.

        A signal that can be watched for stops a run after its load step, or ends it at once.
        """
        process = self.forks.Process(target=enter, args=(words, str(log), str(self.root)))
        process.start()
        while process.is_alive() and not over():
            process.join(0.005)
        if process.is_alive():
            os.kill(process.pid, number)
            process.join()
            if process.exitcode != 0:  # else it had just come to its end
                assert process.exitcode in (-number, 128 + number), log.read_text()
                return None
        return process.exitcode

    def on_two_ranks(self, words, log, over):
        """Run on two ranks until `over` tells; return the exit code, None when killed."""
        command = ["mpirun", "-n", "2", sys.executable, "-m", "patchlaw", *words]
        with log.open("wb") as file:
            process = subprocess.Popen(
                command, cwd=self.root, env=self.environment, start_new_session=True, stdout=file,
                stderr=subprocess.STDOUT,
            )  # fmt: skip
            while process.poll() is None and not over():
                time.sleep(0.01)
            if process.poll() is not None:
                return process.returncode
            while left := members(process.pid):
                for pid in left:
                    try:
                        os.kill(pid, signal.SIGKILL)
                    except ProcessLookupError:
                        pass
                time.sleep(0.01)
            process.wait()
        return None


def enter(words, log, root):
    """Run one command in this process; what it says goes to a file."""
    os.chdir(root)
    file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(file, 1)
    os.dup2(file, 2)
    from patchlaw.multiscale.cli.command_line import main
    from patchlaw.multiscale.runs.output import results_folder

    # these runs take less than the second between two writes
    results_folder.LEAST_INTERVAL = results_folder.LEAST_RATIO = 0.0
    sys.exit(main(words))


def never():
    """Let a run come to its end."""
    return False


def after(seconds, path=None):
    """Return what tells that a time is over: from now, or from the next change of a file."""
    before = stamp(path) if path else None
    until = [None if path else time.monotonic() + seconds]

    def over():
        if until[0] is None and stamp(path) not in (before, None):
            until[0] = time.monotonic() + seconds
        return until[0] is not None and time.monotonic() > until[0]

    return over


def stamp(path):
    """Return when a file was changed last, None where there is none or it is empty."""
    try:
        facts = path.stat()
    except FileNotFoundError:
        return None
    return facts.st_mtime_ns if facts.st_size else None


def tables(out):
    """Return the numbers of history.csv and patches.csv that a resumed run has to meet.

    An empty cell, of what was not measured, is NaN.
    """
    found = []
    for name in ("history.csv", "patches.csv"):
        with (out / name).open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        found.append(
            np.array([[float(r[key] or "nan") for key in r if key not in UNCOMPARED] for r in rows])
        )
    return found


def largest_difference(out, reference):
    """Return the largest difference of two runs, relative to the largest value of its column."""
    worst = 0.0
    for one, other in zip(tables(out), tables(reference), strict=True):
        assert one.shape == other.shape
        assert (np.isnan(one) == np.isnan(other)).all()
        one, other = np.nan_to_num(one), np.nan_to_num(other)
        scale = np.maximum(np.abs(other).max(axis=0), np.finfo(float).tiny)
        worst = max(worst, float((np.abs(one - other) / scale).max()))
    return worst


def campaign(runs, scene, kills, folder, *, seed, every=2):
    """Kill runs of a scene at random moments and resume them until enough were killed.

    Half of the kills come at any time, half within the load steps; every so many sessions one runs
    on two ranks.

    Returns the largest difference of all runs that came to their end from one that nobody
    disturbed, and how many sessions went on after a load step.
    """
    dice, log = random.Random(seed), folder / "log"
    began = time.monotonic()
    assert runs.forked(words_of(folder / "whole", scene), log, never) == 0, log.read_text()
    lasts = time.monotonic() - began
    worst, done, resumed, sessions, out = 0.0, 0, 0, 0, None
    while done < kills or out is not None:
        words = () if out is None else ("--resume",)
        out = out or folder / f"killed & after {done}"
        if done >= kills:
            over = never
        elif dice.random() < 0.5:
            over = after(dice.uniform(0.0, lasts))
        else:
            over = after(dice.uniform(0.0, 0.2 * lasts), out / "checkpoint.state")
        sessions += 1
        if sessions % every == 0:
            code = runs.on_two_ranks(words_of(out, scene, *words), log, over)
        else:
            code = runs.forked(words_of(out, scene, *words), log, over, dice.choice(SIGNALS))
        shown = log.read_text()
        resumed += "goes on after load step" in shown and "after load step 0" not in shown
        if code is None:
            done += 1
            continue
        assert code == 0, shown
        assert not list(out.glob("checkpoint*")), "a finished run keeps none"
        worst, out = max(worst, largest_difference(out, folder / "whole")), None
    return worst, resumed


def command_campaign(runs, command, kills, folder, *, seed):
    """Kill calls of a command at random moments and call it again until enough were killed.

    A folder without a lock and without half-written files is left by each call that came to its
    end, with the tables of one that nobody disturbed. Returns the number of calls.
    """
    dice, log = random.Random(seed), folder / "log"
    scene = "condensed, laws of the block" if command == "laws" else "half-space alone, balanced"

    def words(out):
        return [command, PAPER, "--out", str(out), *COMMANDS[command], "--set", *SCENES[scene],
                "load.steps=6", *QUIET]  # fmt: skip

    began = time.monotonic()
    assert runs.forked(words(folder / "whole"), log, never) in (0, 3), log.read_text()
    lasts, done, calls, out = time.monotonic() - began, 0, 0, None
    while done < kills or out is not None:
        out = out or folder / f"killed & after {done}"
        over = after(dice.uniform(0.0, lasts)) if done < kills else never
        calls += 1
        code = runs.forked(words(out), log, over, dice.choice(SIGNALS))
        assert not list(out.rglob(".lock")), log.read_text()
        if code is None:
            done += 1
            continue
        assert code in (0, 3), log.read_text()
        assert not list(out.rglob(".*partial*")), "half-written files"
        for name in TABLES[command]:
            assert timeless(out / name) == timeless(folder / "whole" / name), name
        out = None
    return calls


def timeless(path):
    """Return the content of a file without columns that are times."""
    if path.suffix != ".csv":
        return path.read_bytes()
    with path.open(encoding="utf-8") as file:
        return [{k: v for k, v in row.items() if k != "wall_s"} for row in csv.DictReader(file)]
