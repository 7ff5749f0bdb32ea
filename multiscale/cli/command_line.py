"""The command ``patchlaw``: parses its words, then loads and runs one command.

Nothing but the standard library is imported before the words are understood, so that ``--help``
takes a tenth of a second.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from patchlaw.multiscale.cli.command_line import UsageError, command_parser
from patchlaw.multiscale.cli.interruption import ended_if_told, signals_raise


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
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # for terminals that lack a character
            stream.reconfigure(errors="backslashreplace")
    with signals_raise():
        try:
            with ended_if_told():
                code = _run(words)
            sys.stdout.flush()
            return code
        except KeyboardInterrupt as error:
            return getattr(error, "exit_code", 130)  # of SIGINT, as shells have it
        except OSError as error:
            with suppress(OSError):
                if not isinstance(error, BrokenPipeError):  # who reads has had enough
                    print(f"patchlaw: standard output: {error.strerror}", file=sys.stderr)
                # Python flushes once more at its end
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 5


def _run(words: list[str]) -> int:
    """Parse the words, then run the command; return its exit code."""
    cut = words.index("--") if "--" in words else len(words)
    choice: argparse.Namespace | str
    try:
        choice = command_parser().parse_args(words[:cut])
    except SystemExit:  # of --help and --version
        return 0
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
