"""Runs configurations one after another, each in a process of its own, within a time budget."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeAlias

from geometry.errors import InputError
from multiscale.comparison.configuration import Configuration
from multiscale.comparison.run_result import RunResult, read_result, write_result
from multiscale.restart.interruption import ENDING

Launch: TypeAlias = Callable[[Configuration, float | None], RunResult]
"""Runs a configuration, and stops it after so many seconds if they are not None."""

TIME_TO_END = 5.0
"""Time that a process has between SIGTERM and SIGKILL [s]."""

MPI_JOB = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "PMI_RANK", "SLURM_STEP_TASKS_PER_NODE")
"""Environment variables that exist inside an MPI job only."""

_NO_CACHE = {"PATCHLAW_CACHE": "off"}


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


def run_all(
    configurations: Sequence[Configuration],
    folder: Path,
    *,
    budget_s: float | None = None,
    launch: Launch | None = None,
    begin: Callable[[Configuration], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[tuple[RunResult, bool]]:
    """Run configurations in their order, and yield the result of each when it ends.

    Results are stored, one file each, and a configuration that has a result is not run again.
    Configurations that are predicted to take more time than the budget leaves, or more memory than
    there is, are left out.

    Args:
        configurations: The configurations.
        folder: Folder of the results.
        budget_s: Wall time for all that is run now [s]; None for any.
        launch: Runs one configuration; by default `launch_process`.
        begin: Called with every configuration that is about to be run.
        clock: Returns the time [s].

    Yields:
        The result, and whether it is from an earlier call.
    """
    launch = launch or launch_process
    end = None if budget_s is None else clock() + budget_s
    for one in configurations:
        path = folder / f"{one.key}.json"
        stored = read_result(path, one)
        left = None if end is None else end - clock()
        if stored is not None and stored.is_repeatable:
            yield stored, True
        elif one.refusal:
            yield RunResult(configuration=one, status="refused", message=one.refusal), False
        elif left is not None and one.cost > left:
            rest = f"{left:.2g} s" if left > 0.0 else "nothing"
            why = f"it is predicted to take {one.cost:.2g} s, and the budget leaves {rest}"
            yield RunResult(configuration=one, status="not started", message=why), False
        else:
            if begin is not None:
                begin(one)
            result = launch(one, left)
            write_result(path, result)
            yield result, False


def command_of(configuration: Configuration, request: Path) -> list[str]:
    """Return the command that runs a configuration.

    Args:
        configuration: The configuration.
        request: File for the process, see `run_result.main`.
    """
    python = [sys.executable, "-m", "multiscale.comparison.run_result", str(request)]
    ranks = configuration.ranks
    return python if ranks == 1 else ["mpirun", "-n", str(ranks), *python]


def launch_process(
    configuration: Configuration,
    seconds: float | None,
    command: Callable[[Configuration, Path], list[str]] = command_of,
) -> RunResult:
    """Run a configuration in a new process, or under ``mpirun``.

    Args:
        configuration: The configuration.
        seconds: Wall time after which the process is ended [s]; None for any.
        command: Returns the command for a configuration and its request.
    """
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="patchlaw-compare-") as name:
        request, answer, errors = (Path(name) / file for file in ("request", "result", "errors"))
        fields = asdict(configuration) | {"path": str(answer)}
        request.write_text(json.dumps(fields), encoding="utf-8")
        code: int | None = None
        with errors.open("wb") as stream, suppress(subprocess.TimeoutExpired):
            with _process(command(configuration, request), stream) as process:
                code = process.wait(seconds)
        spent = time.monotonic() - start
        if code is None:
            why = f"ended after {spent:.1f} s, which was what the budget left"
            return RunResult(
                configuration=configuration, status="over budget", message=why, start_s=spent
            )
        result = read_result(answer, configuration)
        if result is not None:
            return replace(result, start_s=result.start_s + spent)
        text = errors.read_text(encoding="utf-8", errors="replace")
        lines = [line for line in text.splitlines() if line.strip(" -")]  # mpirun ends by a rule
        why = lines[-1] if lines else f"its process ended with exit code {code}"
        return RunResult(configuration=configuration, status="failed", exit_code=code, message=why)


@contextmanager
def _process(command: list[str], errors: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process in a group of its own, which is ended at the end of the block.

    Signals that end this process are blocked until the new one is known, so that it cannot be
    left behind.
    """
    process = None
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env=os.environ | _NO_CACHE,  # without variables that MPI has set for this process
            start_new_session=True,
            preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, mask),
        )
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        yield process
    finally:
        for sign in (signal.SIGTERM, signal.SIGKILL):
            if process is not None and process.poll() is None:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, sign)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(TIME_TO_END)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
