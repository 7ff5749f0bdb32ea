"""Starts the process that a configuration is run in, and ends it when its time is over."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

from multiscale.comparison.configuration import Configuration, RunResult, read_result, write_result
from multiscale.readable import duration
from multiscale.restart.interruption import ENDING
from support.errors import InputError

MPI_JOB = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "PMI_RANK", "SLURM_STEP_TASKS_PER_NODE")
"""Environment variables that exist inside an MPI job only."""

TIME_TO_END = 5.0
"""Time that a process has between SIGTERM and SIGKILL [s]."""

PROGRAM = (sys.executable, "-m", "multiscale.comparison.process")
"""Words that start the program of a process."""


def check_launchable(ranks: int, comm: Any = None) -> None:
    """Check that processes can be launched.

    Args:
        ranks: Number of processes of one configuration.
        comm: MPI communicator of this process, or None.

    Raises:
        InputError: Inside an MPI job, or when more than one rank is wanted and there is no
            ``mpirun``.
    """
    if (comm is not None and comm.size > 1) or any(name in os.environ for name in MPI_JOB):
        raise InputError(
            "configurations run in processes of their own, which cannot be launched in an MPI job",
            key="--ranks",
            value=ranks,
            allowed="patchlaw compare SCENE --ranks N, or compare(scene, ranks=N), without mpirun",
        )
    if ranks < 1:
        raise InputError("is no number of processes", key="--ranks", value=ranks, allowed="≥ 1")
    if ranks > 1 and shutil.which("mpirun") is None:
        raise InputError("there is no mpirun", key="--ranks", value=ranks, allowed="1")


def launch_process(
    configuration: Configuration, seconds: float | None, program: Sequence[str] = PROGRAM
) -> RunResult:
    """Run a configuration in a new process, or under ``mpirun``.

    Args:
        configuration: The configuration.
        seconds: Wall time after which the process is ended [s]; None for any.
        program: Words that start the program; it is given the name of a file with the
            configuration, which it replaces by the result.
    """
    start, ranks = time.monotonic(), configuration.ranks
    mpirun = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    with tempfile.TemporaryDirectory(prefix="patchlaw-compare-") as name:
        file, errors = Path(name) / "result", Path(name) / "errors"
        write_result(file, RunResult(configuration=configuration, status="not started"))
        with errors.open("wb") as stream:
            code = _exit_code([*mpirun, *program, str(file)], stream, seconds)
        spent = time.monotonic() - start
        result = read_result(file)
        text = errors.read_text(encoding="utf-8", errors="replace")
    if code is not None and result is not None and result.status != "not started":
        return replace(result, start_s=result.start_s + spent)
    result = RunResult(configuration=configuration, status="failed", exit_code=code)
    if code is None:
        why = f"ended after {duration(spent)}, which was what the budget left"
        return replace(result, status="over budget", message=why, start_s=spent)
    lines = [line for line in text.splitlines() if line.strip(" -")]  # mpirun ends by a rule
    why = lines[-1] if lines else f"its process ended with exit code {code}"
    return replace(result, message=why)


def _exit_code(command: list[str], errors: BinaryIO, seconds: float | None) -> int | None:
    """Run a command in a group of processes of its own; None when its time is over.

    The group ends with this function, however it ends. Signals that end this process are blocked
    until the new one is known, so that it cannot be left behind.
    """
    # os.environ is without variables that MPI has set for this process
    environment, process = os.environ | {"PATCHLAW_CACHE": "off"}, None
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env=environment,
            start_new_session=True,
            preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, mask),
        )
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        return None
    finally:
        for sign in (signal.SIGTERM, signal.SIGKILL):
            if process is not None and process.poll() is None:
                with suppress(ProcessLookupError, subprocess.TimeoutExpired):
                    os.killpg(process.pid, sign)
                    process.wait(TIME_TO_END)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
