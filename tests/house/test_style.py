"""Linter, formatter and type checker, as a developer runs them; no merge is left half done."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.seeded_faults import FAULTS, place

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(("ruff", "check", "."), id="ruff check ."),
        pytest.param(("ruff", "format", "--check", "."), id="ruff format --check ."),
        pytest.param(("mypy",), id="mypy", marks=pytest.mark.long),  # 16 s in a new clone
    ],
)
def test_tool_has_no_complaint(command):
    if command == ("mypy",) and np.lib.NumpyVersion(np.__version__) >= "2.0.0":
        pytest.skip("types are checked against numpy 1.24; stubs of 2.2 lose float64 in quotients")
    result = subprocess.run(
        [sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.long
@pytest.mark.parametrize("folder", ["benchmarks", "demos"])
def test_scripts_run_by_hand_name_what_there_is(folder):
    """Nothing else calls most of them, so that what they need could go unnoticed."""
    if np.lib.NumpyVersion(np.__version__) >= "2.0.0":
        pytest.skip("types are checked against numpy 1.24")
    texts = {file: file.read_text("utf-8") for file in (ROOT / folder).glob("*.py")}
    scripts = "".join(texts.values())  # mypy follows what they take from each other by package
    others = {*re.findall(r"from benchmarks\.(\w+) import", scripts), "half_space_peers"}
    together = re.findall(r"from benchmarks import \(([^)]*)\)", scripts)
    others |= {name for names in together for name in re.findall(r"\w+", names)}
    others |= {file.stem for file, text in texts.items() if "from ContactMechanics import" in text}
    files = [str(file) for file in texts if file.stem not in others]
    result = (
        subprocess.run(  # options as above, so that what mypy knows of the packages serves here
            [sys.executable, "-m", "mypy", "--explicit-package-bases", *files],
            cwd=ROOT,
            env=os.environ | {"MYPYPATH": os.pathsep.join(["tests", folder])},
            capture_output=True,
            text=True,
            check=False,
        )
    )
    kinds = ("[attr-defined]", "[call-arg]", "[name-defined]", "[import-not-found]")
    assert f"checked {len(files)} source files" in result.stdout, result.stdout + result.stderr
    bases = ('"object" has no', '"Coupling" has no')  # what classes derived from them may have
    errors = [line for line in result.stdout.splitlines() if line.endswith(kinds)]
    assert [line for line in errors if not any(base in line for base in bases)] == []


def test_lines_of_seeded_faults_stand_once():
    for fault in FAULTS:
        place(fault, ROOT)
        assert all((ROOT / "tests" / test).exists() for test in fault.tests.split()), fault


def test_no_merge_is_left_half_done():
    marks = ("<" * 7 + " ", ">" * 7 + " ")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if files.returncode:
        pytest.skip("not a clone")
    for name in filter(None, files.stdout.decode().split("\0")):
        path = ROOT / name
        if path.is_file() and path.suffix not in (".png", ".npz"):
            text = path.read_text(encoding="utf-8", errors="replace")
            assert not any(line.startswith(marks) for line in text.splitlines()), name
