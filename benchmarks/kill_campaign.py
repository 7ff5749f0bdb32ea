"""Kills runs, sweeps, laws and comparisons at random moments, goes on with them and compares."""

import argparse
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from killed_runs import COMMANDS, SCENES, Runs, campaign, command_campaign  # noqa: E402


def main():
    """Run the campaign and print a line for every coupling."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=25, help="kills of each coupling")
    parser.add_argument("--seed", type=int, default=0)
    choice = parser.parse_args()
    os.environ["PATCHLAW_CACHE"] = "off"
    from helpers.mpi_environment import MPI_ENVIRONMENT

    runs = Runs(ROOT, MPI_ENVIRONMENT)
    for scene in SCENES:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "$ odd \x07 name"
            out.mkdir()
            worst, resumed = campaign(runs, scene, choice.kills, out, seed=choice.seed)
        print(
            f"{scene}: {choice.kills} kills, {resumed} sessions went on after a load step, "
            f"largest difference {worst:.1e}",
            flush=True,
        )
        assert worst <= 1e-10
    for command in COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            calls = command_campaign(runs, command, choice.kills, Path(folder), seed=choice.seed)
        print(f"{command}: {choice.kills} kills, {calls} calls, the same files", flush=True)


if __name__ == "__main__":
    main()
