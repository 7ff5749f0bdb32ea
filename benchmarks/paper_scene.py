"""Times scenes as a user runs them, and says where the time goes.

Run by hand on an idle machine: ``.venv/bin/python benchmarks/paper_scene.py [repeats]``.
Prints medians over the repeats, for the paper's scene in one process and on two MPI ranks, and for
the scene of the front page, taken in turn.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from json_rows import keep

ROOT = Path(__file__).parents[1]
RUNS = {
    "paper, 1 rank": ("paper", 1),
    "paper, 2 ranks": ("paper", 2),
    "my_surface": ("my_surface", 1),
}
"""Scenes and ranks."""
ENVIRONMENT = os.environ | {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
ENVIRONMENT.pop("PYTHONDONTWRITEBYTECODE", None)  # users import compiled modules


def run(scene: str, ranks: int) -> dict[str, float]:
    """Run a scene once; return seconds by phase, the whole process included."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    words = [*launcher, sys.executable, "-m", "patchlaw", "run", f"demos/scenes/{scene}.toml"]
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        command = [*words, "--out", folder]
        subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, check=True)
        whole = time.perf_counter() - start
        facts = json.loads((Path(folder) / "provenance.json").read_text(encoding="utf-8"))
    seconds = dict(facts["seconds"])
    return seconds | {"imports": whole - sum(seconds.values()), "whole": whole}


def main() -> None:
    """Print one column per run."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("repeats", type=int, nargs="?", default=5)
    parser.add_argument("--json", metavar="FILE", help="append the medians to it")
    choice = parser.parse_args()
    with tempfile.TemporaryDirectory() as ENVIRONMENT["PYTHONPYCACHEPREFIX"]:
        run("paper", 1)  # compiles them
        runs = [{name: run(*what) for name, what in RUNS.items()} for _ in range(choice.repeats)]
    print(f"seconds, medians of {choice.repeats}")
    for name in RUNS:
        phases = runs[0][name]
        medians = {each: statistics.median(one[name][each] for one in runs) for each in phases}
        print(f"{name:15s}", ", ".join(f"{each} {value:.2f}" for each, value in medians.items()))
        keep(choice.json, run=name, **medians)


if __name__ == "__main__":
    main()
