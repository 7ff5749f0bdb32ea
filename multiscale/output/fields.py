"""Writes the fields of a run for ParaView, whole or not at all."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from patchlaw.multiscale.scene_run import Run
from patchlaw.support.errors import NotWritten, PatchlawError
from patchlaw.support.files import PARTIAL_FOLDER, OwnFiles, remove, written
from patchlaw.support.parallel import on_root

_FILE_ERROR = re.compile("file|HDF5|XDMF|ADIOS", re.IGNORECASE)
"""Texts of the errors that dolfinx raises when a file cannot be written."""


def write_fields(folder: Path, run: Run) -> list[Path]:
    """Write displacements, stresses and pressures of the load steps that a scene names.

    Where no mesh was pressed itself, they are those of the scene's block under the contact
    pressures, or with laws under the mean pressures of the patches. Of a reference they are those
    of its finest rough block, with the pressures of the nodes.

    Args:
        folder: Folder of the results; made when missing.
        run: The run.

    Returns:
        The files written; none when no block took part, or a run that ended early came to none of
        the load steps.

    Raises:
        NotWritten: When they cannot be written whole.

    Note:
        Collective: every rank writes its part.
    """
    if not run.coupling.has_body or not (run.finished or run.observers.fields.kept):
        return []

    # The XDMF file contains the name of its HDF5 file. Both are therefore written under their
    # final names into a partial folder, and moved when they are complete.
    partial = folder / PARTIAL_FOLDER

    def make_empty() -> None:
        shutil.rmtree(partial, ignore_errors=True)  # A killed run may have left one.
        with written(partial):
            partial.mkdir(parents=True)

    on_root(run.comm, make_empty)
    try:
        _dump_fields(run, partial / "fields.xdmf")
        return on_root(run.comm, lambda: _move(partial, folder))
    except BaseException:
        # Every rank removes the folder: the others may be blocked in a collective call.
        shutil.rmtree(partial, ignore_errors=True)
        raise


def _dump_fields(run: Run, path: Path) -> None:
    """Write fields; an error of dolfinx about files becomes NotWritten, a bug stays as it is."""
    try:
        run.observers.fields.write(path, run.steps, finished=run.finished)
    except (OSError, RuntimeError) as error:
        if isinstance(error, PatchlawError) or not _FILE_ERROR.search(str(error)):
            raise
        atexit.register(_end_process, run.comm)
        final = path.parent.parent / path.name
        raise NotWritten(f"{final}: cannot be written: {error}") from error


def _end_process(comm: Any) -> None:
    """End a process that could not write fields, before MPI and HDF5 do.

    HDF5 1.10 does not survive a file that it could not close: the destructor of dolfinx's file
    aborts, and without it ``MPI_Finalize``, which closes the file again, is a segmentation fault.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    if comm is not None:
        comm.Abort(NotWritten.exit_code)
    os._exit(NotWritten.exit_code)


def _move(partial: Path, folder: Path) -> list[Path]:
    """Move files to their final place once all are complete.

    That is checked here, because not every writer raises an error when a disk is full.
    """
    names = sorted(path.name for path in partial.iterdir())
    for name in names:
        with written(folder / name):
            _check_complete(partial / name)
    with OwnFiles(folder).writing(names):
        for name in names:
            with written(folder / name):
                remove(folder / name)
                (partial / name).replace(folder / name)
    partial.rmdir()
    return [folder / name for name in names]


def _check_complete(path: Path) -> None:
    """Raise an OSError unless the disk holds the whole file."""
    if path.is_dir():
        return
    with path.open("rb") as file:
        os.fsync(file.fileno())
    if path.suffix == ".h5":
        import h5py

        h5py.File(path, "r").close()
    elif path.suffix == ".xdmf":
        try:
            ElementTree.parse(path)
        except ElementTree.ParseError:
            raise OSError("it is cut short") from None
