"""Writes the files of a run: tables, laws, provenance, figures, report."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from multiscale.couplings.coupling import Coupling
from multiscale.figures.files import (
    Drawing,
    FigureProcess,
    Pictures,
    file_kinds,
    pictures_of,
    write_pictures,
)
from multiscale.laws.law_file import hdf5_bytes, write_laws
from multiscale.output.provenance import provenance
from multiscale.output.report import report_html
from multiscale.results.contact_record import FIELDS, SPOT_COLUMNS, ContactRecord
from multiscale.results.history import COLUMNS, History
from multiscale.run import Run
from support.collective import on_root, shared
from support.cores import cores
from support.whole_files import remove, write_bytes, write_csv, write_text, written

_FIGURES = (
    "overview", "surface", "curves", "pressures", "contact", "shear", "laws", "block", "face",
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
    drawn = (figures or RunFigures(run)).drawn()
    run.remark(filter(None, (one.problem for one in drawn)))
    pictures = Pictures(dict(chain.from_iterable(one.files.items() for one in drawn)))
    with run.phase("writing"):
        return on_root(run.comm, lambda: _write(folder, run, pictures, options))


def _write(folder: Path, run: Run, pictures: Pictures, options: list[str]) -> list[Path]:
    for name in FILES:  # Files of an earlier run must not stand beside those of this one.
        with written(folder / name):
            remove(folder / name)
    history, table = run.history(), run.laws
    files = write_tables(folder, history) + write_contacts(folder, run.contacts)
    if table is not None:
        files.append(write_laws(folder / "laws.h5", table))
    files += write_pictures(folder, pictures)
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
            group.attrs.update(approach_mm=record.approach_mm, force_N=record.force_N)
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


class RunFigures:
    """The figures of a run.

    Ranks share them at its end. Of a process on its own with a further core, another process draws
    them: surface and laws while load steps are made.

    Args:
        run: The run.
    """

    def __init__(self, run: Run) -> None:
        self._run, self._figures = run, run.scene.output.figures
        self._process: FigureProcess | None = None
        self._begun: dict[str, Future[Pictures]] = {}

    def __enter__(self) -> RunFigures:
        """Return the figures."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process that draws."""
        if self._process is not None:
            self._process.close()

    def begin(self) -> None:
        """Have those drawn beside the load steps that do not depend on them."""
        # larger ones take minutes beside their figures, and long to send
        few = self._run.coupling.surface.heights.size <= 2**20
        if self._figures and self._run.comm is None and cores() > 1 and few:
            with suppress(OSError):  # no process can be started, and figures are drawn here
                self._process = FigureProcess()
                for drawing in self._before_load_steps():
                    self._begun[drawing.name] = self._process.draw(drawing)

    def drawn(self) -> list[Pictures]:
        """Return the files of all figures; none of a run without load steps, or that wants none.

        Note:
            Collective.
        """
        if not self._figures or not self._run.steps:
            return []
        with self._run.phase("output"):
            drawings = [*self._after_load_steps(), *self._before_load_steps()]
            if self._process is None:
                comm = self._run.comm
                return shared(comm, len(drawings), lambda index: pictures_of(drawings[index]))
            draw, begun = self._process.draw, self._begun
            starts = not all(one.done() for one in begun.values())  # then this one helps
            ahead = [begun.get(drawing.name) or draw(drawing) for drawing in drawings]
            return [
                pictures_of(drawing) if starts and one.cancel() else one.result()
                for drawing, one in zip(drawings, ahead, strict=True)
            ]

    def _before_load_steps(self) -> Iterator[Drawing]:
        yield surface_drawing(self._run.coupling)
        if (laws := self._run.laws) is not None:
            kinds = file_kinds(self._figures)
            yield Drawing("laws", "figures.curves.law_figure", (laws,), kinds)

    def _after_load_steps(self) -> Iterator[Drawing]:
        """Yield the figures of what was found.

        Note:
            Collective.
        """
        run, coupling, history = self._run, self._run.coupling, self._run.history()
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
            if contact.slipping is not None:
                figures["shear"] = "shear.shear_figure", (history, contact)
            of_cells = getattr(contact.pressure_MPa, "shape", None) == surface.grid
            if self._figures in ("all", "svg") and of_cells:
                ratio = coupling.materials.first.poisson_ratio
                figures["block"] = "block.contact_block", (surface, contact, ratio)
        for name, (function, arguments) in figures.items():
            yield Drawing(name, f"figures.{function}", arguments, file_kinds(self._figures))
