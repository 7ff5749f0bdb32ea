"""Streams that are full or cannot show a letter, and signals before anything has begun."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PAPER = str(Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml")
SMALL = [
    "--set", "surface.grid=[24, 24]", "coupling.kind=analytic", "micro.model=half-space",
    "load.steps=2", "output.figures=false",
]  # fmt: skip
PLAN = ["plan", PAPER, *SMALL]
COMMAND = [sys.executable, "-m", "patchlaw"]


def shell_line(words):
    """Return the command with some words, as a shell reads it."""
    return " ".join(f"'{word}'" for word in (*COMMAND, *words))


def shell(root, words, redirection, encoding="utf-8", **environment):
    """Run the command from a shell, which closes and redirects streams."""
    return subprocess.run(
        f"{shell_line(words)} {redirection}", shell=True, cwd=root, env=os.environ | environment,
        capture_output=True, encoding=encoding, check=False,
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("words", [["schema"], ["help"], ["run", "--help"], ["--version"]])
def test_output_that_cannot_be_written_ends_with_5(root, words):
    done = shell(root, words, ">/dev/full")
    assert done.returncode == 5
    assert done.stderr == "patchlaw: standard output: No space left on device\n"


@pytest.mark.long
@pytest.mark.parametrize("words", [["schema"], ["help"]])
def test_a_reader_that_has_enough_is_no_error_to_tell(root, words):
    done = shell(root, words, "| true")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("redirection", [">/dev/full", "| true; exit ${PIPESTATUS}"])
def test_a_run_whose_output_ends_goes_on_by_the_same_call(root, tmp_path, redirection):
    words = ["run", PAPER, "--out", str(tmp_path), *SMALL]
    done = subprocess.run(["bash", "-c", f"{shell_line(words)} {redirection}"], cwd=root,
                          capture_output=True, encoding="utf-8", check=False)  # fmt: skip
    assert done.returncode == 5 and "Traceback" not in done.stderr
    assert shell(root, words, ">/dev/null").returncode == 0
    assert len((tmp_path / "history.csv").read_text(encoding="utf-8").splitlines()) == 3


@pytest.mark.long
@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_terminals_without_greek_letters(root, encoding):
    done = shell(root, PLAN, "", encoding, PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, "")
    assert (r"24 \xd7 24" if encoding == "ascii" else "24 × 24") in done.stdout  # latin-1 has it


@pytest.mark.long
def test_optimised_python_runs_and_explains_commands(root):
    code = f"from patchlaw.multiscale.cli import main; main({PLAN!r}); main(['doctor', '--help'])"
    done = subprocess.run(
        [sys.executable, "-OO", "-c", code], cwd=root, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "24 × 24" in done.stdout and "usage: patchlaw doctor" in done.stdout


@pytest.mark.parametrize("seconds", [0.15, 0.4])
def test_interrupt_during_imports_is_quiet(root, seconds):
    code = (
        "import threading, os, signal; from patchlaw.__main__ import main\n"
        f"threading.Timer({seconds}, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "raise SystemExit(main())"
    )
    for _ in range(3):  # the interpreter loses a signal that comes while C code asks for attributes
        done = subprocess.run(
            [sys.executable, "-c", code, "plan", PAPER], cwd=root, capture_output=True, text=True,
            check=False,
        )  # fmt: skip
        assert "Traceback" not in done.stderr
        if done.returncode != 0:
            break
    assert done.returncode == 130


@pytest.mark.long
def test_a_comparison_that_is_told_to_ends(root, tmp_path):
    folder = tmp_path / "out"
    process = subprocess.Popen(
        [*COMMAND, "compare", PAPER, "--out", str(folder)],
        cwd=root,
        env=dict(os.environ),  # without what MPI has put into this process behind Python's back
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while process.poll() is None and not folder.exists():
        time.sleep(0.1)
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 143, told
