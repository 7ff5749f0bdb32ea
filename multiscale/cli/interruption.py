"""Signals end a command at once, or stop a run between two load steps; so does the end of its time.

Only the standard library is imported here: signals are watched before anything else is loaded.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from patchlaw.support import PatchlawError

_HANGUP, _NOTICE = (getattr(signal, name, 0) for name in ("SIGHUP", "SIGUSR1"))
"""What Windows lacks: the end of a terminal, and the notice that batch systems send before their
limit of the time."""
_ALL = tuple(filter(None, (signal.SIGINT, signal.SIGTERM, _HANGUP, _NOTICE)))

_TIME_OVER = 0.5  # stands for the limit of the time; below the numbers of all signals
_REASONS: dict[float, str] = {
    _TIME_OVER: "the time is nearly over",
    signal.SIGINT: "interrupted (SIGINT)",
    signal.SIGTERM: "terminated (SIGTERM)",
    _HANGUP: "hung up (SIGHUP)",
    _NOTICE: "told to stop (SIGUSR1)",
}
_IN_TIME = (_TIME_OVER, _NOTICE)

_told: list[int] = []  # signals since the command began

Handler = Callable[[int, FrameType | None], None]


class Stopped(PatchlawError, RuntimeError):
    """A run was stopped between two load steps and can go on from there.

    Args:
        message: Why, and where.
        exit_code: 4 in time; 129, 130 or 143 by SIGHUP, SIGINT or SIGTERM, as shells have it.
    """

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message, exit_code)
        self.exit_code = exit_code

    def __str__(self) -> str:
        return str(self.args[0])


class Ended(KeyboardInterrupt):
    """A signal told this process to end now.

    Args:
        number: The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 4 if number == _NOTICE else 128 + number


@contextmanager
def signals_raise() -> Iterator[None]:
    """Let signals raise `Ended`, so that files and child processes are cleared.

    The former handlers come back at the end.
    """
    _told.clear()

    def end(number: int, frame: FrameType | None) -> None:
        _told.append(number)
        raise Ended(number)

    with _handled(_ALL, end):
        yield


@contextmanager
def ended_if_told() -> Iterator[None]:
    """Raise `Ended` in place of any error that follows a signal.

    A compiled module whose import is interrupted raises an error of its own instead.
    """
    try:
        yield
    except Exception as error:
        if _told:
            raise Ended(_told[-1]) from error
        raise


@contextmanager
def watching(comm: Any, limit: float | None = None) -> Iterator[Interruption]:
    """Watch on any rank for SIGINT, SIGTERM, SIGHUP, SIGUSR1, and for the end of the time.

    The first signal asks for a stop after the load step under way. A second one, except SIGUSR1,
    ends the process as if nobody had watched. A notice of the time limit, by SIGUSR1, that comes
    after the end of the run must not kill.

    Args:
        comm: MPI communicator, or None.
        limit: Wall time that the run may take from now on [s]; None sets no limit.
    """
    interruption = Interruption(comm, limit)
    with _handled(_ALL, interruption.see):
        yield interruption


@contextmanager
def _handled(numbers: Iterable[int], handler: Handler) -> Iterator[None]:
    """Let a function handle signals; the former handlers come back at the end.

    A signal that is ignored, as SIGHUP is under ``nohup``, stays ignored, and SIGUSR1, which would
    end a process by default, is ignored from then on.
    """
    former: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():  # no other may set handlers
        for number in numbers:
            ignored = signal.getsignal(number) in (None, signal.SIG_IGN)  # None: not of Python
            if number == _NOTICE or not ignored:
                former[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, before in former.items():
            # a notice that comes after the end, of what is watched or of the command, ends nothing
            ours = before == signal.SIG_DFL or getattr(before, "__module__", "") == __name__
            late = number == _NOTICE and ours
            signal.signal(number, signal.SIG_IGN if late else before)


class Interruption:
    """What a run was told, and how much time is left of it; see `watching`.

    Args:
        comm: MPI communicator, or None.
        limit: Wall time that the run may take from now on [s]; None sets no limit.
    """

    def __init__(self, comm: Any, limit: float | None = None) -> None:
        self._comm, self._limit = comm, limit
        self._began = time.monotonic()
        self._seen = 0

    def check(self, where: str, last_step: float = 0.0) -> None:
        """Raise on all ranks when any of them was told to stop, or time is too short to go on.

        Args:
            where: What was accomplished, for the message.
            last_step: Wall time of the last load step, by which that of the next is judged [s].

        Raises:
            Stopped: When the run is to stop here.

        Note:
            Collective.
        """
        reason = max(self._seen, _TIME_OVER if self._is_late(last_step) else 0)
        if self._comm is not None:
            reason = max(self._comm.allgather(reason))
        if reason:
            code = 4 if reason in _IN_TIME else 128 + int(reason)
            raise Stopped(f"{_REASONS[reason]}: stopped {where}; go on with --resume", code)

    def see(self, number: int, frame: FrameType | None) -> None:
        """Take note of a signal; a handler of `signal`."""
        self._seen = max(self._seen, number)
        if number != _NOTICE:
            signal.signal(number, signal.SIG_DFL)
            # not through Python's buffers, which the interrupted code may be using
            with suppress(OSError):  # standard error may be full
                os.write(2, b"\npatchlaw: stops after this load step; once more ends it at once\n")

    def _is_late(self, last_step: float) -> bool:
        if self._limit is None:
            return False
        reserve = min(max(0.05 * self._limit, 1.0), 20.0)  # for writing results [s]
        # the next load step may take half as long again as the last one
        return time.monotonic() + 1.5 * last_step + reserve > self._began + self._limit
