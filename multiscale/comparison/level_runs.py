"""Runs levels one after another, each in a clean process, within a budget; resumes."""

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
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from geometry.errors import InputError
from multiscale.comparison.level import Level
from multiscale.comparison.level_results import LevelResult, read_result, write_result
from multiscale.restart.interruption import ENDING

_NO_CACHE = {"PATCHLAW_CACHE": "off"}
_IN_MPI = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "PMI_RANK", "SLURM_STEP_TASKS_PER_NODE")
_ENDED = 5.0  # seconds that a process gets between being asked and being made to end


class Launch(Protocol):
    """Runs one level."""

    def __call__(self, level: Level, seconds: float | None) -> LevelResult:
        """Run a level and return how it ended; stop it after ``seconds``, where given."""


def check_launchable(ranks: int) -> None:
    """Refuse what cannot be launched.

    Raises:
        InputError: Inside an MPI job, or when more than one rank is wanted and there is no
            ``mpirun``.
    """
    inside = next((name for name in _IN_MPI if name in os.environ), None)
    if inside is not None:
        raise InputError(
            f"levels are launched each on its own, which is not possible inside an MPI job "
            f"({inside} is set)",
            key="--ranks",
            value=ranks,
            allowed="patchlaw compare SCENE --ranks N, without mpirun",
        )
    if ranks < 1:
        raise InputError("is no number of processes", key="--ranks", value=ranks, allowed="≥ 1")
    if ranks > 1 and shutil.which("mpirun") is None:
        raise InputError("there is no mpirun", key="--ranks", value=ranks, allowed="1")


def run_levels(
    levels: Sequence[Level],
    *,
    folder: Path,
    budget_s: float | None = None,
    launch: Launch | None = None,
    begin: Callable[[Level], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[tuple[Level, LevelResult, bool]]:
    """Run levels in their order, and yield each with its result when it ends.

    Finished levels are kept on disk, one file each, and are not run again. Levels that are
    predicted to take more than the budget leaves, or more memory than there is, are left out.

    Args:
        levels: The levels.
        folder: Where results are kept.
        budget_s: Wall time for all that is run now [s]; None for any.
        launch: Runs one level; by default in a process of its own.
        begin: Called with every level that is about to be run.
        clock: Tells the time [s].

    Yields:
        Level, result, and whether it was read from disk.
    """
    launch = launch or launch_process
    end = None if budget_s is None else clock() + budget_s
    for level in levels:
        path = folder / f"{level.key}.json"
        kept = read_result(path)
        if kept is not None and kept.key == level.key and kept.settled:
            yield level, kept, True
            continue
        left = None if end is None else end - clock()
        omitted = _omitted(level, left)
        if omitted is not None:
            yield level, omitted, False
            continue
        if begin is not None:
            begin(level)
        result = launch(level, left)
        write_result(path, result)
        yield level, result, False


def _omitted(level: Level, left: float | None) -> LevelResult | None:
    """Return the result of a level that is left out, with the reason; None of one to be run.

    Args:
        level: The level.
        left: What the budget leaves [s]; None without one.
    """
    if level.refusal:
        return LevelResult(key=level.key, status="refused", message=level.refusal)
    if left is None or level.cost <= left:
        return None
    rest = f"{left:.2g} s" if left > 0.0 else "nothing"
    why = f"it is predicted to take {level.cost:.2g} s, and the budget leaves {rest}"
    return LevelResult(key=level.key, status="not started", message=why)


def launch_process(level: Level, seconds: float | None) -> LevelResult:
    """Run a level in a fresh process, or under ``mpirun``; end it when its time is over."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="patchlaw-level-") as aside:
        request, answer = Path(aside) / "request.json", Path(aside) / "result.json"
        asked = {
            "scene": level.content,
            "key": level.key,
            "result": str(answer),
        }
        request.write_text(json.dumps(asked), encoding="utf-8")
        errors = Path(aside) / "errors.txt"
        code = _ended(_command(level, request), errors, seconds)
        spent = time.monotonic() - began
        if code is None:
            told = f"ended after {spent:.1f} s, which was what the budget left"
            return LevelResult(key=level.key, status="over budget", message=told, start_s=spent)
        result = read_result(answer)
        if result is None:
            lines = errors.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            told = lines[-1] if lines else f"its process ended with exit code {code}"
            return LevelResult(key=level.key, status="failed", exit_code=code, message=told)
    return replace(result, start_s=result.start_s + spent)


def _command(level: Level, request: Path) -> list[str]:
    python = [sys.executable, "-m", "multiscale.comparison.level_process", str(request)]
    return python if level.ranks == 1 else ["mpirun", "-n", str(level.ranks), *python]


def _ended(command: list[str], errors: Path, seconds: float | None) -> int | None:
    """Run a command and return its exit code; None when its time was over.

    It has a process group of its own, and does not outlive this call, however that ends.
    """
    with errors.open("wb") as stream, _started(command, stream) as process:
        try:
            return process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None


@contextmanager
def _started(command: list[str], errors: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Start a process that ends with the block; signals to end wait until it is known."""
    process = None
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            # MPI may have put variables into this process that are not for another
            env=os.environ | _NO_CACHE,
            start_new_session=True,
            preexec_fn=lambda: signal.pthread_sigmask(signal.SIG_SETMASK, mask),
        )
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        yield process
    finally:
        if process is not None:
            _end(process)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and all that it started, where it still runs."""
    for sign in (signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            return
        with suppress(ProcessLookupError):
            os.killpg(process.pid, sign)
        with suppress(subprocess.TimeoutExpired):
            process.wait(_ENDED)
