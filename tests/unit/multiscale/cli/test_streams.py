"""Streams that are full, closed or cannot show a letter, and signals before anything has begun."""

import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from patchlaw.multiscale.cli.command_line import SturdyStream, sturdy_streams

PAPER = str(Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml")
SMALL = [
    "--set", "surface.grid=[24, 24]", "coupling.kind=analytic", "micro.model=half-space",
    "load.steps=2", "output.figures=false",
]  # fmt: skip
PLAN = ["plan", PAPER, *SMALL]
COMMAND = [sys.executable, "-m", "patchlaw"]


def shell(root, words, redirection, encoding="utf-8", **environment):
    """Run the command from a shell, which closes and redirects streams."""
    line = " ".join(f"'{word}'" for word in (*COMMAND, *words))
    return subprocess.run(
        f"{line} {redirection}",
        shell=True,
        cwd=root,
        env=os.environ | environment,
        capture_output=True,
        encoding=encoding,
        check=False,
    )


FULL, CLOSED = (">/dev/full", "No space left on device"), (">&-", "it is closed")


@pytest.mark.parametrize(
    ("words", "redirection", "why"),
    [
        (["schema"], *FULL), (["--version"], *CLOSED), (["run", "--help"], *FULL),
    ],
)  # fmt: skip
def test_output_that_cannot_be_written_ends_with_5(root, words, redirection, why):
    done = shell(root, words, redirection)
    assert done.returncode == 5
    assert done.stderr == f"patchlaw: standard output: cannot be written: {why}\n"


@pytest.mark.parametrize("redirection", ["2>/dev/full", ">&- 2>&-"])
def test_refusal_that_cannot_be_told_ends_with_5(root, redirection):
    done = shell(root, ["run", "nowhere.toml"], redirection)
    assert (done.returncode, done.stdout, done.stderr) == (5, "", "")


@pytest.mark.parametrize("redirection", [">/dev/full", ">&- 2>&- <&-"])
def test_run_without_output_keeps_its_results(root, tmp_path, redirection):
    done = shell(root, ["run", PAPER, "--out", str(tmp_path), *SMALL], redirection)
    assert done.returncode == 5
    assert len((tmp_path / "history.csv").read_text(encoding="utf-8").splitlines()) == 3
    assert (tmp_path / "report.html").read_text(encoding="utf-8").endswith("</html>\n")


def test_run_whose_reader_has_enough_comes_to_its_end(root, tmp_path):
    done = shell(root, ["run", PAPER, "--out", str(tmp_path), *SMALL], "| true; exit ${PIPESTATUS}")
    assert (tmp_path / "report.html").exists()
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("words", "encoding"),
    [
        (PLAN, "ascii"), (PLAN, "latin-1"),
        (["run", "--help"], "ascii"), (["run", "missing_µ.toml"], "ascii"),
    ],
)  # fmt: skip
def test_terminals_without_greek_letters(root, words, encoding):
    done = shell(root, words, "", encoding, PYTHONIOENCODING=encoding)
    assert done.returncode == (2 if words[0] == "run" and "--help" not in words else 0)
    assert "Traceback" not in done.stderr
    times = r"24 \xd7 24" if encoding == "ascii" else "24 × 24"  # latin-1 has it
    assert (times in done.stdout) == (words[0] == "plan")


def test_what_has_no_code_is_escaped():
    inner = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    with sturdy_streams():
        stream = SturdyStream(inner)
    stream.write("8 µm × 2 → \udcff")
    stream.flush()
    assert inner.buffer.getvalue() == rb"8 \xb5m \xd7 2 \u2192 \udcff"


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
            [sys.executable, "-c", code, "plan", PAPER],
            cwd=root,
            capture_output=True,
            text=True,
            check=False,
        )
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
