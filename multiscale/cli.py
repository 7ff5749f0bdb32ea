"""The command ``patchlaw``: parses words, runs a command, turns errors into exit codes."""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from geometry.errors import InputError, PatchlawError
from multiscale import commands, compare_command, terminal

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
        there kept; 1 a bug.

    Note:
        Collective over all processes of the MPI job.
    """
    comm = _world()
    words = list(sys.argv[1:] if arguments is None else arguments)
    cut = words.index("--") if "--" in words else len(words)
    try:
        choice = _parser().parse_args(words[:cut])
        choice.command(choice, _given_to_petsc(words[cut + 1 :]), comm)
    except PatchlawError as error:
        terminal.complain(comm, error)
        return error.exit_code
    except BrokenPipeError:  # whoever read our output has enough
        sys.stderr.close()
        return 0
    except Exception:
        traceback.print_exc()
        if comm is not None:
            comm.Abort(1)  # the other ranks may wait for this one
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="patchlaw",
        description="Multiscale contact of rough surfaces.",
        epilog="PETSc options follow after --, such as: patchlaw run scene.toml -- -ksp_monitor",
    )
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
        sub.add_argument("scene", type=Path, help="scene file (TOML)")
        sub.add_argument("--out", type=Path, metavar="DIR", help="folder of the results")
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
    return parser


def _summary(command: Any) -> str:
    """Return the first line of a command's docstring."""
    return command.__doc__.partition("\n")[0]


def _world() -> Any:
    """Return the communicator of an MPI job, or None for a process on its own."""
    from mpi4py import MPI

    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None


def _given_to_petsc(options: list[str]) -> list[str]:
    """Hand options to PETSc before it starts; solver options get the prefix of our solver."""
    if not options:
        return []
    import petsc4py

    prefixed = [
        f"-patchlaw_{word[1:]}" if word.startswith(_SOLVER_OPTIONS) else word for word in options
    ]
    # a misspelt option is no error for PETSc; at the end it names those that nobody asked for
    petsc4py.init(["patchlaw", *prefixed, "-options_left"])
    return prefixed
