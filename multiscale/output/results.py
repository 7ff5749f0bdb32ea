"""Writes the files of a run: tables, laws, provenance, figures, report; fields for ParaView."""

from __future__ import annotations

import atexit
import json
import os
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from multiscale.couplings.coupling import Coupling
from multiscale.figures.contact_scales import ContactScales
from multiscale.figures.files import (
    Drawing,
    FigureProcess,
    Pictures,
    file_kinds,
    pictures_of,
    write_pictures,
)
from multiscale.laws.law_file import hdf5_bytes, write_laws
from multiscale.loading.load_step import COLUMNS
from multiscale.output.provenance import provenance
from multiscale.output.report import CONTACT_OF_STEP, report_html, shown_contacts
from multiscale.results.contact_record import FIELDS, SPOT_COLUMNS, ContactRecord
from multiscale.results.history import History
from multiscale.run import Run
from multiscale.scene.scene import Scene
from support.collective import on_root, shared
from support.cores import cores
from support.errors import NotWritten, PatchlawError
from support.whole_files import remove, write_bytes, write_csv, write_text, written

PARTIAL_FOLDER = ".fields.partial-files"
"""Folder of files that are not complete; `remove_partial` knows it by ``.partial-``."""
_FILE_ERROR = re.compile("file|HDF5|XDMF|ADIOS", re.IGNORECASE)
"""Texts of the errors that dolfinx raises when a file cannot be written."""
_MOST_PROCESSES = 3
"""Processes that draw; a run has five to nine figures."""

_FIGURES = (
    "overview", "surface", "curves", "pressures", "contact", "shear", "laws", "block", "face",
    "leak",
)  # fmt: skip

FILES = (
    "history.csv", "patches.csv", "reference.csv", "laws.h5", "provenance.json", "report.html",
    "contacts.csv", "contact.h5", "fields.xdmf", "fields.h5", "fields.bp",
    "counter_fields.xdmf", "counter_fields.h5", "counter_fields.bp",
    *(f"{name}.{kind}" for name in _FIGURES for kind in ("png", "svg")),
)  # fmt: skip
"""All files that a run may write."""


def write_results(
    folder: Path, run: Run, *, options: list[str], figures: RunFigures | None = None
) -> list[Path]:
    """Write the files of a run, finished or stopped.

    Args:
        folder: Folder of the results; made when missing.
        run: The run.
        options: PETSc options given by the user, for the provenance.
        figures: The figures of the run, where some were begun before; the caller ends them.

    Returns:
        The files written.

    Note:
        Collective: all ranks draw, rank 0 writes.
    """
    drawn = (figures or RunFigures(run.scene, run.comm)).drawn(run)
    run.remark(filter(None, (one.problem for one in drawn)))
    pictures = Pictures(dict(chain.from_iterable(one.files.items() for one in drawn)))
    with run.clock.phase("writing"):
        return on_root(run.comm, lambda: _write(folder, run, pictures, options))


def _write(folder: Path, run: Run, pictures: Pictures, options: list[str]) -> list[Path]:
    for name in FILES:  # Files of an earlier run must not stand beside those of this one.
        with written(folder / name):
            remove(folder / name)
    history, table = run.history(), run.laws
    files = write_tables(folder, history) + write_contacts(folder, run.contacts)
    if table is not None:
        files.append(write_laws(folder / "laws.h5", table))
    files += write_pictures(folder, pictures.without(CONTACT_OF_STEP))
    facts = provenance(run, options=options)
    files.append(write_text(folder / "provenance.json", json.dumps(facts, indent=2) + "\n"))
    if run.scene.output.report:
        files.append(write_text(folder / "report.html", report_html(run, pictures.files, facts)))
    return files


def write_tables(folder: Path, history: History) -> list[Path]:
    """Write ``history.csv``, ``patches.csv`` and, for a reference, ``reference.csv``.

    Args:
        folder: Folder of the results; made when missing.
        history: The load steps.

    Returns:
        The files written.
    """
    header = [column.name for column in COLUMNS]
    rows = ([column.of(step) for column in COLUMNS] for step in history)
    files = [
        write_csv(folder / "history.csv", header, rows),
        write_csv(folder / "patches.csv", history.patch_columns, history.patch_rows()),
    ]
    if history.reference is not None:
        columns = history.reference.columns(history.steps)
        values = zip(*columns.values(), strict=True)
        files.append(write_csv(folder / "reference.csv", list(columns), values))
    return files


def write_records(path: Path, records: Iterator[Mapping[str, Any]]) -> Path | None:
    """Write records as rows; the names of the first one's values are the columns.

    Args:
        path: File to write.
        records: The records; none make no file.
    """
    first = next(records, None)
    if first is None:
        return None
    return write_csv(path, list(first), (list(one.values()) for one in chain([first], records)))


def write_contacts(folder: Path, contacts: Sequence[ContactRecord]) -> list[Path]:
    """Write ``contacts.csv`` and, where fields are known, ``contact.h5``, with a group a load step.

    Args:
        folder: Folder of the results; made when missing.
        contacts: The contacts, nothing is written without any.

    Returns:
        The files written.
    """
    if not contacts:
        return []
    header = ("step", "spot", *SPOT_COLUMNS)
    rows = (row for record in contacts for row in record.rows())
    files = [write_csv(folder / "contacts.csv", header, rows)]

    def fill(file: Any) -> None:
        file.attrs["units"] = "mm, N, MPa"
        for record in contacts:
            group = file.create_group(f"step_{record.step}")
            group.attrs.update(
                approach_mm=record.approach_mm,
                force_N=record.force_N,
                unloading=record.unloading,
            )
            for name in FIELDS:
                if (data := getattr(record, name)) is not None:
                    # most of a map of pressures is zero
                    group.create_dataset(name, data=data, compression=1)

    if contacts[0].pressure_MPa is not None:
        files.append(write_bytes(folder / "contact.h5", hdf5_bytes(fill)))
    return files


def surface_drawing(coupling: Coupling) -> Drawing:
    """Return the figure of a scene's surface, with its summits where the micro model uses them.

    Args:
        coupling: What was made of the scene.
    """
    output, spectrum = coupling.scene.output, coupling.scene.surface.spectrum
    surface = replace(coupling.surface)  # without its interpolant, which is not drawn
    about = surface, coupling.summits, coupling.patches, spectrum
    return Drawing("surface", "figures.surface.surface_figure", about, file_kinds(output.figures))


def _contacts_of_steps(contacts: Sequence[ContactRecord]) -> Iterator[Drawing]:
    """Yield figures of several contacts, which have the same colour scales, for the report."""
    shown = shown_contacts(contacts)
    scales = ContactScales.of(shown)
    for record in shown:
        name = f"{CONTACT_OF_STEP}{record.step}"
        yield Drawing(name, "figures.contact.contact_maps", (record, scales))


class RunFigures:
    """The figures of a run.

    Ranks share them at its end. Of a process on its own with a further core, other processes draw
    them: surface and laws while load steps are made.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
    """

    def __init__(self, scene: Scene, comm: Any) -> None:
        self._figures, self._comm = scene.output.figures, comm
        self._process: FigureProcess | None = None
        self._begun: dict[str, Future[Pictures]] = {}

    def __enter__(self) -> RunFigures:
        """Start the processes that draw, which load what they need while the run is set up."""
        if self._figures and self._comm is None and (count := cores()) > 1:
            with suppress(OSError):  # none can be started, and figures are drawn here
                self._process = FigureProcess(min(count, _MOST_PROCESSES))
        return self

    def __exit__(self, *error: object) -> None:
        """End the processes that draw."""
        if self._process is not None:
            self._process.close()

    def begin(self, run: Run) -> None:
        """Have those drawn beside the load steps that do not depend on them.

        Args:
            run: The run.
        """
        # larger ones take minutes beside their figures, and long to send
        if self._process is not None and run.coupling.surface.heights.size > 2**20:
            self._process.close()
            self._process = None
        if self._process is not None:
            for drawing in self._before_load_steps(run):
                self._begun[drawing.name] = self._process.draw(drawing, beside=True)

    def drawn(self, run: Run) -> list[Pictures]:
        """Return the files of all figures; none of a run without load steps, or that wants none.

        Args:
            run: The run.

        Note:
            Collective.
        """
        if not self._figures or not run.steps:
            return []
        with run.clock.phase("output"):
            drawings = [*self._after_load_steps(run), *self._before_load_steps(run)]
            if self._process is None:
                comm = self._comm
                return shared(comm, len(drawings), lambda index: pictures_of(drawings[index]))
            ahead = []
            for drawing in drawings:
                begun = self._begun.get(drawing.name)
                if begun is None or begun.cancel():
                    begun = self._process.draw(drawing)
                ahead.append(begun)
            return [one.result() for one in ahead]

    def _before_load_steps(self, run: Run) -> Iterator[Drawing]:
        yield surface_drawing(run.coupling)
        if (laws := run.laws) is not None:
            kinds = file_kinds(self._figures)
            yield Drawing("laws", "figures.curves.law_figure", (laws,), kinds)

    def _after_load_steps(self, run: Run) -> Iterator[Drawing]:
        """Yield the figures of what was found.

        Note:
            Collective.
        """
        coupling, history = run.coupling, run.history()
        surface, of_samples = replace(coupling.surface), coupling.regions is not None
        face = coupling.face_pressures()
        figures: dict[str, tuple[str, Any]] = {
            "overview": ("contact.overview_figure", (surface, of_samples, history, face)),
            "curves": ("curves.history_figure", (history, run.scene.kind)),
        }
        if not of_samples:
            figures["pressures"] = "contact.pressure_figure", (history,)
        if face is not None:
            figures["face"] = "contact.face_figure", (face, history.steps[-1])
        if run.contacts:
            contact = run.contacts[-1]
            figures["contact"] = "contact.contact_figure", (contact,)
            of_cells = getattr(contact.pressure_MPa, "shape", None) == surface.grid
            if self._figures in ("all", "svg") and of_cells and contact.force_N > 0.0:
                ratio = coupling.materials.first.poisson_ratio
                figures["block"] = "block.contact_block", (surface, contact, ratio)
        for name, function, of in run.observers.figures(history):
            figures[name] = function, of
        for name, (function, arguments) in figures.items():
            yield Drawing(name, f"figures.{function}", arguments, file_kinds(self._figures))
        if run.scene.output.report:
            yield from _contacts_of_steps(run.contacts)


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
