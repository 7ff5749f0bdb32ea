"""The page on a measured surface is true: its map, its commands, the numbers that it shows."""

import re
import runpy
import shlex
import shutil
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import h5py
import numpy as np
import pytest
from helpers.waiting_ranks import alone

from patchlaw.multiscale import read_history

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "my_surface.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^ *\.venv/bin/patchlaw (.*)$", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder that the page's commands can be run in, as they stand."""
    folder = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "demos" / "scenes", folder / "demos" / "scenes")
    return folder


@pytest.fixture(scope="module")
def said(place):
    """What each command of the page but the last two says, and its exit code, in their order.

    Of the scene that a command makes the page quotes no number: one load step shows that it runs.
    """
    short = " --set load.steps=1 output.figures=false output.report=false output.check=none"
    return {
        command: said_by(command + short * (command == "run results/mine.toml"), place)
        for command in COMMANDS[:-2]
    }


def said_by(command, place):
    with chdir(place):
        done = alone(["-m", "patchlaw", *shlex.split(command, comments=True)])
    return " ".join((done.stdout + done.stderr).split()), done.returncode


def test_the_map_is_what_its_script_makes():
    script = runpy.run_path(str(ROOT / "demos" / "scenes" / "ground_steel.py"))
    file = ROOT / "demos" / "scenes" / "ground_steel.txt"
    assert file.stat().st_size < 300_000
    np.testing.assert_allclose(
        np.loadtxt(file),
        script["as_measured"](),
        rtol=0.0,
        atol=0.0005 + 1e-9,  # three digits
    )


@pytest.mark.long
def test_commands_end_as_the_page_says(said):
    assert len(said) == 8
    for command, (text, code) in said.items():
        refused = "# exit code 2" in command
        assert code == (2 if refused else 0), text
        assert ("note: " in text) >= ("# a note" in command), text


@pytest.mark.long
def test_numbers_of_the_page_are_those_of_its_commands(said):
    whole, _ = said[COMMANDS[0]]
    table = re.search(r"```text\n(.*?)```", PAGE, re.DOTALL)[1].splitlines()
    for row in table[2:6]:  # the counts of iterations and the time in the last columns vary
        assert set(row.split()[:-4]) <= set(whole.split())  # cells may be broken over two lines
    for page in (PAGE, README):
        error = re.search(r"`(0\.\d+ ± 0\.\d+)`", page)[1]
        assert error in whole
    for quoted in re.findall(r"`([^`]*)`", PAGE.partition("They say ")[2].partition("## 4")[0]):
        assert any(quoted in text for text, _ in said.values()), quoted


@pytest.mark.slow
def test_the_sweep_of_the_page_finds_its_numbers_and_the_surface_without_edges_runs(place):
    (text, code), (_, other) = (said_by(command, place) for command in COMMANDS[-2:])
    assert (code, other) == (0, 0)
    approaches = re.findall(r"approach (0\.\d+) µm", text)
    least, most = f"{float(approaches[-1]):.3f}", f"{float(approaches[0]):.3f}"
    assert f"falls from {most} to {least} µm" in " ".join(PAGE.split())


@pytest.mark.long
def test_contacts_are_as_many_and_as_loaded_as_the_page_says(said, place):
    results = place / "results" / "my_surface"
    rows = (results / "contacts.csv").read_text(encoding="utf-8").splitlines()
    assert f"of the {len(rows) - 1} spots" in PAGE and f"on {len(rows) - 1} spots" in README
    last = read_history(results)[-1]
    stiffness, error = last.interface_stiffness_N_per_mm, last.interface_stiffness_error_N_per_mm
    assert f"{1e-3 * stiffness:.0f} ± {1e-3 * error:.0f} kN/mm" in PAGE
    peak = max(float(row.split(",")[-1]) for row in rows[1:])
    assert peak == pytest.approx(2500.0, rel=1e-12)  # the hardness itself, rounded once
    with h5py.File(results / "contact.h5") as file:
        pressure = file[f"step_{last.step}/pressure_MPa"][:]
    yields = np.isclose(pressure, pressure.max()).sum() / (pressure > 0.0).sum()
    assert f"on {last.contacts} spots; {100 * yields:.0f} % of the cells in contact" in README
    assert (results / "contact.png").is_file()


@pytest.mark.slow
def test_python_of_the_page_runs_where_its_commands_ran(said, place):
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", example], cwd=place, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    steel, others, forces = done.stdout.splitlines()
    assert steel == re.search(r"steel 0\.\d+ µm, aluminium 1\.\d+ µm", PAGE)[0]
    assert others.startswith("approaches [0.60") and forces == "[ 5. 10. 15. 20.]"
