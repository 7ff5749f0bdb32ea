"""Linter, formatter and type checker, as a developer runs them; no merge is left half done."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

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
