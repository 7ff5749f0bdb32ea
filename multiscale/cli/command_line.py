"""The command ``patchlaw``: parses its words, then loads and runs one command.

Nothing but the standard library is imported before the words are understood, so that ``--help``
takes a tenth of a second.
"""

from __future__ import annotations

import argparse
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from multiscale.cli.words import UsageError, command_parser
from multiscale.output.streams import sturdy_streams

_INTERRUPTED = 130  # exit code after SIGINT, as shells have it
_WRONG_INPUT = 2  # and of what is installed; errors with exit codes need numpy


_told: list[int] = []  # signals since the command began


class Ended(KeyboardInterrupt):
    """A signal told this process to end now.

    Args:
        number: The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 128 + number


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command. Works the same under ``mpirun``, where rank 0 prints and writes.

    Args:
        arguments: Words of the command line after the program's name; what follows ``--`` are
            PETSc options.

    Returns:
        0 done; 2 the input is wrong and nothing was written; 3 not converged, the results up to
        there are written; 4 stopped in time; 5 a file or the output cannot be written, or memory
        ran out; 129, 130 and 143 stopped by SIGHUP, SIGINT and SIGTERM; 1 a bug. After all but
        0, 1 and 2 ``patchlaw run --resume`` goes on from the last load step.

    Note:
        Collective over all processes of the MPI job.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    with sturdy_streams() as (output, errors), signals_raise():
        try:
            with ended_if_told():
                code = _run(words)
        except SystemExit:  # of --help and --version
            code = 0
        except KeyboardInterrupt as error:
            code = getattr(error, "exit_code", _INTERRUPTED)
        output.flush()
        failure = output.failure or errors.failure
        if failure is None or isinstance(failure, BrokenPipeError) or code == 1 or code > 128:
            return code  # whoever closed a pipe has read enough
        from multiscale.cli.execution import complain_of_stream

        return complain_of_stream("error" if output.failure is None else "output", failure)


def _run(words: list[str]) -> int:
    """Parse the words, then run the command; return its exit code."""
    cut = words.index("--") if "--" in words else len(words)
    choice: argparse.Namespace | str
    try:
        choice = command_parser().parse_args(words[:cut])
    except UsageError as error:  # for rank 0 to say, which is known once MPI has started
        choice = str(error)
    from multiscale.installation import works_together

    if not works_together():
        return _WRONG_INPUT
    from geometry.errors import NotInstalled
    from geometry.packages import optional_packages

    try:
        with optional_packages():
            from multiscale.cli.execution import execute
    except NotInstalled as error:  # what other errors are written with may be missing
        print(f"patchlaw: {error}", file=sys.stderr)
        return error.exit_code
    return execute(choice, words[cut + 1 :])


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
