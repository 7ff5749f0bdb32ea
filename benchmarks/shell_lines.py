"""Strategies for commands in shells that redirect, limit and interrupt them, and their outcomes."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from hypothesis import strategies as st

ROOT = Path(__file__).parents[1]
PATIENCE = 60  # seconds
COMMANDS = (
    ("schema",), ("--version",), ("run", "--help"), ("plan", "SCENE"), ("surface", "SCENE"),
    ("run", "SCENE"), ("run", "SCENE", "--resume"), ("laws", "SCENE"), ("run", "nowhere_µ.toml"),
    ("run", "SCENE", "--set", "coupling.kind=concurrent"), ("fly",), ("doctor",),
    ("help",), ("help", "load"), ("init", "--out", "new.toml"), ("init", "nowhere.npy"),
    ("plan", "SCENE", "--", "-options_file", "nowhere"), ("plan", "SCENE", "--", "-x", "\udcff"),
)  # fmt: skip
REDIRECTIONS = (
    "", "", ">/dev/full", "<&-", "| head -c 10", "| true", "</dev/null", ">out.txt",
)  # fmt: skip
ENCODINGS = (None, None, "ascii", "latin-1", "utf-8", "utf-16", "ascii:strict")
LIMITS = (None, None, None, 200_000, 500_000, 900_000, 1_500_000, 2_000_000)
SIGNALS = (None, None, signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1)
TOLD = (0, 2, 3, 4, 5, 129, 130, 143)

lines = st.tuples(
    st.sampled_from(COMMANDS), st.sampled_from(REDIRECTIONS), st.sampled_from(ENCODINGS),
    st.sampled_from(LIMITS), st.sampled_from(SIGNALS), st.floats(0.1, 3.0),
    st.sampled_from(["", "", "-O", "-OO"]),
)  # fmt: skip


def called(scene, line):
    """Run a command line by a shell in the scene's folder; return how it ended.

    A signal before anything could watch for it may end the process as if nobody did; Python ends
    with 1 and a trace of its own where SIGINT meets it before it runs a program.
    """
    words, redirection, encoding, limit, number, seconds, optimised = line
    words = [str(scene) if word == "SCENE" else word for word in words]
    python = [sys.executable, *([optimised] if optimised else []), "-m", "patchlaw"]
    quoted = " ".join(f"'{word}'" for word in (*python, *words))
    limited = f"ulimit -v {limit}; " if limit else ""
    piped = "; exit ${PIPESTATUS[0]}" if redirection.startswith("|") else ""
    start = "" if piped else "exec "  # so that the signal reaches it, and not the shell
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    if encoding:
        environment["PYTHONIOENCODING"] = encoding
    process = subprocess.Popen(
        ["bash", "-c", f"{limited}{start}{quoted} {redirection}{piped}"],
        cwd=scene.parent,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    early = False
    try:
        try:
            _, told = process.communicate(timeout=seconds if number else PATIENCE)
        except subprocess.TimeoutExpired:
            if number is None:
                raise
            early = number == signal.SIGINT and not _catches(process.pid, signal.SIGTERM)
            process.send_signal(number)
            _, told = process.communicate(timeout=PATIENCE)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    code = process.returncode
    if early and code == 1:
        return "ended before it began"
    assert code in (*TOLD, *(() if number is None else (-number,))), (line, code, told[-2000:])
    assert b"Traceback" not in told, (line, told[-3000:].decode(errors="replace"))
    return f"exit code {code}"


def _catches(process, number):
    """Tell whether a process has a handler of a signal, as Python alone has not of SIGTERM."""
    with open(f"/proc/{process}/status", encoding="ascii") as status:
        caught = next(line.split()[1] for line in status if line.startswith("SigCgt"))
    return bool(int(caught, 16) >> (number - 1) & 1)
