"""Stops a run between two load steps: by a signal, or before its time is over."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import Any

from geometry.errors import PatchlawError

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a process."""

_WATCHED = (*ENDING, signal.SIGUSR1)
_AT_ONCE = (signal.SIGTERM, signal.SIGHUP)
_TIME_OVER = 0.5  # below the numbers of all signals
_TOLD: dict[float, str] = {
    _TIME_OVER: "the time is nearly over",
    signal.SIGINT: "interrupted (SIGINT)",
    signal.SIGTERM: "terminated (SIGTERM)",
    signal.SIGHUP: "hung up (SIGHUP)",
    signal.SIGUSR1: "told to stop (SIGUSR1)",
}
_LEAST_RESERVE, _MOST_RESERVE = 1.0, 20.0  # for writing results [s]
_RESERVE = 0.05  # likewise, of the limit
_LONGER = 1.5  # than the one before it a load step may take


class Ended(BaseException):
    """This process was told by a signal to end now.

    Args:
        number: The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 128 + number


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise `Ended`: what was begun is cleared away, and children end too.

    What ``nohup`` has ignored stays so.
    """
    former: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():  # no other can
        former = {
            number: signal.signal(number, _raise)
            for number in _AT_ONCE
            if signal.getsignal(number) == signal.SIG_DFL
        }
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


def _raise(number: int, frame: FrameType | None) -> None:
    raise Ended(number)


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


class Interruption:
    """Watches on any rank for SIGINT, SIGTERM, SIGHUP, SIGUSR1, and for the end of the time.

    The first signal asks for a stop after the load step under way; a second one, but for SIGUSR1,
    ends the process as if nobody had watched. What ``nohup`` has ignored stays so.

    Args:
        comm: MPI communicator, or None.
        limit: Wall time that the run may take [s]; None sets no limit.
        began: When it began, by `time.monotonic`.
    """

    def __init__(self, comm: Any, limit: float | None = None, began: float | None = None) -> None:
        self._comm, self._limit = comm, limit
        self._began = time.monotonic() if began is None else began
        self._seen = 0
        self._former: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        """Begin to watch."""
        if threading.current_thread() is threading.main_thread():  # no other can
            self._former = {
                number: signal.signal(number, self._see)
                for number in _WATCHED
                if number == signal.SIGUSR1 or signal.getsignal(number) != signal.SIG_IGN
            }
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give the signals back; a notice of the time limit that comes now must not kill."""
        for number, handler in self._former.items():
            late_notice = number == signal.SIGUSR1 and handler == signal.SIG_DFL
            signal.signal(number, signal.SIG_IGN if late_notice else handler)
        self._former.clear()

    def check(self, where: str, took: float = 0.0) -> None:
        """Raise on all ranks when any of them was told to stop, or time is too short to go on.

        Args:
            where: What was accomplished, for the message.
            took: Wall time of the last load step, by which that of the next is judged [s].

        Raises:
            Stopped: When the run is to stop here.

        Note:
            Collective.
        """
        reason = max(self._seen, _TIME_OVER if self._too_late(took) else 0)
        if self._comm is not None:
            reason = max(self._comm.allgather(reason))
        if reason:
            in_time = reason in (_TIME_OVER, signal.SIGUSR1)
            message = f"{_TOLD[reason]}: stopped {where}; go on with --resume"
            raise Stopped(message, 4 if in_time else 128 + int(reason))

    def _too_late(self, took: float) -> bool:
        if self._limit is None:
            return False
        reserve = min(max(_RESERVE * self._limit, _LEAST_RESERVE), _MOST_RESERVE)
        ahead = time.monotonic() + _LONGER * took + reserve
        return ahead > self._began + self._limit

    def _see(self, number: int, frame: FrameType | None) -> None:
        self._seen = max(self._seen, number)
        if number != signal.SIGUSR1:
            signal.signal(number, signal.SIG_DFL)
            # not through Python's buffers, which the interrupted code may be using
            with suppress(OSError):  # standard error may be full
                os.write(2, b"\npatchlaw: stops after this load step; once more ends it at once\n")
