"""Runs one parsed command on all ranks of an MPI job: its scene, its options, its exit code."""

from __future__ import annotations

import argparse
import errno
import gc
import sys
import time
import traceback
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patchlaw.multiscale import console
from patchlaw.multiscale.cli.interruption import ended_if_told
from patchlaw.multiscale.console import printing
from patchlaw.multiscale.machine import (
    check_address_space,
    keep_libraries_from_signals,
    refuse_detached_processes,
    share_petsc_options,
    world,
)
from patchlaw.support import InputError, NotWritten, OutOfMemory, PatchlawError, hold_blas, on_root
from patchlaw.support.packages import configured_elsewhere, load_wheels_mpi, optional_packages

if TYPE_CHECKING:
    from patchlaw.multiscale.scene.scene import Scene

_LONGEST_WAIT = 5.0  # for other ranks at the end of a command [s]
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EPIPE)
_SOLVER_OPTIONS = ("-snes_", "-ksp_", "-pc_", "-mg_")


def execute(choice: argparse.Namespace | str, options: list[str]) -> int:
    """Run one command and return its exit code, see `multiscale.cli.command_line.main`.

    Args:
        choice: The parsed words, or why they are not understood.
        options: PETSc options given by the user.

    Note:
        Collective over all processes of the MPI job, which starts here.
    """
    with configured_elsewhere() as petsc_words:
        return _execute(choice, options, petsc_words)


def _execute(choice: argparse.Namespace | str, options: list[str], petsc_words: list[str]) -> int:
    keep_libraries_from_signals()
    try:
        check_address_space()
        comm = world()
        hold_blas()
    except InputError as error:
        console.complain(None, error)
        return error.exit_code
    meeting = None if comm is None else comm.Dup()  # for the barrier at the end alone
    try:
        if isinstance(choice, str):
            raise InputError(choice, key="command line")
        module, _, function = choice.function.partition(".")
        words = vars(choice)
        shown = printing(quiet=words.get("quiet", False), progress=words.get("progress"))
        with ended_if_told(), optional_packages(), shown:
            command = getattr(import_module(f"patchlaw.multiscale.cli.{module}"), function)
            if not gc.isenabled():  # see `patchlaw.__main__`
                gc.freeze()
                gc.enable()
            share_petsc_options(comm)
            command(choice, _start_petsc(options, petsc_words), comm)
    except PatchlawError as error:
        together = _all_arrive(meeting)
        console.complain(comm if together else None, error)
        return error.exit_code if together else _end_all(comm, error.exit_code)
    except BaseException as error:
        return _end_all(comm, _told(error, comm))
    _all_arrive(meeting)
    return 0


def _told(error: BaseException, comm: Any) -> int:
    """Say what ended a command on this rank alone, and return its exit code.

    Raises:
        BaseException: The error itself, where a process on its own has it handled further up.
    """
    if isinstance(error, SystemExit):  # of rich, when nobody reads standard output any more
        return NotWritten.exit_code
    if isinstance(error, MemoryError):
        console.complain(None, OutOfMemory(f"memory ran out: {error or 'none is left'}"))
        return OutOfMemory.exit_code
    output_full = isinstance(error, OSError) and error.errno in _FULL
    if comm is None and (output_full or not isinstance(error, Exception)):
        raise error
    if isinstance(error, KeyboardInterrupt):
        return int(getattr(error, "exit_code", 1))
    if comm is not None:
        # several ranks may meet the same error: the first ends the others before they print it
        time.sleep(min(comm.rank, _LONGEST_WAIT))
    traceback.print_exception(error)
    return 1


def scene_and_folder(
    choice: argparse.Namespace, comm: Any, *, ending: str = ""
) -> tuple[Scene, Path]:
    """Read the scene on rank 0 and find the folder of its results.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator; None for a process on its own.
        ending: How the folder's name ends, unless the user names a folder; see `folder_name`.

    Returns:
        The scene and the folder, the same on every rank.

    Raises:
        InputError: When the scene cannot be used, or this process is one of several that should be
            one MPI job and are not.

    Note:
        Collective.
    """
    from patchlaw.multiscale.runs.output.results_folder import (
        folder_name,  # `help` and `schema` do without
    )
    from patchlaw.multiscale.scene.scene import Scene

    refuse_detached_processes()

    def read() -> tuple[Scene, Path]:
        scene = Scene.load(choice.scene, choice.set)
        return scene, choice.out or Path("results") / folder_name(scene.name, choice.set, ending)

    return on_root(comm, read)


def refuse_other_kind(folder: Path, *, cases: bool) -> None:
    """Refuse a run where cases of a study are, and these where a run is: their files have one name.

    Args:
        folder: The folder.
        cases: Whether cases are to be written, of a sweep or a comparison.

    Raises:
        InputError: When the folder holds the other kind alone.
    """
    from patchlaw.multiscale.runs.cases import Journal
    from patchlaw.multiscale.runs.output.results_folder import (
        FILE_NAME,  # `help` and `schema` do without
    )

    of_run = any((folder / name).exists() for name in ("provenance.json", FILE_NAME))
    if (of_run, not Journal(folder, {}).files()) == (cases, cases):
        held = "a run" if of_run else "cases of a sweep or a comparison"
        raise InputError(f"holds {held}", key="--out", value=str(folder), allowed="another folder")


def _all_arrive(comm: Any) -> bool:
    """Wait for the other ranks at the end of a command; return False when some do not come.

    An error that only this rank met leaves the others waiting in the middle of something.
    """
    if comm is None:
        return True
    barrier = comm.Ibarrier()
    until = time.monotonic() + _LONGEST_WAIT
    while not barrier.Test():
        if time.monotonic() > until:
            return False
        time.sleep(0.01)
    return True


def _end_all(comm: Any, code: int) -> int:
    """End all ranks of a job at once; a process on its own is left to return."""
    if comm is not None:
        sys.stderr.flush()
        comm.Abort(code)
    return code


def _start_petsc(options: list[str], words: list[str]) -> list[str]:
    """Start PETSc with the user's options; solver options get the prefix of our solver."""
    if not options:
        return []
    load_wheels_mpi()
    prefixed = [
        f"-patchlaw_{word[1:]}" if word.startswith(_SOLVER_OPTIONS) else word for word in options
    ]
    # a misspelt option is no error for PETSc: -options_left names unused options at the end
    words += [*prefixed, "-options_left"]
    try:
        import petsc4py  # noqa: F401
    except Exception as error:
        raise InputError(
            "PETSc does not start with these options", key="--", value=" ".join(options)
        ) from error
    return prefixed
