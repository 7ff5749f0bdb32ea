"""Stops a run between two load steps: by a signal, or before its time is over."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import Any

from support.errors import PatchlawError

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a process."""

_TIME_OVER = 0.5  # stands for the limit of the time; below the numbers of all signals
_REASONS: dict[float, str] = {
    _TIME_OVER: "the time is nearly over",
    signal.SIGINT: "interrupted (SIGINT)",
    signal.SIGTERM: "terminated (SIGTERM)",
    signal.SIGHUP: "hung up (SIGHUP)",
    signal.SIGUSR1: "told to stop (SIGUSR1)",
}
_IN_TIME = (_TIME_OVER, signal.SIGUSR1)

_RESERVE = 0.05
"""Share of the time limit that is left for writing results."""
_LEAST_RESERVE, _MOST_RESERVE = 1.0, 20.0
"""Bounds of that reserve [s]."""
_GROWTH = 1.5
"""Wall time that the next load step is expected to take, over that of the last one."""


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

    The first signal asks for a stop after the load step under way. A second one, except SIGUSR1,
    ends the process as if nobody had watched. A signal that is ignored, as SIGHUP is under
    ``nohup``, stays ignored.

    Args:
        comm: MPI communicator, or None.
        limit: Wall time that the run may take from now on [s]; None sets no limit.
    """

    def __init__(self, comm: Any, limit: float | None = None) -> None:
        self._comm, self._limit = comm, limit
        self._began = time.monotonic()
        self._seen = 0
        self._former: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        """Begin to watch."""
        if threading.current_thread() is threading.main_thread():  # no other may set handlers
            self._former = {
                number: signal.signal(number, self._see)
                for number in (*ENDING, signal.SIGUSR1)
                if number == signal.SIGUSR1
                or signal.getsignal(number) not in (None, signal.SIG_IGN)  # None: not of Python
            }
        return self

    def __exit__(self, *error: object) -> None:
        """Give the signals back; a notice of the time limit that comes now must not kill."""
        for number, handler in self._former.items():
            late_notice = number == signal.SIGUSR1 and handler == signal.SIG_DFL
            signal.signal(number, signal.SIG_IGN if late_notice else handler)
        self._former.clear()

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

    def _is_late(self, last_step: float) -> bool:
        if self._limit is None:
            return False
        reserve = min(max(_RESERVE * self._limit, _LEAST_RESERVE), _MOST_RESERVE)
        return time.monotonic() + _GROWTH * last_step + reserve > self._began + self._limit

    def _see(self, number: int, frame: FrameType | None) -> None:
        self._seen = max(self._seen, number)
        if number != signal.SIGUSR1:
            signal.signal(number, signal.SIG_DFL)
            # not through Python's buffers, which the interrupted code may be using
            with suppress(OSError):  # standard error may be full
                os.write(2, b"\npatchlaw: stops after this load step; once more ends it at once\n")
