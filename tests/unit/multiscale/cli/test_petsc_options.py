"""PETSc options behind ``--``, in processes of their own: PETSc takes options once."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

from patchlaw.multiscale.cli import main

PAPER = str(Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml")
SMALL = [
    "surface.grid=[24, 24]", "patches.grid=[2, 2]", "block.cells=[4, 4, 3]", "load.steps=2",
    "coupling.interface=pointwise",
    "output.figures=false", "output.report=false", "output.check=none",
]  # fmt: skip


@pytest.fixture
def patchlaw(root, tmp_path):
    def run(*options, environment=None, settings=()):
        words = ["run", PAPER, "--out", tmp_path, "--set", *SMALL, *settings, "--", *options]
        return subprocess.run(
            [sys.executable, "-m", "patchlaw", *map(str, words)], cwd=root,
            env={**os.environ, **(environment or {})}, capture_output=True, text=True, check=False,
        )  # fmt: skip

    return run


def iterations(folder):
    """Return the linear iterations of all load steps."""
    with (folder / "history.csv").open(encoding="utf-8") as file:
        return [int(row["linear_iterations"]) for row in csv.DictReader(file)]


@pytest.mark.slow
def test_options_reach_the_solver_from_dashes_and_environment(patchlaw, tmp_path):
    """A misspelt one is named, and a log of PETSc is printed."""
    assert main(["run", PAPER, "--out", str(tmp_path / "plain"), "--set", *SMALL]) == 0
    iterated = [iterations(tmp_path / "plain")]
    for options, variable in (
        ((), "-patchlaw_ksp_rtol 1e-12"),
        (("-ksp_rtol", "1e-12", "-log_view", "-snes_monitor", "-ksp_tpye", "cg"), ""),
    ):
        done = patchlaw(*options, environment={"PETSC_OPTIONS": variable})
        assert done.returncode == 0, done.stderr
        iterated.append(iterations(tmp_path))
    loose, environment, dashes = iterated
    assert environment == dashes
    assert dashes[0] > 1.5 * loose[0], (dashes, loose)
    assert "SNES Function norm" in done.stdout
    assert "unused database option" in done.stdout  # the misspelt one, at the end
    assert "-patchlaw_ksp_tpye" in done.stdout
    assert {"MatMult", "KSPSolve", "PCApply"} <= set(done.stdout.split())


@pytest.mark.long
def test_impossible_option_is_wrong_input_and_leaves_nothing(patchlaw, tmp_path):
    done = patchlaw("-pc_type", "foo")
    assert done.returncode == 2
    assert not list(tmp_path.iterdir())  # though laws were made, and a checkpoint written
    assert "patchlaw: command line: PETSc refuses the solver's options" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("name", [pytest.param("missing", marks=pytest.mark.long), "options"])
def test_file_of_options_that_is_missing_or_makes_no_sense_is_wrong_input(patchlaw, tmp_path, name):
    (tmp_path / "options").write_text("no option\n", encoding="utf-8")
    done = patchlaw("-options_file", tmp_path / name)
    assert done.returncode == 2
    assert f"{name}': PETSc does not start with these options" in done.stderr
    assert "Traceback" not in done.stderr
