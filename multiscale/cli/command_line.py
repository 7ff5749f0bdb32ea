"""The command ``patchlaw``: parses its words, then loads and runs one command.

Nothing but the standard library is imported before the words are understood, so that ``--help``
takes a tenth of a second.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from multiscale.cli.words import UsageError, command_parser
from multiscale.output.streams import sturdy_streams
from multiscale.restart.interruption import ended_if_told, signals_raise


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
    from support.errors import NotInstalled
    from support.packages import conflict, optional_packages

    try:
        if problem := conflict():
            raise NotInstalled(problem)
        with optional_packages():
            from multiscale.cli.execution import execute
    except NotInstalled as error:  # what other errors are written with may be missing
        print(f"patchlaw: {error}", file=sys.stderr)
        return error.exit_code
    return execute(choice, words[cut + 1 :])
