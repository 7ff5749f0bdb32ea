"""Signals that end a command: each raises an error, so that files and processes are cleared."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_told: list[int] = []  # signals since the command began


class Ended(KeyboardInterrupt):
    """A signal told this process to end now.

    Args:
        number: The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 128 + number


@contextmanager
def signals_raise() -> Iterator[None]:
    """Let SIGINT, SIGTERM and SIGHUP raise `Ended`, so that files and child processes are cleared.

    A signal that is ignored, as SIGHUP is under ``nohup``, stays ignored. The former handlers come
    back at the end.
    """
    former: dict[int, Any] = {}
    _told.clear()
    if threading.current_thread() is threading.main_thread():  # no other thread may set handlers
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) not in (None, signal.SIG_IGN):  # None: not of Python
                former[number] = signal.signal(number, _raise)
    try:
        yield
    finally:
        for watched, handler in former.items():
            signal.signal(watched, handler)


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


def _raise(number: int, frame: FrameType | None) -> None:
    _told.append(number)
    raise Ended(number)
