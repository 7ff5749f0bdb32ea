"""Writes the fields of the last load step for ParaView: all files whole, or none."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import h5py

from geometry.collective import on_root
from geometry.errors import NotWritten, PatchlawError
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.run import Run
from multiscale.storage.whole_files import remove, written

_ASIDE = ".fields.partial-files"  # `outputs.remove_partial` knows it by its middle
_OF_FILES = re.compile("file|HDF5|XDMF|ADIOS", re.IGNORECASE)  # in what dolfinx says of them


def write_fields(folder: Path, run: Run) -> list[Path]:
    """Write displacement and pressure of the last load step as XDMF and VTX, for ParaView.

    Args:
        folder: Where to; made when missing.
        run: The run.

    Returns:
        The files written; none when no block took part. Where the mesh was not pressed itself,
        the displacements are those of the scene's block under the patches' mean pressures. A
        reference has its finest rough block and the pressures of its nodes.

    Raises:
        NotWritten: When they cannot be written whole.

    Note:
        Collective: every rank writes its part.
    """
    if not run.setup.has_block or not run.steps:
        return []

    # The XDMF file names its HDF5 file, so both are written under their names in a folder aside.
    aside, write = folder / _ASIDE, _writer(run)

    def empty() -> None:
        shutil.rmtree(aside, ignore_errors=True)  # a crash may have left one
        with written(aside):
            aside.mkdir(parents=True)

    on_root(run.comm, empty)
    try:
        _tried(write, aside / "fields.xdmf", run.comm)
        return on_root(run.comm, lambda: _moved(aside, folder))
    except BaseException:
        shutil.rmtree(aside, ignore_errors=True)  # by any rank: the others may be stuck
        raise


def _writer(run: Run) -> Callable[[Path], None]:
    """Return what writes the last load step: of the rough block, or the flat one with patches."""
    import macro

    if isinstance(run.coupling, ReferenceCoupling):
        finest, latest = run.coupling.finest, run.coupling.latest
        return lambda path: macro.write_rough_fields(path, finest, latest)
    interface, displacement = run.last_field()
    pressure = run.steps[-1].patches.pressure_MPa
    return lambda path: macro.write_fields(path, interface, displacement, pressure)


def _tried(write: Callable[[Path], None], path: Path, comm: Any) -> None:
    """Write; what dolfinx says against its files, and not of bugs, becomes an error of ours."""
    try:
        write(path)
    except (OSError, RuntimeError) as error:
        if isinstance(error, PatchlawError) or not _OF_FILES.search(str(error)):
            raise
        atexit.register(_end, comm)
        named = path.parent.parent / path.name
        raise NotWritten(f"{named}: cannot be written: {error}") from error


def _end(comm: Any) -> None:
    """End at once: HDF5 would write again what it could not, when the process ends, and crash."""
    sys.stdout.flush()
    sys.stderr.flush()
    if comm is not None:
        comm.Abort(NotWritten.exit_code)
    os._exit(NotWritten.exit_code)


def _moved(aside: Path, folder: Path) -> list[Path]:
    """Give complete files their place; not all writers tell when a disk is full."""
    files = sorted(aside.iterdir())
    for path in files:
        with written(folder / path.name):
            _complete(path)
    for path in files:
        with written(folder / path.name):
            remove(folder / path.name)
            path.replace(folder / path.name)
    aside.rmdir()
    return [folder / path.name for path in files]


def _complete(path: Path) -> None:
    """Raise an OSError unless a file is on the disk as a whole."""
    if path.is_dir():
        return
    with path.open("rb") as file:
        os.fsync(file.fileno())
    if path.suffix == ".h5":
        h5py.File(path, "r").close()
    elif path.suffix == ".xdmf":
        try:
            ElementTree.parse(path)
        except ElementTree.ParseError:
            raise OSError("it is cut short") from None
