"""Times the paper's scene as a user runs it, and says where the time goes.

Run by hand on an idle machine: ``.venv/bin/python tests/benchmarks/paper_scene.py [repeats]``.
Prints medians over the repeats, for one process and for two MPI ranks taken in turn.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCENE = "demos/scenes/paper.toml"
ENVIRONMENT = os.environ | {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}
ENVIRONMENT.pop("PYTHONDONTWRITEBYTECODE", None)  # users import compiled modules


def run(ranks: int) -> dict[str, float]:
    """Run the scene once; return seconds by phase, the whole process included."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    with tempfile.TemporaryDirectory() as folder:
        command = [*launcher, sys.executable, "-m", "patchlaw", "run", SCENE, "--out", folder]
        start = time.perf_counter()
        subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, check=True)
        whole = time.perf_counter() - start
        facts = json.loads((Path(folder) / "provenance.json").read_text(encoding="utf-8"))
    seconds = dict(facts["seconds"])
    return seconds | {"imports, output": whole - sum(seconds.values()), "whole": whole}


def main() -> None:
    """Print one column per number of ranks."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    with tempfile.TemporaryDirectory() as ENVIRONMENT["PYTHONPYCACHEPREFIX"]:
        run(1)  # compiles them
        runs = [(run(1), run(2)) for _ in range(repeats)]
    print(f"{'phase':20s} {'1 rank':>8s} {'2 ranks':>8s}   (median of {repeats}, seconds)")
    for phase in runs[0][0]:
        medians = [statistics.median(pair[i][phase] for pair in runs) for i in (0, 1)]
        print(f"{phase:20s} {medians[0]:8.2f} {medians[1]:8.2f}")


if __name__ == "__main__":
    main()
