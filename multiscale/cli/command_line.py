"""The command ``patchlaw``: parses words, runs a command, turns errors into exit codes."""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
import traceback
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NoReturn

from geometry.errors import InputError, NotWritten, OutOfMemory, PatchlawError
from multiscale.cli import commands
from multiscale.cli import compare as compare_command
from multiscale.cli import doctor as doctor_command
from multiscale.machine.mpi_job import check_address_space, keep_petsc_from_signals, world
from multiscale.output import terminal
from multiscale.output.streams import sturdy_streams
from multiscale.restart.interruption import Ended, ended_by_signals

_MOST_PATIENT = 5.0  # with other ranks, at the end [s]
_OPTION_FILES = ("-options_file", "-options_file_yaml")
_SIGNALLED = (129, 130, 143)
_SOLVER_OPTIONS = ("-snes_", "-ksp_", "-pc_", "-mg_")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see: {self.prog} --help)", key="command line")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Works the same under ``mpirun``: rank 0 talks and writes.

    Args:
        arguments: Words of the command line after the program's name; what follows ``--`` are
            PETSc options.

    Returns:
        0 done; 2 the input is wrong and nothing was written; 3 not converged, the state up to
        there kept; 4 stopped in time; 5 a file cannot be written, or what was to be printed; 129,
        130 and 143 stopped by SIGHUP, SIGINT and SIGTERM; 1 a bug. After all but 0, 1 and 2
        ``patchlaw run --resume`` goes on from the last load step.

    Note:
        Collective over all processes of the MPI job.
    """
    with sturdy_streams() as (output, errors), ended_by_signals():
        try:
            code = _run(arguments)
        except SystemExit:  # of --help and --version
            code = 0
        except KeyboardInterrupt:
            code = 130
        except Ended as told:
            code = told.exit_code
        output.flush()
        failure = output.failure or errors.failure
        if failure is None or isinstance(failure, BrokenPipeError) or code in (1, *_SIGNALLED):
            return code  # whoever closed a pipe has read enough
        name = "standard output" if failure is output.failure else "standard error"
        problem = failure.strerror or failure
        terminal.complain(None, NotWritten(f"{name}: cannot be written: {problem}"))
        return NotWritten.exit_code


def _run(arguments: Sequence[str] | None) -> int:
    """Run one command and return its exit code."""
    keep_petsc_from_signals()
    try:
        check_address_space()
        comm = world()
    except InputError as error:
        terminal.complain(None, error)
        return error.exit_code
    meeting = None if comm is None else comm.Dup()  # none else must send anything through it
    words = list(sys.argv[1:] if arguments is None else arguments)
    cut = words.index("--") if "--" in words else len(words)
    try:
        choice = _parser().parse_args(words[:cut])
        choice.command(choice, _given_to_petsc(words[cut + 1 :]), comm)
    except PatchlawError as error:
        if _met_by_all(meeting):
            terminal.complain(comm, error)
            return error.exit_code
        terminal.complain(None, error)
        return _ended(comm, error.exit_code)
    except KeyboardInterrupt:
        return _ended(comm, 130)
    except Ended as told:
        return _ended(comm, told.exit_code)
    except MemoryError as error:
        terminal.complain(None, OutOfMemory(f"memory ran out: {error or 'none is left'}"))
        return _ended(comm, OutOfMemory.exit_code)
    except Exception:
        if comm is not None:
            time.sleep(min(comm.rank, _MOST_PATIENT))  # of ranks with the same error, one tells it
        traceback.print_exc()
        return _ended(comm, 1)
    _met_by_all(meeting)
    return 0


def _met_by_all(comm: Any) -> bool:
    """Wait for the other ranks at the end of a command; False when some do not come.

    An error that only this rank met leaves them waiting in the middle of something.
    """
    if comm is None:
        return True
    barrier = comm.Ibarrier()
    until = time.monotonic() + _MOST_PATIENT
    while not barrier.Test():
        if time.monotonic() > until:
            return False
        time.sleep(0.01)
    return True


def _ended(comm: Any, code: int) -> int:
    """End all ranks of a job at once; a process on its own is left to return."""
    if comm is not None:
        sys.stderr.flush()
        comm.Abort(code)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="patchlaw",
        description="Multiscale contact of rough surfaces.",
        epilog="PETSc options follow after --, such as: patchlaw run scene.toml -- -ksp_monitor",
    )
    parser.add_argument("--version", action="version", version=_versions())
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    for name, command in {
        "run": commands.run_scene,
        "plan": commands.plan_scene,
        "compare": compare_command.compare_scene,
        "laws": commands.tabulate_scene,
        "surface": commands.describe_surface,
    }.items():
        sub = subparsers.add_parser(name, help=_summary(command), description=_summary(command))
        sub.set_defaults(command=command)
        if name == "run":
            _add_interruption(sub)
        sub.add_argument("scene", type=Path, help="scene file (TOML)")
        ending = compare_command.ENDING if name == "compare" else ""
        text = f"folder of the results (default: results/SCENE{ending}, by the file's name)"
        if name == "plan":
            text = "for the words of a run: a plan writes nothing"
        sub.add_argument("--out", type=Path, metavar="DIR", help=text)
        sub.add_argument(
            "--set",
            nargs="+",
            action="extend",
            default=[],
            metavar="KEY=VALUE",
            help="change keys of the scene, such as load.approach='4 um'",
        )
        if command is compare_command.compare_scene:
            compare_command.add_options(sub)
    schema = subparsers.add_parser("schema", help=_summary(commands.print_schema))
    schema.set_defaults(command=commands.print_schema)
    doctor_command.add_commands(subparsers)
    return parser


def _versions() -> str:
    """Return the versions of patchlaw and of the finite elements, which are not loaded for it."""
    found = []
    for name, distribution in (("patchlaw", "patchlaw"), ("dolfinx", "fenics-dolfinx")):
        try:
            found.append(f"{name} {version(distribution)}")
        except PackageNotFoundError:
            found.append(f"{name} not installed")
    return ", ".join(found)


def _add_interruption(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--resume", action="store_true", help="go on after the last load step of an interrupted run"
    )
    parser.add_argument(
        "--max-time", metavar="TIME", help="stop cleanly before so much wall time is over, as 55m"
    )


def _summary(command: Any) -> str:
    """Return the first line of a command's docstring, which ``python -OO`` leaves out."""
    return (command.__doc__ or "").partition("\n")[0]


def _given_to_petsc(options: list[str]) -> list[str]:
    """Hand options to PETSc before it starts; solver options get the prefix of our solver."""
    if not options:
        return []
    import petsc4py

    prefixed = [
        f"-patchlaw_{word[1:]}" if word.startswith(_SOLVER_OPTIONS) else word for word in options
    ]
    _check_files(options)
    try:
        # a misspelt option is no error for PETSc; at the end it names those that nobody asked for
        petsc4py.init(["patchlaw", *prefixed, "-options_left"])
    except Exception as error:
        raise InputError(
            "PETSc does not start with these options", key="--", value=" ".join(options)
        ) from error
    return prefixed


def _check_files(options: list[str]) -> None:
    """Refuse files of options that PETSc could not read: it would not start, at great length."""
    for name, value in itertools.pairwise([*options, ""]):
        if name in _OPTION_FILES and not os.access(value, os.R_OK):
            raise InputError("this file of options cannot be read", key=name, value=value)
