"""The command ``patchlaw``: parses its words, then loads and runs one command.

Its standard streams may be full or closed, or may lack a character.

Nothing but the standard library is imported before the words are understood, so that ``--help``
takes a tenth of a second.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from patchlaw.multiscale.cli.interruption import ended_if_told, signals_raise
from patchlaw.multiscale.cli.words import UsageError, command_parser


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
            code = getattr(error, "exit_code", 130)  # of SIGINT, as shells have it
        output.flush()
        failure = output.failure or errors.failure
        if failure is None or isinstance(failure, BrokenPipeError) or code == 1 or code > 128:
            return code  # whoever closed a pipe has read enough
        from patchlaw.multiscale.cli.execution import complain_of_stream

        return complain_of_stream("error" if output.failure is None else "output", failure)


def _run(words: list[str]) -> int:
    """Parse the words, then run the command; return its exit code."""
    cut = words.index("--") if "--" in words else len(words)
    choice: argparse.Namespace | str
    try:
        choice = command_parser().parse_args(words[:cut])
    except UsageError as error:  # for rank 0 to say, which is known once MPI has started
        choice = str(error)
    from patchlaw.support.errors import NotInstalled
    from patchlaw.support.packages import conflict, optional_packages

    try:
        if problem := conflict():
            raise NotInstalled(problem)
        with optional_packages():
            from patchlaw.multiscale.cli.execution import execute
    except NotInstalled as error:  # what other errors are written with may be missing
        print(f"patchlaw: {error}", file=sys.stderr)
        return error.exit_code
    return execute(choice, words[cut + 1 :])


class SturdyStream:
    """A text stream to which writing never fails: after the first error it drops the text.

    Args:
        stream: The stream; None for one that was closed before this process began.

    Attributes:
        failure: The first error; None while all text was written.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.failure: OSError | None = None
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")

    def write(self, text: str) -> int:
        """Write a text, or drop it after an error."""
        self._attempt(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Write the buffered text, or drop it after an error."""
        if self._stream is not None:
            self._attempt(self._stream.flush)

    def isatty(self) -> bool:
        """Tell whether the stream is a terminal."""
        return self._stream is not None and self._stream.isatty()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _attempt(self, write: Any) -> None:
        if self.failure is not None:
            return
        try:
            if self._stream is None or self._stream.closed:
                raise OSError("it is closed")
            write()
        except OSError as error:
            self.failure = error
            # Python flushes the buffer at exit. That must not fail again, so it goes nowhere.
            with suppress(OSError, ValueError, AttributeError):
                number = self._stream.fileno()
                with open(os.devnull, "wb") as nowhere:
                    os.dup2(nowhere.fileno(), number)


@contextmanager
def sturdy_streams() -> Iterator[tuple[SturdyStream, SturdyStream]]:
    """Replace the standard streams, so that an error of printing does not end a computation.

    Characters that a stream cannot encode are escaped. Closed file descriptors are opened on the
    null device: otherwise the next file would get the number of a standard stream.

    Yields:
        Output and error stream; their `failure` shows afterwards whether all text was written.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # It gets the lowest free number, which is this one.
    former = sys.stdout, sys.stderr
    output, errors = SturdyStream(sys.stdout), SturdyStream(sys.stderr)
    sys.stdout, sys.stderr = output, errors
    try:
        yield output, errors
    finally:
        for stream in (output, errors):
            stream.flush()
        sys.stdout, sys.stderr = former
