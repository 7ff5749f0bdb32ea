"""Compares what `patchlaw plan` predicts with what `patchlaw run` takes; see ``--help``.

Every scene is planned and then run, each in a process of its own. Time is the sum of the phases
that a run prints, memory the largest of rank 0. ``--busy`` keeps one core busy meanwhile.
"""

import argparse
import contextlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from box_msh import write_box
from plan_scenes import SCENES

PATCHLAW = [sys.executable, "-m", "multiscale"]
_LOOP = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: pass"
"""Keeps a core busy as long as this program runs, however it ends."""
_UNITS = {"h": 3600.0, "min": 60.0, "s": 1.0}


def seconds(text):
    """Return a duration as `multiscale.readable.duration` writes it [s]."""
    return sum(float(number) * _UNITS[unit] for number, unit in text)


def said(beginning, output):
    """Return seconds and megabytes of the line that begins so, and the line."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", output)
    line = next(line for line in plain.splitlines() if line.startswith(beginning))
    times = re.findall(r"([\d.e+]+) (h|min|s)\b", re.split(r"[:(]", line)[0])
    return seconds(times), float(re.findall(r"([\d.e+]+) MB", line)[-1]), line


def launched(words, ranks, threads):
    """Run a command of patchlaw; return what it prints."""
    environment = os.environ | {"OMP_NUM_THREADS": str(threads), "COLUMNS": "1000"}
    start = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    done = subprocess.run(
        [*start, *PATCHLAW, *words], env=environment, capture_output=True, text=True, timeout=600
    )
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stdout}{done.stderr}")
    return done.stdout


@contextlib.contextmanager
def busy_core(wanted):
    """Keep one core busy meanwhile, if wanted."""
    loop = subprocess.Popen([sys.executable, "-c", _LOOP]) if wanted else None
    try:
        yield
    finally:
        if loop is not None:
            loop.kill()
            loop.wait()


def compared(name, folder, verbose):
    """Plan and run one scene; return predicted and taken seconds, predicted and taken MB."""
    text, ranks, threads = SCENES[name]
    path = folder / f"{name}.toml"
    path.write_text(text.format(folder=folder))
    scene = str(path)
    planned, mb_planned, line = said("cost", launched(["plan", scene], ranks, threads))
    words = ["run", scene, "--overwrite", "--out", str(folder / name)]
    taken, mb_taken, took = said("took", launched(words, ranks, threads))
    shutil.rmtree(folder / name)
    if verbose:
        print(f"  {' '.join(line.split())}\n  {' '.join(took.split())}")
    return planned, taken, mb_planned, mb_taken


def main():
    """Print a line for each scene, and the share of predictions within a factor of 2."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(SCENES)}; by default all")
    parser.add_argument("--busy", action="store_true", help="keep one core busy meanwhile")
    parser.add_argument("--part", default="1/1", help="k/n: the k-th of n parts of the scenes")
    parser.add_argument("--verbose", action="store_true", help="the phases, too")
    choice = parser.parse_args()
    part, parts = map(int, choice.part.split("/"))
    names = choice.scenes or list(SCENES)[part - 1 :: parts]
    ratios = []
    print("scene                         planned     took  ratio  |  planned MB   took  ratio")
    with tempfile.TemporaryDirectory() as made, busy_core(choice.busy):
        folder = Path(made)
        write_box(folder / "box.msh", [np.linspace(0.0, 1.0, n + 1) for n in (16, 16, 12)])
        for name in names:
            time, took, memory, peak = compared(name, folder, choice.verbose)
            ratios.append((time / took, memory / peak))
            print(
                f"{name:28} {time:8.2f} {took:8.2f} {time / took:6.2f}  |    {memory:8.0f} "
                f"{peak:6.0f} {memory / peak:6.2f}",
                flush=True,
            )
    within = (np.abs(np.log(ratios)) <= np.log(2.0)).mean(axis=0)
    print(
        f"{len(names)} scenes; within a factor of 2: time {within[0]:.0%}, memory {within[1]:.0%}"
    )


if __name__ == "__main__":
    main()
